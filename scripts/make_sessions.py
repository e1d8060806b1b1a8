"""Remake the two small embedded sessions, `assets/sessions/left` and `right`: the same bytes every time.

    python scripts/make_sessions.py [FOLDER]

The truth of each goes beside them (`left.answer.json`), outside the session folders.
"""

from __future__ import annotations

import argparse
import shutil
from dataclasses import replace
from pathlib import Path

from hand_model.twin import HandTruth, Plan, bebionic, record

# Short enough for a repository, yet with replicate cycles at two speeds and a held-out trial of every kind.
LEFT = Plan(
    flexion=("full", "half", "low", "full", "half"), validation=("half", "full", "low"), excitations=3, still_s=0.5
)
RIGHT = Plan(flexion=("full", "half", "full", "half"), validation=("half", "full"), excitations=2, still_s=0.3)


def embedded() -> dict[str, tuple[HandTruth, int, Plan]]:
    """Name -> hand, seed and plan of the embedded sessions: a left hand of three fingers, a right hand of six."""
    left = bebionic("left", 11, ("thumb_1", "index", "middle"))
    right = bebionic("right", 12)
    return {
        "left": (replace(left, mocap=replace(left.mocap, rate_hz=100.0)), 11, LEFT),
        "right": (replace(right, mocap=replace(right.mocap, rate_hz=100.0)), 12, RIGHT),
    }


def make(folder: Path) -> None:
    """Write both sessions and their answers into `folder`, replacing what is there."""
    for name, (truth, seed, plan) in embedded().items():
        shutil.rmtree(folder / name, ignore_errors=True)
        answer = record(truth, folder / name, seed, plan=plan)
        answer.save(folder / f"{name}.answer.json")
        size = sum(file.stat().st_size for file in (folder / name).rglob("*") if file.is_file())
        print(f"{folder / name}: {len(answer.trials)} trials, {size / 1e6:.2f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "folder", type=Path, nargs="?", default=Path(__file__).resolve().parents[1] / "assets" / "sessions"
    )
    make(parser.parse_args().folder)
