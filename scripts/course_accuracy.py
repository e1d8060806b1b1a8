"""Joints that are no plain hinges, from a twin's session to the compiled file: markers kept out before and after, and
the truth.

    python scripts/course_accuracy.py [--first-seed 11] [--forms 10]

Every form of `joint_wobble` and `moving_centre`, at full size and at 40 %, in turn at the proximal and at the distal
joint. Before, after and noise are those of the findings: recordings kept out, in MuJoCo, on the compiled files.
"truth": markers of the last segment, over the whole range, against the twin's own kinematics (root mean square, palm
markers laid on each other).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hand_model.description import read_description
from hand_model.diagnose import diagnose
from hand_model.engines import mujoco
from hand_model.rotation import kabsch
from hand_model.twin import Plan, bebionic, record
from hand_model.twin.influence import Hidden, activate
from hand_model.twin.kinematics import segment_markers
from hand_model.twin.schedule import schedule

FORMS = [
    ("joint_wobble", "wave"),
    ("joint_wobble", "bow"),
    ("moving_centre", "rolling"),
    ("moving_centre", "cam"),
    ("moving_centre", "ellipse"),
]
POSES = 80


def off_truth(folder: Path, truth: Any, hidden: Hidden, seed: int) -> float:
    """Root mean square distance [m] of the compiled last segment's markers from the twin's, over the range."""
    finger = truth.fingers[0]
    proximal = np.linspace(0, float(finger.proximal_rad.sum()), POSES)
    angle = np.stack([proximal, np.polynomial.polynomial.polyval(proximal, finger.distal_rad)], axis=1)
    trials = schedule(truth, Plan())
    true = segment_markers(
        finger, angle, [activate(hidden, truth, trials, seed).influence], trials[-1], np.zeros(POSES)
    )
    description = read_description(folder)
    names = [f"{finger.name}_{joint.name}" for joint in finger.joints]
    found = mujoco.positions(mujoco.load(description.mjcf), dict(zip(names, angle.T, strict=True)))
    palm = sorted(truth.palm_markers_palm)
    own = np.stack([description.hand.palm_markers_palm[label] for label in palm])
    rotation, shift = kabsch(own, np.stack([truth.palm_markers_palm[label] for label in palm]))
    errors = [found[f"marker_{label}"] @ rotation.T + shift - true[label] for label in finger.joints[-1].markers_palm]
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=-1))))


def row(effect: str, form: str, joint: int, strength: float, seed: int, root: Path) -> str:
    """One session, recorded and diagnosed."""
    truth, hidden = bebionic("left", seed, ["index"]), Hidden(effect, "index", strength, form, {"joint": joint})
    record(truth, root / "session", seed, (hidden,))
    findings = diagnose(root / "session", output=root / "out").findings
    named = ", ".join(f.effect for f in findings) or "nothing"
    fit = next(
        (f.fit for f in findings if f.effect == effect and f.where["joint"] == ("proximal", "distal")[joint]), None
    )
    told = f"| {effect} | {form} | {('proximal', 'distal')[joint]} | {strength:.0%} | {named} |"
    if fit is None:
        return f"{told} | | | | |"
    before, after, noise = (1e6 * fit[key] for key in ("before", "after", "noise_floor"))
    removed = f"{(before - after) / (before - noise):.0%}" if before > noise else "-"
    far = [1e3 * off_truth(root / "out" / name, truth, hidden, seed) for name in ("model_before", "model")]
    return f"{told} {before:.1f} | {after:.1f} | {noise:.1f} | {after / noise:.3f} | {removed} | {far[0]:.2f} | {far[1]:.2f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--first-seed", type=int, default=11)
    parser.add_argument("--forms", type=int, default=2 * len(FORMS), help="how many of the ten cases")
    options = parser.parse_args()
    print(
        "| hidden | form | joint | size | named | before, um | after | noise | after over noise | gone | truth before, mm | after |"
    )
    print("| --- |" + " --- |" * 11)
    for i in range(options.forms):
        effect, form = FORMS[i % len(FORMS)]
        with tempfile.TemporaryDirectory() as scratch:
            strength = 1.0 if i < len(FORMS) else 0.4
            print(
                row(effect, form, (i + i // len(FORMS)) % 2, strength, options.first_seed + i, Path(scratch)),
                flush=True,
            )


if __name__ == "__main__":
    main()
