"""Accuracy of the identified axes and centres on the twin, against the truth and against the Cramer-Rao bound.

    python scripts/accuracy.py --seeds 4 --output accuracy.json

Each seed is a whole hand of six fingers, recorded twice: with the laboratory's own noise and with that of the thesis's
right hand (0.4 mm per marker, ghosts, exchanged labels). "In the landmark frame" is what a user gets: it holds the
placement of the probe on three landmarks. "Within the palm" takes that out (true and found palm markers are laid on
each other), so that it can be held against the bound: the root mean square of error over the standard deviation that
the information matrix promises.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from hand_model.identify import identify_all
from hand_model.rotation import angle_between, kabsch
from hand_model.twin import Plan, bebionic, record

NOISY = {"noise_m": 4e-4, "ghosts_per_minute": 4.0, "ghost_label_share": 0.5, "swaps_per_minute": 1.0}


def errors(seed: int, noisy: bool, fingers: tuple[str, ...] | None) -> list[dict[str, float | str]]:
    """One row per joint of one recorded hand."""
    truth = bebionic("right" if seed % 2 else "left", seed, fingers)
    if noisy:
        truth = replace(truth, mocap=replace(truth.mocap, **NOISY))
    with tempfile.TemporaryDirectory() as folder:
        answer = record(truth, Path(folder) / "session", seed, plan=Plan(excitations=0))
        found = identify_all(Path(folder) / "session")
    labels = list(truth.palm_markers_palm)
    turn, move = kabsch([found.hand.palm_markers_palm[k] for k in labels], [truth.palm_markers_palm[k] for k in labels])
    rows = []
    for finger, fit in zip(found.hand.fingers, found.fingers, strict=True):
        table = answer.table["kinematics"][finger.name]
        for k, (joint, a, c) in enumerate(zip(finger.joints, table["axes"], table["centres"], strict=True)):
            axis, centre = np.array(a) / np.linalg.norm(a), np.array(c)
            promised = fit.joint_covariance(k)[:3, :3]
            off = fit.fit.chain.tangent[k] @ (found_axis_back(fit, k, turn @ joint.axis_palm, axis))
            spread = fit.fit.chain.tangent[k] @ promised @ fit.fit.chain.tangent[k].T
            rows.append(
                {
                    "joint": f"{finger.name} {joint.name}",
                    "axis_deg": float(np.rad2deg(angle_between(joint.axis_palm, axis))),
                    "centre_mm": 1e3 * across(joint.centre_palm - centre, axis),
                    "axis_within_palm_deg": float(np.rad2deg(angle_between(turn @ joint.axis_palm, axis))),
                    "centre_within_palm_mm": 1e3 * across(turn @ joint.centre_palm + move - centre, axis),
                    "squared_error_over_bound": float(off @ np.linalg.solve(spread, off) / 2),
                    "published_axis_off_deg": found.hand.extra["published_method"][finger.name][joint.name].get(
                        "axis_off_deg", np.nan
                    ),
                }
            )
    return rows


def found_axis_back(fit, joint: int, found_axis: np.ndarray, true_axis: np.ndarray) -> np.ndarray:
    """The axis error (3,), turned into the frame of the finger's own covariance (found axis onto fitted axis)."""
    from hand_model.rotation import rotation_from_vector

    fitted = fit.fit.chain.axis_palm[joint]
    normal = np.cross(found_axis, fitted)
    length = np.linalg.norm(normal)
    turn = rotation_from_vector(normal / max(length, 1e-300) * np.arctan2(length, found_axis @ fitted))
    return turn @ true_axis - fitted


def across(arm: np.ndarray, axis: np.ndarray) -> float:
    """Length of the part of `arm` (3,) that is perpendicular to the axis."""
    return float(np.linalg.norm(arm - axis * (arm @ axis)))


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--fingers", nargs="*")
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    result = {}
    for name, noisy in (("laboratory", False), ("right hand of the thesis", True)):
        rows = []
        for seed in range(options.first, options.first + options.seeds):
            rows += errors(seed, noisy, tuple(options.fingers) if options.fingers else None)
        column = {key: np.array([row[key] for row in rows]) for key in rows[0] if key != "joint"}
        result[name] = {
            "joints": len(rows),
            **{key: {"median": float(np.nanmedian(v)), "worst": float(np.nanmax(v))} for key, v in column.items()},
            "error_over_bound": float(np.sqrt(column["squared_error_over_bound"].mean())),
        }
        print(f"{name}: {len(rows)} joints")
        for key in ("axis_deg", "axis_within_palm_deg", "centre_mm", "centre_within_palm_mm", "published_axis_off_deg"):
            print(f"  {key:26} median {result[name][key]['median']:.3f}  worst {result[name][key]['worst']:.3f}")
        print(f"  error over Cramer-Rao bound (root mean square) {result[name]['error_over_bound']:.2f}", flush=True)
    if options.output:
        options.output.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
