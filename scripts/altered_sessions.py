"""Sessions of a hand as another laboratory would have recorded them, diagnosed: findings should stay what they were.

    python scripts/altered_sessions.py FOLDER --output DIR

FOLDER holds session folders with one answer.json each; DIR must be new. Every session is turned in space with another
clock (TSV), recorded at half of both rates (TRC), and made noisy with unsteady stamps and lost rows (Motive CSV). What
is named and what was hidden is printed.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hand_model import diagnose
from hand_model.session import read_session
from hand_model.session.log import read_log
from hand_model.session.mocap import read_mocap
from hand_model.twin.files import write_log, write_markers

Array = NDArray[np.float64]

MARKER_NOISE_M, CURRENT_NOISE_RAW, STAMP_NOISE_S, KEPT_ROWS = 0.15e-3, 3.0, 0.5e-3, 0.97
CLOCK_S, FAR_M = 3000.0, 1.0
ENDINGS = {"turned": ".tsv", "slow": ".trc", "noisy": ".csv"}


def altered(source: Path, target: Path, kind: str, seed: int) -> None:
    """Write the session `source` as one of ENDINGS to the new folder `target`."""
    rng, turn = np.random.default_rng(seed), Rotation.random(random_state=seed)
    away = FAR_M * rng.standard_normal(3)
    step = 2 if kind == "slow" else 1
    for folder in ("mocap", "log"):
        (target / folder).mkdir(parents=True)
    for file in sorted((source / "mocap").iterdir()):
        mocap = read_mocap(file)
        position = mocap.position_world[::step]
        if kind == "turned":
            position = position @ turn.as_matrix().T + away
        if kind == "noisy":
            position = position + MARKER_NOISE_M * rng.standard_normal(position.shape)
        write_markers(
            target / "mocap" / f"{file.stem}{ENDINGS[kind]}",
            dict(zip(mocap.labels, position.transpose(1, 0, 2), strict=True)),
            mocap.rate_hz / step,
            "mm",
        )
    for file in sorted((source / "log").iterdir()):
        log = read_log(file)
        write_log(target / "log" / file.name, _altered_log({"time": log.time_s, **log.columns}, kind, rng))
    text = re.sub(r'(mocap/\w+)\.\w+"', rf'\1{ENDINGS[kind]}"', (source / "session.toml").read_text())
    gravity_world = read_session(source).gravity_world
    if kind == "turned" and gravity_world is not None:
        gravity = turn.apply(gravity_world)
        text = re.sub(r"gravity = \[.*\]", f"gravity = {gravity.tolist()}", text)
    (target / "session.toml").write_text(text)


def _altered_log(columns: dict[str, Array], kind: str, rng: np.random.Generator) -> dict[str, Array]:
    time_s, count = columns["time"], len(columns["time"])
    if kind == "turned":
        return {**columns, "time": time_s - CLOCK_S}
    if kind == "slow":
        return {name: values[::2] for name, values in columns.items()}
    kept = np.sort(rng.permutation(count)[: int(KEPT_ROWS * count)])
    current = np.round(columns["current"] + CURRENT_NOISE_RAW * rng.standard_normal(count))
    noisy = {**columns, "current": current, "time": time_s + STAMP_NOISE_S * rng.standard_normal(count)}
    return {name: values[kept] for name, values in noisy.items()}


def main() -> int:
    """Alter, diagnose, compare; the exit status is 1 where something else than what was hidden is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    right = count = 0
    for kind in ENDINGS:
        for source in sorted(p.parent for p in arguments.folder.glob("*/answer.json")):
            target = arguments.output / kind / source.name
            altered(source, target / "session", kind, count)
            hidden = [
                (e["effect"], e["finger"])
                for e in json.loads((source / "answer.json").read_text())["effects"]
                if e["effect"] != "none"
            ]
            findings = diagnose(target / "session", output=target / "findings").findings
            named = [(f.effect, f.where["finger"]) for f in findings]
            same = len(named) == len(hidden) and all(
                n == h or (n[0] == h[0] and n[1] is None) for n, h in zip(named, hidden, strict=True)
            )
            right, count = right + same, count + 1
            print(f"{kind} {source.name}: {named or 'consistent'}, hidden {hidden or 'nothing'}", flush=True)
    print(f"{right} of {count} right")
    return int(right < count)


if __name__ == "__main__":
    sys.exit(main())
