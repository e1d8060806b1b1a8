"""Receiver operating characteristic of touch over simulated grasps of different stiffness, speed and noise; writes JSON.

    python scripts/roc_touch.py --hands 6 --output roc_touch.json
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
from pathlib import Path

import numpy as np

from hand_model import touch
from hand_model.identify.motor import identify_motor
from hand_model.identify.motor.recording import actuator_trials
from hand_model.session import read_session
from hand_model.twin import LogNoise, Plan, bebionic, record
from hand_model.twin.truth import Controller

AIR, STIFF, COMPLIANT = "air", "stiff", "compliant"


def hand(seed: int):
    """A twin hand with one finger: its motor, controller gains and log noise drawn from the seed."""
    rng = np.random.default_rng(seed)
    truth = bebionic("left" if seed % 2 else "right", seed, ["index"])
    ramp = seed % 4 != 3
    control = Controller("ramp", rng.uniform(16, 30), rng.uniform(0.45, 0.8), 12.0, rng.uniform(85, 140), 255.0)
    if not ramp:
        control = dataclasses.replace(control, kind="cascade", gain=rng.uniform(1.6, 3.0), integral=rng.uniform(9, 16))
    motors = {"index": dataclasses.replace(truth.motors["index"], controller=control)}
    noise = LogNoise(encoder_counts=rng.uniform(1, 6), current_raw=rng.uniform(3, 8), current_memory_s=float(rng.choice([0.0, 0.02])))
    return dataclasses.replace(truth, motors=motors, log=noise), rng


def one_hand(seed: int, repeats: int, free: int, measure: bool) -> list[dict]:
    """Scores and delays of all closing moves of one hand's grasps."""
    truth, rng = hand(seed)
    objects = (*((f"{AIR}{i}", 0.0) for i in range(free)), (STIFF, rng.uniform(20, 60)), (COMPLIANT, rng.uniform(0.7, 4.0)))
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        answer = record(truth, Path(scratch) / "session", seed, plan=Plan(grasps=objects, grasp_repeats=repeats))
        session = read_session(Path(scratch) / "session")
        fit = identify_motor(session, "index")
        free = [(t.name, t.log()) for t in actuator_trials(session, "index")]
        detector = touch.calibrate(fit, free)
        for trial in actuator_trials(session, "index", ("grasp",), None):
            stem, log = Path(trial.name).stem, trial.log()
            truth_time = answer.trials[stem].log_time_s
            contact_s = answer.table["grasps"][stem]["contact_s"]
            found = touch.detect(fit, detector, log, trial.name, measure=measure)
            closing = touch.residuals(fit, log, trial.name)
            scores = np.array([touch.cumulative_sum(z).max() for _, _, z in closing])
            alarm = min((float(np.interp(c.detected_s, log.time_s, truth_time)) for c in found), default=None)
            rows.append({
                "seed": seed, "object": AIR if trial.object.startswith(AIR) else trial.object, "stiffness": trial.stiffness, "scores": scores.tolist(),
                "delay_s": None if alarm is None or contact_s is None else alarm - contact_s,
                "alarms": len(found), "minutes": sum(float(m.time_s[-1] - touch.ALIGN_S) for m, _, _ in closing) / 60, "method": fit.method, "current_noise": fit.sigma_current,
                "fitted": [[c.stiffness.value, *c.stiffness.ci95, c.kind] for c in found if c.stiffness],
            })  # fmt: skip
    return rows


def area_under_curve(positive: np.ndarray, negative: np.ndarray) -> float:
    """Probability that a positive scores above a negative, ties counted half."""
    if not len(positive) or not len(negative):
        return float("nan")
    return float(np.mean((positive[:, None] > negative) + 0.5 * (positive[:, None] == negative)))


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hands", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument("--free", type=int, default=5, help="objects of air: free motion to count false alarms on, each REPEATS times")
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--stiffness", action="store_true", help="estimate the stiffness of every contact too")
    parser.add_argument("--output", default="roc_touch.json")
    args = parser.parse_args()
    rows = [row for seed in range(args.first_seed, args.first_seed + args.hands) for row in one_hand(seed, args.repeats, args.free, args.stiffness)]
    pool = {k: np.array([s for r in rows if r["object"] == k for s in r["scores"]]) for k in (AIR, STIFF, COMPLIANT)}
    summary = {"hands": args.hands, "without_controller": len({r["seed"] for r in rows if r["method"] != "output error"})}
    for kind in (STIFF, COMPLIANT):
        delay = np.array([r["delay_s"] for r in rows if r["object"] == kind and r["delay_s"] is not None])
        thresholds = np.unique(np.concatenate([pool[AIR], pool[kind]]))
        curve = [[float(np.mean(pool[AIR] >= h)), float(np.mean(pool[kind] >= h))] for h in thresholds[:: max(1, len(thresholds) // 100)]]
        summary[kind] = {
            "area_under_curve": area_under_curve(pool[kind], pool[AIR]), "grasps": len(pool[kind]),
            "missed": sum(r["delay_s"] is None for r in rows if r["object"] == kind),
            "delay_ms": {q: 1e3 * float(np.quantile(delay, p)) for q, p in (("median", 0.5), ("p90", 0.9), ("max", 1.0))} if len(delay) else None,
            "roc": curve,
        }  # fmt: skip
    air = [r for r in rows if r["object"] == AIR]
    summary["false_alarms_per_minute"] = sum(r["alarms"] for r in air) / max(sum(r["minutes"] for r in air), 1e-9)
    summary["free_minutes"] = sum(r["minutes"] for r in air)
    Path(args.output).write_text(json.dumps({"summary": summary, "grasps": rows}, indent=1) + "\n")
    print(json.dumps({k: {q: w for q, w in v.items() if q != "roc"} if isinstance(v, dict) else v for k, v in summary.items()}, indent=1))


if __name__ == "__main__":
    main()
