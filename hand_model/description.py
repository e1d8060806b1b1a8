"""A compiled hand on disk: one folder, the files in it, and the hand that they were written from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import DescriptionError, did_you_mean
from .hand import Hand, load_hand


@dataclass(frozen=True)
class Model:
    """The files of one variant (one position of the thumb). fingers: those in it."""

    stem: str
    mjcf: Path
    urdf: Path
    scene: Path
    fingers: tuple[str, ...]


@dataclass(frozen=True)
class Description:
    """A compiled folder. models: the plain variant first. hand: as in hand.json (complete, all thumb positions).

    table: what hand.json holds besides the hand (names, losses, guesses; see its README).
    """

    folder: Path
    side: str
    models: tuple[Model, ...]
    hand: Hand
    table: Mapping[str, Any]

    @property
    def mjcf(self) -> Path:
        """MJCF of the plain variant."""
        return self.models[0].mjcf

    @property
    def urdf(self) -> Path:
        """URDF of the plain variant."""
        return self.models[0].urdf

    @property
    def scene(self) -> Path:
        """Scene of the plain variant."""
        return self.models[0].scene

    def model(self, stem: str) -> Model:
        """The variant of that stem; raises DescriptionError with a near name."""
        for model in self.models:
            if model.stem == stem:
                return model
        raise DescriptionError(
            f'{self.folder}: no variant "{stem}"; {did_you_mean(stem, [m.stem for m in self.models])}'
        )


def read_description(folder: str | Path) -> Description:
    """Read a compiled folder; raises DescriptionError where hand.json or a file that it names is missing or damaged."""
    root = Path(folder)
    file = root / "hand.json"
    if not file.is_file():
        raise DescriptionError(f"{file}: no such file; a compiled hand is a folder with a hand.json")
    hand = load_hand(file)
    try:
        table = json.loads(file.read_text())["description"]
        models = tuple(
            Model(m["stem"], root / m["mjcf"], root / m["urdf"], root / m["scene"], tuple(m["fingers"]))
            for m in table["models"]
        )
    except (KeyError, TypeError) as error:
        raise DescriptionError(f"{file}: not written by compile (no {error})") from None
    for model in models:
        for path in (model.mjcf, model.urdf, model.scene):
            if not path.is_file():
                raise DescriptionError(f"{path}: no such file, though hand.json names it")
    return Description(root, hand.side, models, hand, table)


def embedded() -> Mapping[str, Path]:
    """Name -> folder of the hands that come with this package, wherever it is installed."""
    here = Path(__file__).resolve().parent
    found: dict[str, Path] = {}
    for assets in (here.parent / "assets", here / "assets"):
        if assets.is_dir():
            found.update({p.parent.name: p.parent for p in sorted(assets.glob("*/hand.json"))})
    return found


def load(name: str | Path, scene: bool = False) -> Any:
    """The MuJoCo model (mujoco.MjModel) of an embedded hand such as "bebionic_left", of its variant such as
    "bebionic_left_thumb_1", or of a compiled folder.

    Raises DescriptionError with a near name where there is none.
    """
    import mujoco

    hands = embedded()
    folder = Path(name)
    if not (folder / "hand.json").is_file():
        stems = {m.stem: (f, m.stem) for f in hands.values() for m in read_description(f).models}
        if str(name) not in stems:
            raise DescriptionError(f'no hand "{name}" comes with this package; {did_you_mean(str(name), stems)}')
        folder, stem = stems[str(name)]
    else:
        stem = read_description(folder).models[0].stem
    model = read_description(folder).model(stem)
    return mujoco.MjModel.from_xml_path(str(model.scene if scene else model.mjcf))
