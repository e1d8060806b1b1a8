"""The servo pendulum against the published friction ladder of BAM (Duclusaud, Passault, Padois & Ly 2025), and its
speed.

    python scripts/benchmark_rig.py SESSION [--json FILE]

Fits M1 to M6 (Coulomb and viscous; Stribeck; load; Stribeck x load; directional; quadratic in load; each with the
bench's angle offset, without it too) to the training
recordings of a session with one voltage-driven joint, with the simulator and optimiser that the diagnosis uses, from
several starts, and diagnoses the same session. Every figure is MuJoCo's, in open loop over whole validation trials.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np

from hand_model.rig import diagnose_rig, load_rig, replay_rig
from hand_model.rig.declared import fit_declared
from hand_model.rig.swing.build import build_swing, windows_s
from hand_model.rig.swing.compete import fit_stages
from hand_model.rig.swing.fit import Task, fit_together, typical
from hand_model.rig.swing.patch import write_swing
from hand_model.rig.swing.simulation import INDEX, vector
from hand_model.rig.swing.variants import free_declared
from hand_model.session import read_session

STRIBECK = ("static_excess", "stribeck_speed", "stribeck_exponent")
BAM_FIT_S = 259.0  # what `bam.fit` took for its smallest model (M1) on this data: 5000 evaluations on two cores
OFFSET = ("lateral",)  # the bench's angle offset, free in every published model: a weight off its axis to first order
LADDER = {
    "M1 Coulomb, viscous": (),
    "M2 + Stribeck": STRIBECK,
    "M3 + load": ("load_gear",),
    "M4 + Stribeck x load": (*STRIBECK, "load_gear", "load_gear_low"),
    "M5 + directional": (*STRIBECK, "load_motor", "load_external", "load_motor_low", "load_external_low"),
    "M6 + quadratic": (
        *STRIBECK,
        "load_motor",
        "load_external",
        "load_motor_low",
        "load_external_low",
        "motor_squared",
        "external_squared",
    ),
}


def ladder(session_path: str, starts: int = 4) -> dict[str, dict[str, float]]:
    """Held-out errors [rad], fitting time [s] and processor time [s] of every rung; the best of several starts by
    training error."""
    session = read_session(session_path)
    rig = load_rig(session)
    declared = fit_declared(rig)
    stages = [build_swing(rig, declared, 4e-3, w) for w in windows_s(rig)]
    base, random, unit = free_declared(stages[0]), np.random.default_rng(0), typical(stages[0])
    out = {}
    rungs = {
        f"{n}{words}": (*more, *extra)
        for words, more in (("", ()), (", offset", OFFSET))
        for n, extra in LADDER.items()
    }
    for name, extra in rungs.items():
        began, used, tasks = time.perf_counter(), sum(os.times()[:4]), []  # own and children's
        for k in range(starts):
            theta = vector(stages[0].initial)
            for parameter in extra:
                if parameter == "stribeck_exponent":
                    continue
                size = 0.5 if parameter == "stribeck_speed" else 3.0 * k * unit[INDEX[parameter]]
                theta[INDEX[parameter]] = size * abs(random.normal())
            tasks.append(Task((*base, *extra), theta, ()))
        fits = fit_stages(stages, tasks, 25)
        best = min(fits, key=lambda f: f.cost)
        seconds, cpu_s = time.perf_counter() - began, sum(os.times()[:4]) - used
        file = write_swing(rig, stages[0], best.theta)
        residuals = replay_rig(session, load_rig(session, file), efforts=False, validate=True)
        evaluations = sum(f.evaluations for f in fits)
        out[name] = {
            "rmse_rad": residuals.figure("position_rmse", True),
            "mae_rad": residuals.figure("position_mae", True),
            "seconds": seconds,
            "cpu_s": cpu_s,
            "evaluations": evaluations,
            "ms_per_evaluation": 1e3 * cpu_s / evaluations,
        }
    return out


def per_evaluation(session_path: str) -> float:
    """Milliseconds of processor time that one evaluation of the whole training set takes when a population of 100 is
    simulated at once."""
    rig = load_rig(read_session(session_path))
    swing = build_swing(rig, fit_declared(rig), 4e-3)
    train = tuple(int(i) for i in swing.train())
    tasks = [Task(free_declared(swing), vector(swing.initial), train) for _ in range(20)]
    began = time.process_time()
    evaluations = sum(f.evaluations for f in fit_together(swing, tasks, 2))
    return 1e3 * (time.process_time() - began) / evaluations


def main() -> None:
    """Print the ladder, the diagnosis and the speed; write them as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("session")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rungs = ladder(arguments.session)
    began = time.perf_counter()
    lack = diagnose_rig(read_session(arguments.session)).lack_of_fit
    ours = {
        "declared_rmse_rad": lack["before"],
        "rmse_rad": lack["after"],
        "declared_mae_rad": lack["mae_before"],
        "mae_rad": lack["mae_after"],
        "seconds": time.perf_counter() - began,
    }
    for name, row in rungs.items():
        print(
            f"{name:32s} rmse {row['rmse_rad']:.4f} mae {row['mae_rad']:.4f} rad, fitted in {row['seconds']:.1f} s, "
            f"of a processor {row['cpu_s']:.1f} s ({row['ms_per_evaluation']:.2f} ms per evaluation)"
        )
    smallest = next(iter(rungs.values()))
    print(
        f"{'M1 against bam.fit':32s} {BAM_FIT_S / smallest['cpu_s']:.0f} times faster ({BAM_FIT_S:g} "
        "s on two cores there)"
    )
    print(
        f"{'diagnosed':32s} rmse {ours['rmse_rad']:.4f} mae {ours['mae_rad']:.4f} rad; "
        f"declared {ours['declared_rmse_rad']:.4f} {ours['declared_mae_rad']:.4f}; {ours['seconds']:.1f} s"
    )
    if arguments.json:
        arguments.json.write_text(
            json.dumps(
                {"ladder": rungs, "diagnosed": ours, "ms_per_evaluation": per_evaluation(arguments.session)}, indent=2
            )
            + "\n"
        )


if __name__ == "__main__":
    main()
