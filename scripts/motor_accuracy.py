"""Accuracy of identified motors on twin drives with known truth: coverage of intervals, held-out replay, time; writes
JSON.

    python scripts/motor_accuracy.py --seeds 100 --output motor_accuracy.json
    python scripts/motor_accuracy.py --seeds 40 --stribeck --output motor_stribeck.json
    python scripts/motor_accuracy.py --hands 1 --output motor_hands.json

Coverage: share of seeds whose truth lies in the 95 % interval; each seed is another drive, controller, noise and
sampling. The regression that needs no controller is held against the truth too. Held-out current: over the noise of its
sensor, and over what the true drive itself leaves on the same samples (the noise as it fell there, rounding, and a load
that wanders, which nobody can foresee); the trials above 1.05 are listed with both, and with what the true drive leaves
over the noise. Time: processor time of a fit, and the same on a core as fast as this one at its best, by a fixed loop
timed before and after. --stribeck: friction that rises as speed falls, another rise for each seed. --hands N: every
finger of left and right hands, both thumb positions, nominal and N seeds, replayed in MuJoCo from the setpoints of
held-out trials, the motor as the compiler writes it.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path

import numpy as np

from hand_model.compile.motor import write_motors
from hand_model.hand import EncoderMap, Finger, Hand, Joint
from hand_model.identify.motor.balance import NAMES
from hand_model.identify.motor.cascade import cascade_step
from hand_model.identify.motor.fit import MotorFit, fit_motor
from hand_model.identify.motor.predict import aligned_moves, predict, reference
from hand_model.identify.motor.recording import MotorTrial, motor_trial, trial_scale
from hand_model.session import Log
from hand_model.twin import Plan, bebionic
from hand_model.twin.dirt import log_columns, sample_times, unrest_terms
from hand_model.twin.influence import merge_terms
from hand_model.twin.motor import DriveTerms, simulate
from hand_model.twin.schedule import schedule

FINGERS = ("thumb_0", "thumb_1", "index", "middle", "ring", "little")
STEP_S = 1e-3
PLAIN = DriveTerms()
YARD = np.linspace(0.0, 1.0, 120)
FRAME = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/><worldbody><body name="palm">
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><body name="finger"><inertial pos="0.02 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>
<joint name="f_proximal" type="hinge" axis="0 1 0"/></body></body></worldbody></mujoco>"""


def logs(
    truth, finger: str, seed: int, rise: DriveTerms = PLAIN
) -> tuple[list[tuple[str, Log]], list[tuple[str, Log]], list[np.ndarray]]:
    """Logs of a finger's training and validation trials, as the twin writes them into a session; the current [raw] of
    the true drive without its unrest at the samples of the latter."""
    motor = truth.motors[truth.finger(finger).actuator]
    found: tuple[list, list, list] = ([], [], [])
    for trial in schedule(truth, Plan()):
        if trial.program is None or trial.finger != finger:
            continue
        parts = [rise] + ([unrest_terms(motor, trial, seed)] if motor.unrest > 0 else [])
        motion = simulate(motor, trial.program, merge_terms(parts), trial.start_s)
        columns = log_columns(truth, motor, trial, motion, motion.position, motion.current, seed, 1.0)
        found[trial.validate].append(
            (trial.name, Log(np.round(columns.pop("time"), 5), columns, Path(f"{trial.name}.csv")))
        )
        if trial.validate:
            calm = simulate(motor, trial.program, rise, trial.start_s)
            found[2].append(np.interp(sample_times(truth.log, trial, seed), calm.time_s, calm.current))
    return found


def stribeck(motor, seed: int) -> tuple[DriveTerms, dict[str, float]]:
    """Friction that rises as speed falls, drawn from the seed, and its parameters: static over Coulomb friction, speed
    [%/s], exponent."""
    rng = np.random.default_rng(seed)
    ratio, speed, exponent = rng.uniform(1.4, 1.9), rng.uniform(10, 30), 1.0 if rng.uniform() < 0.5 else 2.0
    term = DriveTerms(
        friction=(lambda now: motor.coulomb * (ratio - 1) * math.exp(-(abs(now.velocity / speed) ** exponent)),)
    )
    return term, {"static_ratio": ratio, "stribeck_speed": speed, "stribeck_exponent": exponent}


def row(motor, fit: MotorFit, seconds: tuple[float, float], noise: float, planted: dict[str, float]) -> dict:
    """Truth, estimate and interval of every parameter; z of the regression; noise, misfit and time."""
    found = {n: fit.motor.parameters[n] for n in (*NAMES, *planted) if n in fit.motor.parameters}
    truth = {n: getattr(motor, n) for n in NAMES} | planted
    sd = np.sqrt(np.diag(fit.regression.covariance))
    return {
        "controller": motor.controller.kind,
        "method": fit.method,
        "cpu_s": seconds[0],
        "yard_s": seconds[1],
        "stribeck": bool(fit.stribeck),
        "noise_true": noise,
        "noise": fit.sigma_current,
        "misfit": None if fit.output_error is None else list(fit.output_error.chi2),
        "parameters": {n: [truth[n], e.value, *(e.ci95 or (None, None))] for n, e in found.items()},
        "regression_z": {
            n: float((v - getattr(motor, n)) / s) for n, v, s in zip(NAMES, fit.regression.values, sd, strict=True)
        },
    }


def yardstick() -> float:
    """Processor time [s] of a fixed loop of array operations: how fast the core is just now."""
    begin, x = time.process_time(), YARD
    for _ in range(10000):
        x = np.minimum(np.maximum(x * YARD + YARD, -1.0), 1.0)
    return time.process_time() - begin


def identified(
    truth, fingers: list[str], seed: int, rise: DriveTerms = PLAIN
) -> tuple[MotorFit, tuple[float, float], dict[str, list[tuple]]]:
    """The motor that drives `fingers`, the processor time [s] of its fit and of the yardstick, and held-out logs by
    finger: name, log, true current."""
    recorded = {f: logs(truth, f, seed, rise) for f in fingers}
    training = [x for f in fingers for x in recorded[f][0]]
    scale = trial_scale(training, truth.motors[truth.finger(fingers[0]).actuator].controller.speed_raw_full)
    trials = [motor_trial(n, log, scale) for n, log in training]
    before, begin = yardstick(), time.process_time()
    fit = fit_motor(trials, scale, truth.finger(fingers[0]).actuator)
    seconds = time.process_time() - begin
    return (
        fit,
        (seconds, 0.5 * (before + yardstick())),
        {f: [(*x, u) for x, u in zip(*recorded[f][1:], strict=True)] for f in fingers},
    )


def one_seed(seed: int, rises: bool) -> dict:
    """One drive of a seed: coverage and held-out prediction."""
    finger = FINGERS[2 + seed % 4]
    truth = bebionic("left" if seed % 2 else "right", seed, [finger])
    rise, planted = stribeck(truth.motors[finger], seed) if rises else (PLAIN, {})
    fit, seconds, held = identified(truth, [finger], seed, rise)
    result = row(truth.motors[finger], fit, seconds, truth.log.current_raw, planted) | {"seed": seed, "held_out": []}
    for name, log, true_current in held[finger]:
        predicted = predict(fit, log, name)
        position, current = predicted.rmse()
        usable = np.isfinite(log.columns["position"]) & np.isfinite(log.columns["current"])
        left = (log.columns["current"] - true_current)[usable][predicted.predicted]
        result["held_out"].append(
            {"position_rmse": position, "current_rmse": current, "true_drive_rmse": float(np.sqrt(np.mean(left**2)))}
        )
    return result


def hand_rows(side: str, seed: int | None) -> list[dict]:
    """Every finger of one hand, its held-out trials replayed in MuJoCo."""
    # the motors of a seed do not depend on the side: another seed for the other hand
    seed = None if seed is None else 2 * seed + ("left", "right").index(side)
    truth = bebionic(side, seed, list(FINGERS))
    out = []
    for actuator, motor in truth.motors.items():
        fingers = [f.name for f in truth.fingers if f.actuator == actuator]
        fit, seconds, held = identified(truth, fingers, ("left", "right").index(side) if seed is None else seed)
        for finger in fingers:
            replayed = (
                [mujoco_rmse(fit, motor_trial(n, log, fit.scale)) for n, log, _ in held[finger]]
                if fit.simulated
                else []
            )
            rows = [{"position_rmse": p, "current_rmse": c} for p, c in replayed]
            out.append(
                row(motor, fit, seconds, truth.log.current_raw, {})
                | {"side": side, "seed": seed, "finger": finger, "held_out": rows}
            )
            for p, c in replayed:
                print(
                    (
                        f"{side:6}{seed!s:6}{finger:9}{motor.controller.kind:9}{fit.method:13}{p:7.3f} "
                        f"%{c / truth.log.current_raw:7.3f} x noise"
                    ),
                    flush=True,
                )
    return out


def mujoco_rmse(fit: MotorFit, trial: MotorTrial) -> tuple[float, float]:
    """RMSE of position [%] and current [raw] of the compiled motor, driven by the setpoints of a trial in open loop."""
    import mujoco
    from lxml import etree

    joint = Joint("proximal", np.array([0, 1.0, 0]), np.zeros(3), np.zeros((6, 6)), (0.0, 1.35), {})
    encoder = EncoderMap(fit.scale.counts_open, fit.scale.counts_close, np.array([0.0, 1.2]), {}, {})
    root = etree.fromstring(FRAME)
    write_motors(
        root,
        Hand("twin", "left", {}, {}, (Finger("f", fit.motor.actuator, (joint,), (encoder,)),), 1e-4, {}, (fit.motor,)),
    )
    model = mujoco.MjModel.from_xml_string(etree.tostring(root).decode())
    data, q, lead = mujoco.MjData(model), fit.simulated, fit.simulated["damping"] / fit.simulated["gain"]
    name = fit.motor.actuator
    motor, own = data.joint(f"{name}_motor"), model.actuator(name).id
    grid = np.arange(0.0, trial.time_s[-1] + STEP_S, STEP_S)
    moves, starts = aligned_moves(fit, trial)
    motor.qpos[0] = starts[0][1]
    data.joint(f"{name}_drive").qpos[0] = 1.2 * starts[0][1] / 100
    cascade = fit.output_error.controller == "cascade"
    control = None if cascade else reference(fit, trial, grid)
    begins, targets, speeds = commands(trial, moves, starts)
    wanted, held = 0.0, motor.qpos[0] + starts[0][3] / q["gain"]
    position, current = np.empty(len(grid)), np.empty(len(grid))
    for i, t in enumerate(grid):
        if cascade:
            k = int(np.searchsorted(begins, t, side="right")) - 1
            target, speed = (targets[k], speeds[k]) if k >= 0 else (moves[0].origin, 1.0)
            held, wanted = cascade_step(q, target - motor.qpos[0], speed, held, wanted, motor.qvel[0], STEP_S)
            data.ctrl[own] = held + lead * wanted
        else:
            data.ctrl[own] = control[i]
        position[i] = motor.qpos[0]
        mujoco.mj_step(model, data)
        current[i] = data.actuator_force[own]
    k = (trial.time_s > trial.time_s[moves[0].index]) & (
        trial.time_s < trial.time_s[moves[-1].index] + moves[-1].time_s[-1]
    )
    error_p = np.interp(trial.time_s, grid, position) - trial.position
    error_u = np.interp(trial.time_s + q["lead"], grid, current) - trial.current
    return float(np.sqrt(np.mean(error_p[k] ** 2))), float(np.sqrt(np.mean(error_u[k] ** 2)))


def commands(trial: MotorTrial, moves, starts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants [s], setpoints [%] and speeds [share] of all commands; those that found the drive at rest as they were
    aligned."""
    change = np.flatnonzero(np.diff(trial.setpoint) != 0)
    own = {m.index: x for m, x in zip(moves, starts, strict=True)}
    begins = [
        trial.time_s[i] + (own[i][0] if i in own else 0.5 * (trial.time_s[i + 1] - trial.time_s[i])) for i in change
    ]
    speeds = [own[i][2] if i in own else (1.0 if trial.speed is None else trial.speed[i + 1]) for i in change]
    return np.array(begins), trial.setpoint[change + 1], np.array(speeds)


def replay_summary(rows: list[dict]) -> dict:
    """How near the identified drives come on held-out trials: to the noise, and to the true drive where it is known."""
    held = [h | {"noise": r["noise_true"], "seed": r["seed"]} for r in rows for h in r["held_out"]]
    ratio = np.array([h["current_rmse"] / h["noise"] for h in held])
    position = np.array([h["position_rmse"] for h in held])
    known = [h for h in held if "true_drive_rmse" in h]
    over = np.array([h["current_rmse"] / h["true_drive_rmse"] for h in known])
    floor = np.array([h["true_drive_rmse"] / h["noise"] for h in known])
    return {
        "position_rmse_percent": {"median": float(np.nanmedian(position)), "max": float(np.nanmax(position))},
        "current_rmse_over_noise": {
            "median": float(np.nanmedian(ratio)),
            "max": float(np.nanmax(ratio)),
            "within_1.05": float(np.mean(ratio < 1.05)),
            "within_1.15": float(np.mean(ratio < 1.15)),
        },
        "current_rmse_over_true_drive": {
            "median": float(np.median(over)),
            "max": float(over.max()),
            "within_1.05": float(np.mean(over < 1.05)),
            "trials": len(over),
        }
        if len(over)
        else None,
        "true_drive_rmse_over_noise": {
            "median": float(np.median(floor)),
            "max": float(floor.max()),
            "within_1.05": float(np.mean(floor < 1.05)),
        }
        if len(floor)
        else None,
        "above_1.05": [
            [
                h["seed"],
                *(
                    round(h[a] / h[b], 3)
                    for a, b in (
                        ("current_rmse", "noise"),
                        ("true_drive_rmse", "noise"),
                        ("current_rmse", "true_drive_rmse"),
                    )
                ),
            ]
            for h in known
            if h["current_rmse"] > 1.05 * min(h["noise"], h["true_drive_rmse"])
        ],
    }


def summary(rows: list[dict]) -> dict:
    """Coverage per parameter, replay and time, over all rows and per kind of controller."""
    out, best = {}, min(r["yard_s"] for r in rows)
    for kind in ("all", *sorted({r["controller"] for r in rows})):
        some = [r for r in rows if kind in ("all", r["controller"])]
        full = np.array([r["cpu_s"] * best / r["yard_s"] for r in some])
        names = sorted(
            {n for r in some for n in r["parameters"]}, key=[*NAMES, *(n for r in some for n in r["parameters"])].index
        )
        given = [r for r in some if r["parameters"]["inertia"][2] is not None]
        told = {n: [x for r in given if (x := r["parameters"].get(n)) and x[2] is not None] for n in names}
        inside = {n: [low <= true <= high for true, _, low, high in x] for n, x in told.items() if x}
        width = {n: [(high - low) / (3.92 * true) for true, _, low, high in x] for n, x in told.items() if x}
        out[kind] = {
            "motors": len(some),
            "with_intervals": len(given),
            "controller_identified": sum(r["method"] == "output error" for r in some),
            "coverage": {n: float(np.mean(x)) for n, x in inside.items()},
            "relative_sd_median": {n: float(np.median(w)) for n, w in width.items()},
            "coverage_regression": {n: float(np.mean([abs(r["regression_z"][n]) < 1.96 for r in some])) for n in NAMES},
            "stribeck_claimed": sum(r["stribeck"] for r in some),
            "cpu_s": {
                "median": float(np.median([r["cpu_s"] for r in some])),
                "max": float(max(r["cpu_s"] for r in some)),
                "below_2": float(np.mean([r["cpu_s"] < 2 for r in some])),
            },
            "cpu_s_at_full_speed": {
                "median": float(np.median(full)),
                "max": float(full.max()),
                "below_2": float(np.mean(full < 2)),
                "yardstick_s": best,
            },
            **replay_summary(some),
        }
    return out


def main() -> None:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument(
        "--stribeck", action="store_true", help="friction that rises as speed falls, planted in every drive"
    )
    parser.add_argument(
        "--hands", type=int, default=None, help="whole hands in MuJoCo instead: the nominal ones and so many seeds"
    )
    parser.add_argument("--output", default="motor_accuracy.json")
    args = parser.parse_args()
    seeds = range(args.first_seed, args.first_seed + (args.seeds if args.hands is None else args.hands))
    units = (
        [(one_seed, (s, args.stribeck)) for s in seeds]
        if args.hands is None
        else [(hand_rows, (side, s)) for s in (None, *seeds) for side in ("left", "right")]
    )
    rows: list[dict] = []
    for task, arguments in units:
        found = task(*arguments)
        rows += found if isinstance(found, list) else [found]
        Path(args.output).write_text(json.dumps({"summary": summary(rows), "motors": rows}, indent=1) + "\n")
    print(json.dumps(summary(rows), indent=1))


if __name__ == "__main__":
    main()
