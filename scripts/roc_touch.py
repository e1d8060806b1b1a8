"""Receiver operating characteristic of touch over simulated grasps of different stiffness, speed and noise; writes
JSON.

Beside every delay stands that of an ideal detector of the same current, noise as it fell, with as many false alarms:
the likelihood ratio, scanned over the onset (Page 1954), of someone who knows the true drive, its load, the object, the
speed and the noise. What it does not see in time is not there.

    python scripts/roc_touch.py --hands 6 --output roc_touch.json
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hand_model import touch
from hand_model.identify.motor import fit_motor
from hand_model.identify.motor.recording import motor_trial, trial_scale
from hand_model.session import Log
from hand_model.twin import LogNoise, Plan, bebionic
from hand_model.twin.dirt import log_columns, sample_times, unrest_terms
from hand_model.twin.influence import merge_terms
from hand_model.twin.motor import simulate
from hand_model.twin.record import contact_percent, grasp_terms
from hand_model.twin.schedule import TrialPlan, schedule
from hand_model.twin.truth import Controller

AIR, STIFF, COMPLIANT = "air", "stiff", "compliant"
LOOK_S, NOISE_MINUTES = 0.5, 100.0  # of an ideal detector
WANTED_S = 0.06  # within which a stiff object is to be detected


def hand(seed: int):
    """A twin hand with one finger: its motor, controller gains and log noise drawn from the seed."""
    rng = np.random.default_rng(seed)
    truth = bebionic("left" if seed % 2 else "right", seed, ["index"])
    control, give = (
        Controller("ramp", rng.uniform(16, 30), rng.uniform(0.45, 0.8), 12.0, rng.uniform(85, 140), 255.0),
        0.0,
    )
    if seed % 4 == 3:
        control = dataclasses.replace(control, kind="cascade", gain=rng.uniform(1.6, 3.0), integral=rng.uniform(9, 16))
    elif seed % 4 == 2:
        control, give = (
            dataclasses.replace(
                control, kind="profile", damping=rng.uniform(1.5, 3.5), acceleration=rng.uniform(700, 1200)
            ),
            rng.uniform(0.4, 0.8),
        )
    motors = {"index": dataclasses.replace(truth.motors["index"], controller=control, give=give)}
    noise = LogNoise(
        encoder_counts=rng.uniform(1, 6), current_raw=rng.uniform(3, 8), current_memory_s=float(rng.choice([0.0, 0.02]))
    )
    return dataclasses.replace(truth, motors=motors, log=noise), rng


def recorded(
    truth, plan: Plan, seed: int
) -> Iterator[tuple[TrialPlan, Log, float | None, tuple[np.ndarray, ...] | None]]:
    """Motion trials of a plan as the twin logs them, when the object of a grasp was met on the log's clock [s], and
    what `ideal_delay` knows."""
    motor = truth.motors["index"]
    for trial in schedule(truth, plan):
        if trial.program is None:
            continue
        met = contact_percent(trial, seed)
        parts = [unrest_terms(motor, trial, seed)] if motor.unrest > 0 else []
        motion = simulate(
            motor, trial.program, merge_terms(parts + ([] if met is None else [grasp_terms(trial, met)])), trial.start_s
        )
        columns = log_columns(truth, motor, trial, motion, motion.position, motion.current, seed, 1.0)
        touched = np.flatnonzero(motion.position > met) if met is not None and trial.stiffness else []
        clock = truth.log.clock_offset_s + truth.log.clock_rate * trial.start_s
        log, known = Log(np.round(columns.pop("time"), 5), columns, Path(f"{trial.name}.csv")), None
        if len(touched):
            contact_s = float(motion.time_s[touched[0]])
            free = simulate(motor, trial.program, merge_terms(parts), trial.start_s)
            known = _seen(truth.log, sample_times(truth.log, trial, seed), contact_s, columns["current"], motion, free)
        yield trial, log, clock + truth.log.clock_rate * contact_s if len(touched) else None, known


def _seen(
    noise: LogNoise, time_s: np.ndarray, contact_s: float, current: np.ndarray, motion, free
) -> tuple[np.ndarray, ...]:
    """Time since contact [s], what the object adds to the current and what was measured beyond the free drive's, (k,)
    [noise deviations], white, of the first LOOK_S."""
    k = np.flatnonzero((time_s > contact_s) & (time_s < contact_s + LOOK_S) & np.isfinite(current))
    time_s, deviation = time_s[k], np.hypot(noise.current_raw, 1 / np.sqrt(12))
    without = np.interp(time_s, free.time_s, free.current)
    both = np.stack([np.interp(time_s, motion.time_s, motion.current) - without, current[k] - without]) / deviation
    if noise.current_memory_s > 0:
        keep = np.exp(-np.diff(time_s) / noise.current_memory_s)
        both[:, 1:] = (both[:, 1:] - keep * both[:, :-1]) / np.sqrt(1 - keep**2)
    return time_s - contact_s, *both


def ideal_delay(
    since_s: np.ndarray, added: np.ndarray, measured: np.ndarray, per_minute: float, interval_s: float
) -> float | None:
    """Delay [s] of the ideal detector, its threshold set on NOISE_MINUTES of white noise; None if it sees nothing
    within LOOK_S."""
    n = int(60 * NOISE_MINUTES / interval_s)
    noise, total, largest = np.random.default_rng(0).normal(size=n), np.zeros(n), np.full(n, -np.inf)
    for i, x in enumerate(added):  # total: of a contact that began i samples ago
        total = total[: n - i] + noise[i:] * x - 0.5 * x * x
        np.maximum(largest[i:], total, out=largest[i:])
    move = round(1.0 / interval_s)  # one alarm at most in a move, as with ours
    peaks = np.sort(largest[: n // move * move].reshape(-1, move).max(axis=1))
    over = np.flatnonzero(np.cumsum(added * measured - 0.5 * added**2) > peaks[-round(per_minute * NOISE_MINUTES)])
    return float(since_s[over[0]]) if len(over) else None


def one_hand(seed: int, repeats: int, free: int, measure: bool, asked: float) -> list[dict]:
    """Scores and delays of all closing moves of one hand's grasps."""
    truth, rng = hand(seed)
    objects = (
        *((f"{AIR}{i}", 0.0) for i in range(free)),
        (STIFF, rng.uniform(20, 60)),
        (COMPLIANT, rng.uniform(0.7, 4.0)),
    )
    training = [(t.name, log) for t, log, *_ in recorded(truth, Plan(), seed)]
    own = [
        x
        for x, t in zip(training, (t for t in schedule(truth, Plan()) if t.program is not None), strict=True)
        if not t.validate
    ]
    scale = trial_scale(own, truth.motors["index"].controller.speed_raw_full)
    fit = fit_motor([motor_trial(n, log, scale) for n, log in own], scale)
    detector = touch.calibrate(fit, training, asked)
    rows = []
    for trial, log, contact_s, known in recorded(
        truth, Plan(flexion=(), validation=(), excitations=0, grasps=objects, grasp_repeats=repeats), seed
    ):
        found = touch.detect(fit, detector, log, trial.name, measure=measure)
        closing = touch.residuals(fit, log, trial.name)
        rows.append(
            {
                "seed": seed,
                "object": AIR if trial.object.startswith(AIR) else trial.object,
                "stiffness": trial.stiffness,
                "scores": [float(touch.cumulative_sum(z).max()) for _, _, z in closing],
                "threshold": detector.threshold,
                "delay_s": found[0].detected_s - contact_s if found and contact_s is not None else None,
                "ideal_delay_s": None if known is None else ideal_delay(*known, asked, truth.log.interval_s),
                "alarms": len(found),
                "minutes": sum(float(m.time_s[-1] - touch.ALIGN_S) for m, _, _ in closing) / 60,
                "method": fit.method,
                "current_noise": fit.sigma_current,
                "fitted": [[c.stiffness.value, *c.stiffness.ci95, c.kind] for c in found if c.stiffness],
            }
        )
    return rows


def area_under_curve(positive: np.ndarray, negative: np.ndarray) -> float:
    """Probability that a positive scores above a negative, ties counted half."""
    if not len(positive) or not len(negative):
        return float("nan")
    return float(np.mean((positive[:, None] > negative) + 0.5 * (positive[:, None] == negative)))


def grasp_summary(rows: list[dict], kind: str, pool: dict[str, np.ndarray]) -> dict:
    """How well and how late grasps of one kind of object are told; pool: scores by kind."""
    delay, ideal = (
        np.array([r[name] for r in rows if r["object"] == kind and r[name] is not None])
        for name in ("delay_s", "ideal_delay_s")
    )
    thresholds = np.unique(np.concatenate([pool[AIR], pool[kind]]))
    curve = [
        [float(np.mean(pool[AIR] >= h)), float(np.mean(pool[kind] >= h))]
        for h in thresholds[:: max(1, len(thresholds) // 100)]
    ]
    return {
        "area_under_curve": area_under_curve(pool[kind], pool[AIR]),
        "grasps": len(pool[kind]),
        "missed": sum(r["delay_s"] is None for r in rows if r["object"] == kind),
        "delay_ms": {q: 1e3 * float(np.quantile(delay, p)) for q, p in (("median", 0.5), ("p90", 0.9), ("max", 1.0))}
        if len(delay)
        else None,
        "ideal_delay_ms": {
            q: 1e3 * float(np.quantile(ideal, p)) for q, p in (("median", 0.5), ("p90", 0.9), ("max", 1.0))
        }
        if len(ideal)
        else None,
        "later_than_60_ms": [
            [r["seed"], r["stiffness"], r["delay_s"], r["ideal_delay_s"]]
            for r in rows
            if r["object"] == kind == STIFF and (r["delay_s"] or 9) > WANTED_S
        ],
        "roc": curve,
    }


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hands", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument(
        "--free", type=int, default=5, help="objects of air: free motion to count false alarms on, each REPEATS times"
    )
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--stiffness", action="store_true", help="estimate the stiffness of every contact too")
    parser.add_argument("--rate", type=float, default=0.1, help="false alarms asked for [1/min]")
    parser.add_argument("--output", default="roc_touch.json")
    args = parser.parse_args()
    rows: list[dict] = []
    for seed in range(args.first_seed, args.first_seed + args.hands):
        rows += one_hand(seed, args.repeats, args.free, args.stiffness, args.rate)
        air = [r for r in rows if r["object"] == AIR and r["seed"] == seed]
        print(
            f"hand {seed}: {sum(r['alarms'] for r in air)} alarms in {sum(r['minutes'] for r in air):.1f} min, "
            f"threshold {rows[-1]['threshold']:.1f}, largest {max(s for r in air for s in r['scores']):.1f}",
            flush=True,
        )
    pool = {k: np.array([s for r in rows if r["object"] == k for s in r["scores"]]) for k in (AIR, STIFF, COMPLIANT)}
    summary = {
        "hands": args.hands,
        "without_controller": len({r["seed"] for r in rows if r["method"] != "output error"}),
    }
    for kind in (STIFF, COMPLIANT):
        summary[kind] = grasp_summary(rows, kind, pool)
    air = [r for r in rows if r["object"] == AIR]
    summary["false_alarms_per_minute"] = sum(r["alarms"] for r in air) / max(sum(r["minutes"] for r in air), 1e-9)
    summary["free_minutes"] = sum(r["minutes"] for r in air)
    summary["false_alarms"] = sum(r["alarms"] for r in air)
    Path(args.output).write_text(json.dumps({"summary": summary, "grasps": rows}, indent=1) + "\n")
    print(
        json.dumps(
            {k: {q: w for q, w in v.items() if q != "roc"} if isinstance(v, dict) else v for k, v in summary.items()},
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
