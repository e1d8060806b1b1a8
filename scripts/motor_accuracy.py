"""Accuracy of identified motors on twin hands with known truth: coverage of intervals, held-out replay, time; writes JSON.

    python scripts/motor_accuracy.py --seeds 100 --output motor_accuracy.json
    python scripts/motor_accuracy.py --hands --output motor_hands.json      every finger of both hands, both thumb positions

Coverage: share of seeds whose truth lies in the 95 % interval; each seed is another drive, controller, noise and sampling.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from hand_model.identify.motor import identify_motor
from hand_model.identify.motor.balance import NAMES
from hand_model.identify.motor.predict import predict
from hand_model.identify.motor.recording import actuator_trials
from hand_model.session import read_session
from hand_model.twin import Plan, bebionic, record

FINGERS = ("thumb_0", "thumb_1", "index", "middle", "ring", "little")
PLAN = Plan(joint_sides=("medial",), still_s=0.3)


def held_out(fit, session, finger: str) -> list[dict]:
    """Position RMSE [%] and current RMSE [raw, over its noise] of the finger's validation trials, replayed from setpoints."""
    rows = []
    for trial in actuator_trials(session, fit.motor.actuator, validate=True):
        if trial.finger == finger:
            prediction = predict(fit, trial.log(), trial.name)
            position, current = prediction.rmse()
            phases = {p: prediction.rmse(p) for p in ("onset", "cruise", "stop", "rest")}
            rows.append({"trial": trial.name, "position_rmse": position, "current_rmse": current, "phases": phases})
    return rows


def one(side: str, seed: int | None, fingers: list[str]) -> list[dict]:
    """Rows of the actuators of a twin hand that drive `fingers`."""
    truth = bebionic(side, seed, fingers)
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        record(truth, Path(scratch) / "session", ("left", "right").index(side) if seed is None else seed, plan=PLAN)
        session = read_session(Path(scratch) / "session")
        for actuator, motor in truth.motors.items():
            begin = time.process_time()
            fit = identify_motor(session, actuator)
            seconds = time.process_time() - begin
            found = {n: fit.motor.parameters[n] for n in NAMES}
            rows += [
                {
                    "side": side, "seed": seed, "finger": f.name, "controller": motor.controller.kind, "method": fit.method,
                    "cpu_s": seconds, "stribeck": fit.stribeck, "noise_true": truth.log.current_raw, "noise": fit.sigma_current,
                    "misfit": None if fit.output_error is None else list(fit.output_error.chi2),
                    "parameters": {n: [getattr(motor, n), e.value, *e.ci95] for n, e in found.items()},
                    "held_out": held_out(fit, session, f.name),
                }
                for f in truth.fingers if f.actuator == actuator
            ]  # fmt: skip
    return rows


def summary(rows: list[dict]) -> dict:
    """Coverage per parameter, replay and time, over all rows and per kind of controller."""
    out = {}
    for kind in ("all", *sorted({r["controller"] for r in rows})):
        some = [r for r in rows if kind in ("all", r["controller"])]
        held = [h | {"noise": r["noise_true"]} for r in some for h in r["held_out"]]
        position = np.array([h["position_rmse"] for h in held])
        ratio = np.array([h["current_rmse"] / h["noise"] for h in held])
        width = {n: [(r["parameters"][n][3] - r["parameters"][n][2]) / (3.92 * r["parameters"][n][0]) for r in some] for n in NAMES}
        out[kind] = {
            "motors": len(some),
            "controller_identified": sum(r["method"] == "output error" for r in some),
            "coverage": {n: float(np.mean([r["parameters"][n][2] <= r["parameters"][n][0] <= r["parameters"][n][3] for r in some])) for n in NAMES},
            "relative_sd_median": {n: float(np.median(w)) for n, w in width.items()},
            "stribeck_claimed": sum(r["stribeck"] for r in some),
            "cpu_s": {"median": float(np.median([r["cpu_s"] for r in some])), "max": float(max(r["cpu_s"] for r in some))},
            "position_rmse_percent": {"median": float(np.nanmedian(position)), "max": float(np.nanmax(position))},
            "current_rmse_over_noise": {"median": float(np.nanmedian(ratio)), "max": float(np.nanmax(ratio)), "within_1.15": float(np.mean(ratio < 1.15))},
        }  # fmt: skip
    return out


def main() -> None:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--hands", action="store_true", help="every finger of both nominal hands instead of seeds")
    parser.add_argument("--output", default="motor_accuracy.json")
    args = parser.parse_args()
    if args.hands:
        rows = [row for side in ("left", "right") for row in one(side, None, list(FINGERS))]
        for r in rows:
            for h in r["held_out"]:
                print(f"{r['side']:6}{r['finger']:9}{Path(h['trial']).stem:24}{h['position_rmse']:7.3f} %{h['current_rmse'] / r['noise_true']:7.3f} x noise")
    else:
        seeds = range(args.first_seed, args.first_seed + args.seeds)
        rows = [row for s in seeds for row in one("left" if s % 2 else "right", s, [FINGERS[2 + s % 4]])]
    result = {"summary": summary(rows), "motors": rows}
    Path(args.output).write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result["summary"], indent=1))


if __name__ == "__main__":
    main()
