"""What is done in a session: which moves, in which trials, with which pauses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Move = tuple[float, int]  # target %, speed in raw units of 255
MINIMUM_JERK = 3


@dataclass
class Conduct:
    """How a laboratory goes about it."""

    control: int  # index of lab.CONTROLLERS
    speed_full: float  # %/s
    acceleration: float  # %/s^2
    restless: float  # standard deviation of the factor of friction from move to move
    turn: np.ndarray  # rotation vector, rad, of the palm in the second trials
    excitation_mocap: bool
    weak: bool  # a shorter protocol

    def move_time(self, distance: float, speed: float) -> float:
        """About how long (s) a move over a distance (%) takes at a speed (%/s)."""
        if self.control == MINIMUM_JERK:
            return 1.35 * distance / speed
        if self.control == 1:
            return distance / speed + 0.35
        return distance / speed + speed / self.acceleration + (0.1 if self.control == 0 else 0)


def draw_trials(rng: np.random.Generator, conduct: Conduct, fingers: list[str]) -> tuple[list[dict[str, Any]], float]:
    """The trials of a session in their order, and when it ends (s).

    A trial: kind, name, finger, purpose; moves: rows of time (s in the trial), target (%), speed (%/s); speed_raw: of
    255; duration, t0 (when it begins), gap (the pause after it), s; mocap; pose, pause: rotation vectors (rad) of the
    palm; restless: factors of friction by move."""
    clock = rng.uniform(120, 400)
    raw = [255, *(int(rng.integers(low, high)) for low, high in ((95, 140), (34, 52), (160, 205), (60, 85)))]
    jerk_limited = conduct.control == MINIMUM_JERK
    if jerk_limited:  # the slow ones take long with this profile
        raw[2], raw[4] = raw[2] + 25, raw[4] + 30
    half = float(rng.uniform(42, 58))
    dwell = rng.uniform(0.12, 0.8) if rng.random() < 0.7 else rng.uniform(0.05, 0.15)
    partial = rng.random() < 0.45 and not jerk_limited
    order = [0, 1, 2, 0, 1] if conduct.weak else [0, 1, 2, 3, 4, 0, 1, 2]
    order_b = [0, 1, 2] if conduct.weak else [0, 1, 2, 3, 4]
    if rng.random() < 0.4:
        order = [int(i) for i in rng.permutation(order)]
    extra = [(60, raw[1]), (25, raw[1]), (100, raw[0]), (45, raw[0]), (75, raw[3]), (0, raw[1])] if partial else []
    flexion, flexion_b = ([(x, raw[k]) for k in ks for x in (100, 0)] + extra for ks in (order, order_b))
    excitation = [(x, speed) for speed in (255, 128) for x in (100, 0, half, 100, half, 0)]
    trials = []
    for finger in fingers:
        n = 2 if conduct.weak else int(rng.integers(2, 4))
        todo = [("flexion", f"flexion_{finger}", flexion, None)]
        todo += [("flexion", f"flexion_{finger}_b", flexion_b, "validate")]
        for i in range(1, n + 1):
            todo += [("excitation", f"excitation_{finger}_{i}", excitation, "validate" if i == n else None)]
        for kind, name, moves, purpose in todo:
            timed, end = _timed(rng, conduct, moves, dwell)
            trial = {
                "kind": kind,
                "name": name,
                "finger": finger,
                "purpose": purpose,
                "moves": timed,
                "speed_raw": [speed for _, speed in moves],
                "duration": round(end + 0.4, 3),
                "mocap": kind == "flexion" or conduct.excitation_mocap,
                "t0": clock,
                "gap": rng.uniform(10, 35),
                "pose": conduct.turn if name.endswith(("_b", "_2")) else np.zeros(3),
                "pause": rng.normal(0, 0.01, 3),
                "restless": 1 + conduct.restless * rng.normal(size=len(moves)),
            }
            trials.append(trial)
            clock += end + trial["gap"]
    return trials, clock


def _timed(
    rng: np.random.Generator, conduct: Conduct, moves: list[Move], dwell: float
) -> tuple[list[tuple[float, float, float]], float]:
    """Moves with their times (s) and speeds (%/s), and when the last one has come to rest."""
    t, x, timed = rng.uniform(1.3, 1.6), 0.0, []
    for target, speed in moves:
        v = speed / 255 * conduct.speed_full
        timed.append((t, float(target), v))
        t += 1.1 * conduct.move_time(abs(target - x), v) + 0.08 + dwell + rng.uniform(0, 0.06)
        x = target
    return timed, t
