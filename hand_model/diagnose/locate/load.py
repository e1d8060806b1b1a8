"""Load that a motor passes on, with as little noise as its current allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...effects.path import dahl, jenkins, runs
from .motion import Motion, least_error, smoothings

Array = NDArray[np.float64]

REACHES = np.geomspace(0.001, 0.05, 12)  # of the range, over which friction builds up after a reversal
FEWEST = 50  # samples in motion
LETS_GO = 1.6  # times what motion leaves unexplained of itself it leaves at rest, where a controller lets go
ORDER = 4  # of the load over the position
NEAR_S, LEAVES_S = 0.3, 0.1  # of a start or a stop; in which a controller that had let go takes hold
JITTER = 3.0  # times the median departure of a resting position: more is no noise


@dataclass(frozen=True)
class _Explained:
    """What motion explains of a current (n,) [raw], and inertia and drag over speed [raw, %, s]."""

    current: Array
    inertia: float
    viscous: float

    def passed_on(self, motion: Motion, departure: Array) -> PassedOn:
        """That, and what departs from it (n,), without what accelerates the motor."""
        load = self.current + departure - max(self.inertia, 0.0) * motion.acceleration
        return PassedOn(load, max(self.viscous, 0.0) * motion.velocity)


@dataclass(frozen=True)
class PassedOn:
    """Load (n,) [raw] that a motor passes on, and what of it grows with speed (n,)."""

    load: Array
    drag: Array


def transmitted_loads(time_s: Array, current: Array, motion: Motion) -> tuple[PassedOn, ...]:
    """What a motor passes on: its current without what accelerates it and without its noise.

    A current's noise would be an error of a regressor, and smoothing it rounds what happens at a reversal, which is
    what tells a give from a play. Speed, friction that builds up after reversals (Dahl's or Jenkins's, whichever the
    current prefers) and position explain nearly all of it; of the rest, what a smoothing with least error leaves: near
    starts and stops, in steady motion and at rest by a bandwidth of its own. Where motion explains much less at rest, the
    controller may have let go of the load there, which friction holds: then what motion explains is a second account.
    """
    span, moving = float(np.ptp(motion.position)), motion.moving
    if span == 0 or moving.sum() < FEWEST:
        return (PassedOn(least_error(time_s, current)[0], np.zeros(len(current))),)
    designs, near = _designs(motion), _near(time_s, moving, NEAR_S)
    everywhere = _explained(current, designs, np.ones(len(current), bool))
    flowing = everywhere.passed_on(motion, _departure(time_s, current - everywhere.current, moving, near))
    in_motion = _explained(current, designs, moving)
    rest = current - in_motion.current
    if not _lets_go(rest, moving, near):
        return (flowing,)
    departure = _departure(time_s, np.interp(time_s, time_s[moving], rest[moving]), moving, near)
    departure[_near(time_s, moving, LEAVES_S) | ~moving] = 0.0
    return flowing, in_motion.passed_on(motion, departure)


def with_likelier_load(states: Sequence[DriveState]) -> tuple[DriveState, ...]:
    """States of an angle with the account of the load, of which "load" and "drag" in `extra` are the first and "held_load"
    and "held_drag" the second, that a plain give explains it by better: whether friction holds the load at rest, or the
    current passes it on there too, the current does not say."""
    told = [s for s in states if "held_load" in s.extra]

    def left(name: str) -> float:
        rows = [(s, np.isfinite(s.effort)) for s in told if not s.validate]
        columns = np.concatenate([np.c_[s.declared, s.slope * s.extra[name]][m] for s, m in rows])
        effort = np.concatenate([s.effort[m] for s, m in rows])
        return float(np.sum((effort - columns @ np.linalg.lstsq(columns, effort, rcond=None)[0]) ** 2))

    held = any(not s.validate for s in told) and left("held_load") < left("load")
    return tuple(_by_account(s, held) for s in states)


def _by_account(state: DriveState, held: bool) -> DriveState:
    extra = {k: v for k, v in state.extra.items() if not k.startswith("held_")}
    if held and "held_load" in state.extra:
        extra |= {"load": state.extra["held_load"], "drag": state.extra["held_drag"]}
    return replace(state, extra=extra)


def _lets_go(rest: Array, moving: NDArray[np.bool_], near: NDArray[np.bool_]) -> bool:
    """Whether a current (n,) less what motion explains is larger at rest than in motion, starts and stops left out."""
    at_rest, in_motion = rest[~moving & ~near], rest[moving & ~near]
    if min(len(at_rest), len(in_motion)) < FEWEST:
        return False
    return bool(np.mean(at_rest**2) > LETS_GO**2 * np.mean(in_motion**2))


def _near(time_s: Array, moving: NDArray[np.bool_], within_s: float) -> NDArray[np.bool_]:
    """Samples (n,) near a start or a stop."""
    changes = time_s[1:][moving[1:] != moving[:-1]]
    there = np.searchsorted(changes, time_s)
    known = np.r_[-np.inf, changes, np.inf]
    return np.minimum(time_s - known[there], known[there + 1] - time_s) < within_s


def _departure(time_s: Array, rest: Array, moving: NDArray[np.bool_], near: NDArray[np.bool_]) -> Array:
    """What is no noise of what motion leaves unexplained of a current (n,)."""
    tried = [(error, smooth) for error, smooth, _ in smoothings(time_s, rest)]
    out = np.zeros(len(rest))
    for part in (near, moving & ~near, ~moving & ~near):
        if part.any():
            out[part] = min(tried, key=lambda x: float(np.mean(x[0][part])))[1][part]
    return out


def _path(motion: Motion) -> Array:
    """The position (n,) without its noise at rest: that goes back and forth, and would undo what friction has built
    up. How much of it there is most rests say, for a drive may creep in some while friction builds up."""
    out = motion.position.copy()
    rests = [(slice(*run), float(np.median(out[slice(*run)]))) for run in runs(~motion.moving)]
    noise = JITTER * float(np.median([np.median(np.abs(out[rest] - level)) for rest, level in rests] or [0.0]))
    for rest, level in rests:
        off = out[rest] - level
        out[rest] = level + np.sign(off) * np.maximum(np.abs(off) - noise, 0.0)
    return out


def _designs(motion: Motion) -> list[Array]:
    """What may explain a current, (n, k) each: one for every way in which friction builds up; inertia comes first, then
    drag."""
    position = motion.position
    span = float(np.ptp(position))
    moved = np.stack([motion.acceleration, motion.velocity, np.ones(len(position))], axis=-1)
    powers = ((position - position.min()) / span)[:, None] ** np.arange(1, ORDER + 1)
    path = _path(motion)
    return [np.c_[moved, rise(path, reach), powers] for rise in (dahl, jenkins) for reach in REACHES * span]


def _explained(current: Array, designs: Sequence[Array], use: NDArray[np.bool_]) -> _Explained:
    """What the best design explains of the current (n,), learned from some samples."""
    best, out = np.inf, _Explained(current, 0.0, 0.0)
    for columns in designs:
        fitted = np.linalg.lstsq(columns[use], current[use], rcond=1e-12)[0]
        error = float(np.sum((current - columns @ fitted)[use] ** 2))
        if error < best:
            best, out = error, _Explained(columns @ fitted, float(fitted[0]), float(fitted[1]))
    return out
