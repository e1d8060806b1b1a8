"""What a weak effect of the fourth recorder brings to an observer who knows more than any program can.

    python scripts/weak_oracle.py FOLDER [FOLDER ...]

FOLDER: as `second_trial.py --recorder fourth` left it. The observer knows the motion without noise, from the recorder's
own simulation, and the law of the effect; the declared model is fitted beside it, the clock of every recording is free,
and starts, stops and rests of a motor, whose acceleration no log tells, do not count. Printed for each weak session: the
log likelihood [nats] that the effect brings, what the likeliest law of the other kind of lost motion leaves of it (give
for play and play for give), and what was named. In the end: right, by the smaller of the two. The diagnosis asks for nine
nats, and learns from six of ten recordings: what brings less than twenty here is not to be told from chance there.
"""

from __future__ import annotations

import argparse
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from fourth_recorder.compose import Case, draw_session, draw_sized, place_effects
from fourth_recorder.effects import EFFECTS
from fourth_recorder.gain.current import current_gain
from fourth_recorder.kinematics import joint_angles, play
from fourth_recorder.motor import ROW_S
from fourth_recorder.session import Session
from fourth_recorder.size import gain_of
from fourth_recorder.trial import Trial, run_finger

from hand_model.blind_trial import score_case

Array = np.ndarray
MOVING = 2.0  # [%/s]
GAPS = np.geomspace(5e-4, 0.05, 60)  # [rad] of the plays that are held against a give
BOUNDS = (8.0, 20.0, 40.0)  # [nats]
BENT = {"spring_decoupling": 0, "coupling_deadband": 1, "distal_stop": 1}  # no lost motion; the map may take it up
JOINTS = {"drive_backlash": 0, "series_elasticity": 0, "linkage_backlash": 1, "linkage_compliance": 1, **BENT}


def left_over(columns: Array, values: Array) -> float:
    """Sum of squares that least squares leaves."""
    return float(np.sum((values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]) ** 2))


def angle_nats(session: Session, trials: list[Trial], name: str, noise_rad: float) -> tuple[float, float]:
    """What the map alone, and the likeliest law of the other kind of lost motion, leave of a joint's angle [nats];
    noise_rad: of it."""
    flexions = [t for t in trials if t.planned.kind == "flexion"]
    joint = JOINTS[name]
    step = round(1 / session.laboratory.mocap_hz / ROW_S)
    angles, drivers, clocks, loads, groups = [], [], [], [], []
    for number, trial in enumerate(flexions):
        during = np.flatnonzero(trial.trace.time < trial.duration_s)[::step]
        both = joint_angles(trial.finger, trial.motor, trial.trace, trial.linkage)
        driver = trial.trace.position if joint == 0 else both[0]
        clock = np.zeros((len(during), len(flexions)))
        clock[:, number] = np.gradient(driver, ROW_S)[during]
        passed = trial.trace.load + 0.8 * trial.trace.friction + 0.6 * trial.motor.viscous * trial.trace.speed
        angles.append(both[joint][during])
        drivers.append(driver[during])
        loads.append(passed[during])
        clocks.append(clock)
        groups.append((driver, during))
    x, y = np.concatenate(drivers), np.concatenate(angles)
    own_clock = [np.concatenate(clocks)] if joint == 0 else []

    def mapped(driver: Array) -> Array:
        """The map's columns of what drives, and every recording's clock."""
        return np.c_[((driver - x.min()) / np.ptp(x))[:, None] ** np.arange(4), *own_clock]

    plain = mapped(x)
    if name in BENT:
        return 0.5 * left_over(plain, y) / noise_rad**2, np.inf
    scale = np.ptp(y) / np.ptp(x)  # of what follows, over what drives it
    if name.endswith("backlash"):
        rivals = [np.c_[plain, np.concatenate(loads)]]
    else:  # the map lies behind the play
        rivals = [mapped(np.concatenate([play(driver, gap / scale)[rows] for driver, rows in groups])) for gap in GAPS]
    return tuple(0.5 * left / noise_rad**2 for left in (left_over(plain, y), min(left_over(r, y) for r in rivals)))


def noise_of(found: dict[str, Any], finger: str, joint: int) -> float:
    """Noise of a joint's angle [rad] as the diagnosis found it."""
    signal = ("encoder", "markers")[joint]
    return float(
        np.radians(next(c["noise"] for c in found["channels"] if (c["finger"], c["signal"]) == (finger, signal)))
    )


def observed(answer: dict[str, Any], found: dict[str, Any]) -> tuple[float, float]:
    """What the effect of a weak session brings, and what its nearest rival leaves [nats]; infinite where there is none
    to fear."""
    name = answer["effects"][0]["effect"]
    seed = answer["settings"]["session"]["seed"]
    rng = np.random.default_rng(seed)
    session = draw_session(rng, "weak", seed)
    _, finger = place_effects(rng, Case("weak", (name,), seed), session)[0]
    drawn, _, _ = draw_sized(rng, "weak", session, name, finger)
    known = {k: v for k, v in answer["effects"][0]["figures"].items() if isinstance(v, float)}
    if any(abs(float(drawn.figures[k]) - v) > 1e-9 * max(abs(v), 1.0) for k, v in known.items()):
        raise SystemExit(f"{answer['effects'][0]}: another recorder made this session")
    trials = run_finger(session, finger, [drawn])
    if name in JOINTS:
        return angle_nats(session, trials, name, noise_of(found, finger.name, JOINTS[name]))
    if EFFECTS[name].channel == "current" or name == "drive_sag":
        gain, healthy = (current_gain(session, t, MOVING) for t in (trials, run_finger(session, finger, [])))
        return gain.above(healthy).log_likelihood, np.inf
    return gain_of(session, finger, name, drawn).log_likelihood, np.inf


def main() -> None:
    """Print a line per weak session and the sums."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", type=Path, nargs="+")
    rows = []
    for folder in parser.parse_args().folders:
        answers = json.loads((folder / "answers.json").read_text())
        for case, answer in answers.items():
            if answer["case"] != "weak":
                continue
            found = json.loads((folder / "findings" / case / "findings.json").read_text())
            nats = observed(answer, found)
            right = score_case(case, answer, found)["right"]
            rows.append((min(nats), right))
            named = ", ".join(f["effect"] for f in found["findings"]) or found["verdict"]
            rest = "" if np.isinf(nats[1]) else f", {nats[1]:.1f} beside its rival"
            print(f"{folder.name} {case} {answer['effects'][0]['effect']}: {nats[0]:.1f}{rest}; ", end="")
            print("right" if right else f"named {named}", flush=True)
    edges = (-np.inf, *BOUNDS, np.inf)
    for low, high in pairwise(edges):
        mine = [right for nats, right in rows if low <= nats < high]
        print(f"{low:g} to {high:g} nats: {sum(mine)} of {len(mine)} right")


if __name__ == "__main__":
    main()
