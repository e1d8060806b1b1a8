"""The manifest `session.toml` and what it declares: hand, probe, actuators, fingers, trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError, did_you_mean
from .log import Log, read_log
from .mocap import Mocap, read_mocap

Array = NDArray[np.float64]

FORMAT = "hand-session/1"
TRIAL_KINDS = ("flexion", "excitation", "grasp", "landmark", "joint_probe", "surface", "motion", "pivot")


@dataclass(frozen=True)
class PalmMarkers:
    """Labels of the three palm markers."""

    origin: str
    medial: str
    lateral: str

    @property
    def labels(self) -> tuple[str, str, str]:
        """The labels in the order origin, medial, lateral."""
        return self.origin, self.medial, self.lateral


@dataclass(frozen=True)
class Probe:
    """The pointing tool. labels: marker labels. position_probe: (m, 3) [m] in its own frame, tip at the origin;
    None where the tip is not known and a `pivot` trial calibrates it."""

    labels: tuple[str, ...]
    position_probe: Array | None


@dataclass(frozen=True)
class Actuator:
    """One motor: one encoder channel, one current channel. speed_full, current_full: raw full scales."""

    name: str
    speed_full: float | None = None
    current_full: float | None = None


@dataclass(frozen=True)
class Segment:
    """One moving segment of a finger and the labels of its markers (three or more, not on one line)."""

    name: str
    markers: tuple[str, ...]


@dataclass(frozen=True)
class Finger:
    """A finger: its actuator (None for kinematics only) and its segments from the palm outwards."""

    name: str
    actuator: str | None
    segments: tuple[Segment, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """All marker labels of the finger, palm outwards."""
        return tuple(label for segment in self.segments for label in segment.markers)


@dataclass(frozen=True)
class Rig:
    """A recorded mechanism that is no hand. model: its MJCF file. signals: log column -> quantity of the model."""

    model: Path
    signals: Mapping[str, str]


@dataclass(frozen=True)
class Trial:
    """One recording. name: its file relative to the session, log before mocap; set: parameters the laboratory changed."""

    kind: str
    name: str
    finger: str | None = None
    mocap_path: Path | None = None
    log_path: Path | None = None
    landmark: str | None = None
    joint: str | None = None
    side: str | None = None
    segment: str | None = None
    object: str | None = None
    stiffness: float | str | None = None
    validate: bool = False
    set: Mapping[str, Any] = field(default_factory=dict)

    def mocap(self) -> Mocap:
        """Read the marker trajectories; raises SessionError where the trial has none."""
        if self.mocap_path is None:
            raise SessionError(f'trial "{self.name}" ({self.kind}) has no mocap file')
        return read_mocap(self.mocap_path)

    def log(self) -> Log:
        """Read the actuator log; raises SessionError where the trial has none."""
        if self.log_path is None:
            raise SessionError(f'trial "{self.name}" ({self.kind}) has no log')
        return read_log(self.log_path)


@dataclass(frozen=True)
class Session:
    """A recording session. side: "left" | "right". gravity_world: (3,) [m/s^2] or None. notes: what was ignored."""

    path: Path
    hand: str
    side: str
    gravity_world: Array | None
    palm: PalmMarkers | None
    probe: Probe | None
    actuators: tuple[Actuator, ...]
    fingers: tuple[Finger, ...]
    trials: tuple[Trial, ...]
    rig: Rig | None = None
    notes: tuple[str, ...] = ()

    def finger(self, name: str) -> Finger:
        """The finger of that name; raises SessionError with a near name."""
        for finger in self.fingers:
            if finger.name == name:
                return finger
        raise SessionError(f'{self.path}: no finger "{name}"; {did_you_mean(name, [f.name for f in self.fingers])}')

    def select(self, kind: str, finger: str | None = None, validate: bool | None = None) -> tuple[Trial, ...]:
        """Trials of one kind, optionally of one finger, optionally only (True) or never (False) validation trials."""
        return tuple(
            t
            for t in self.trials
            if t.kind == kind and (finger is None or t.finger == finger) and (validate is None or t.validate == validate)
        )


def read_session(path: str | Path) -> Session:
    """Read and check `session.toml` in a folder (or the file itself); marker and log files are read later, by trial.

    Raises SessionError for anything that breaks `hand-session/1`.
    """
    import tomllib

    root = Path(path)
    root = root.parent if root.name == "session.toml" else root
    file = root / "session.toml"
    if not file.is_file():
        raise SessionError(f"{file}: no such file; a session is a folder with a session.toml")
    try:
        table = tomllib.loads(file.read_text())
    except tomllib.TOMLDecodeError as error:
        raise SessionError(f"{file}: {error}") from None
    if table.get("format") != FORMAT:
        raise SessionError(f'{file}: format is {table.get("format")!r}; this version reads "{FORMAT}"')
    palm = PalmMarkers(**table["palm"]["markers"]) if "palm" in table else None
    probe = None
    if "probe" in table:
        markers = table["probe"]["markers"]
        probe = Probe(tuple(markers), np.array(list(markers.values()), float))
    rig = Rig(root / table["rig"]["model"], dict(table.get("signals", {}))) if "rig" in table else None
    gravity = table.get("world", {}).get("gravity")
    return Session(
        path=root,
        hand=table["hand"]["name"],
        side=table["hand"].get("side", "right"),
        gravity_world=None if gravity is None else np.array(gravity, float),
        palm=palm,
        probe=probe,
        actuators=tuple(Actuator(a["name"], a.get("speed_full"), a.get("current_full")) for a in table.get("actuator", [])),
        fingers=tuple(
            Finger(f["name"], f.get("actuator"), tuple(Segment(s["name"], tuple(s["markers"])) for s in f["segments"]))
            for f in table.get("finger", [])
        ),
        trials=tuple(_trial(root, entry) for entry in table.get("trial", [])),
        rig=rig,
    )


def _trial(root: Path, entry: dict[str, Any]) -> Trial:
    mocap, log = entry.get("mocap"), entry.get("log")
    return Trial(
        kind=entry["kind"],
        name=log or mocap,
        finger=entry.get("finger"),
        mocap_path=root / mocap if mocap else None,
        log_path=root / log if log else None,
        landmark=entry.get("name"),
        joint=entry.get("joint"),
        side=entry.get("side"),
        segment=entry.get("segment"),
        object=entry.get("object"),
        stiffness=entry.get("stiffness"),
        validate=entry.get("purpose") == "validate",
        set=entry.get("set", {}),
    )
