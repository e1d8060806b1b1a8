"""Whether a drive's columns are measurements: what is a command, dead or unmoved is refused, not fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...effects.path import runs
from ...session import Log
from .answers import latencies

Array = NDArray[np.float64]

ECHO = 0.003  # of the range: a third of what a fast motion covers in one sample
UNMOVED = 0.95  # of a current's standard deviation: more than this left by the motion, and it measures nothing
FEWEST_RESTS, FINE = 10, 200  # rests that are looked at, and different readings of an encoder that is no coarse one
LONG_STROKE = 15  # samples, over which a current changes
PLACES, SPEEDS = 20, 8  # bins of position and of speed, each way
# of neighbours alike, at most, where a reading that stands still means anything; of such runs by chance; of the largest
# reading, from which it may have reached its end
OFTEN, BY_CHANCE, AT_END = 0.5, 1e-4, 0.9
ALONE, RUBS = 0.2, 0.1  # of a current's standard deviation: left by speed alone, and what friction it has at most
# readings that tell a dead zone, and in its units of their steps; zeros for every reading as large again, at least;
# standard deviations by which a current is beyond it
FEWEST_SIZES, STEPS, LACKING, CLEAR = 50, 5, 0.3, 3.0
ONE_WAY = 0.1  # of the readings of one way, fewer of which tell nothing of it
CLIPPED = 0.05  # of a current's range: what is nearer to its ends may be clipped
COMMANDED = 0.67  # of what state leaves of a current: less left by the way to the target, and it is asked for


def is_measured(states: tuple[DriveState, ...]) -> bool:
    """False where the current channel is dead or stays the same all along a stroke (the load of a spring or a polynomial
    of position does not, nor does noise), where the motion explains nothing of it (friction alone turns over with every
    reversal), where speed alone tells it and nothing rubs, where the way to the target tells it better than where and
    how fast the drive moves, or where it is so free of noise beside a motion that it does not explain that it can only
    be a command."""
    current = np.concatenate([s.effort[np.isfinite(s.effort)] for s in states])
    if len(current) < 50:
        return True
    spread = float(np.std(current))
    if len(np.unique(current)) <= 3 or spread == 0 or _level(states) or _asked_for(states):
        return False
    declared = np.concatenate([s.declared[np.isfinite(s.effort)] for s in states])
    beta = coefficients(declared, current)
    rest = current - declared @ beta
    if float(np.std(rest)) >= UNMOVED * spread or _of_speed(current, declared[:, 1:2], beta[2]):
        return False
    span = np.ptp(current)  # a clipped reading has no noise at its ends
    free = (current < np.max(current) - CLIPPED * span) & (current > np.min(current) + CLIPPED * span)
    free = free if np.sum(free) >= 50 else np.ones(len(current), bool)
    left = float(np.std(rest[free]))
    jitter = float(np.median(np.abs(np.diff(current, 2)[free[1:-1]]))) / 0.6745 / np.sqrt(6)
    return not (jitter < 0.03 * spread and left > 10 * max(jitter, 0.02 * spread))


def _of_speed(current: Array, speed: Array, rubs: float) -> bool:
    """Whether a current (n,) is in proportion to a speed (n, 1) and has next to none of a Coulomb friction `rubs` [raw]:
    no motor's is."""
    alone = current - speed @ coefficients(speed, current)
    return float(np.std(alone)) < ALONE * np.std(current) and abs(rubs) < RUBS * np.std(current)


def frozen(current: Array, moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples (n,) in motion at which a current stands still for longer than chance would have it: nobody read it then.
    Not where it is zero or as large as it gets: there a reading may have its ends."""
    same = np.r_[False, current[1:] == current[:-1]]
    often = float(np.mean(same[moving])) if moving.any() else 1.0
    largest = float(np.max(np.abs(current[np.isfinite(current)]), initial=0.0))
    free = moving & (current != 0) & (np.abs(current) < AT_END * largest)
    out = np.zeros(len(current), bool)
    if often <= OFTEN:
        for a, b in runs(same):
            if len(current) * often ** int(np.sum(free[a:b])) < BY_CHANCE:
                out[a - 1 : b] = True
    return out


def dead_zone(states: tuple[DriveState, ...]) -> float:
    """Size [raw] below which a current reads zero, zero where it reads what there is: no reading between, though many
    are a little larger and about as many are zero."""
    size = np.abs(np.concatenate([s.effort[np.isfinite(s.effort)] for s in states]))
    read = np.unique(size)
    if len(read) < FEWEST_SIZES or read[0] != 0:
        return 0.0
    step, least = float(np.min(np.diff(read[1:]))), float(read[1])
    larger, none = int(np.sum((size >= least) & (size < 2 * least))), int(np.sum(size == 0))
    return least if least > STEPS * step and larger > FEWEST_SIZES and none > LACKING * larger else 0.0


def beyond(states: tuple[DriveState, ...], zone: float) -> tuple[DriveState, ...]:
    """The states without the current where what the declared model expects is hardly outside a dead zone [raw]: to leave
    out what reads low would leave in what reads high by chance. None where next to nothing of one way is left: then
    friction is not told from a preload."""
    declared = np.concatenate([s.declared for s in states])
    effort = np.concatenate([s.effort for s in states])
    read = np.abs(effort) >= zone
    beta = coefficients(declared[read], effort[read])
    noise = 1.4826 * float(np.median(np.abs(effort[read] - declared[read] @ beta)))
    read &= np.abs(declared @ beta) >= zone + CLEAR * noise
    way = np.where(np.isfinite(effort), np.sign(np.concatenate([s.velocity for s in states])), 0)
    if min(float(np.mean(read[way == w])) if np.any(way == w) else 0.0 for w in (-1, 1)) < ONE_WAY:
        return ()
    parts = np.split(np.where(read, effort, np.nan), np.cumsum([len(s.effort) for s in states])[:-1])
    return tuple(replace(s, effort=part) for s, part in zip(states, parts, strict=True))


def _level(states: tuple[DriveState, ...]) -> bool:
    """Whether the current has, nearly all along, a single value in each stroke that is long enough to tell."""
    alike = []
    for state in states:
        way = np.where(np.isfinite(state.effort), np.sign(state.velocity), 0)
        for part in np.split(np.arange(len(way)), np.flatnonzero(np.diff(way)) + 1):
            if way[part[0]] and len(part) >= LONG_STROKE:
                alike.append(np.median(state.effort[part]) == state.effort[part])
    return len(alike) >= FEWEST_RESTS and float(np.mean(np.concatenate(alike))) > 0.9


def _asked_for(states: tuple[DriveState, ...]) -> bool:
    """Whether the current is a controller's output and not what the drive takes: the way to the target and the speed
    leave less of it than any law of position, direction, speed and acceleration does. Moves that pass one place for
    targets of different distance tell these apart."""
    if not all("setpoint" in s.extra for s in states):
        return False
    seen = [np.isfinite(s.effort) for s in states]

    def gathered(values: Callable[[DriveState], Array]) -> Array:
        return np.concatenate([values(s)[u] for s, u in zip(states, seen, strict=True)])

    current, declared = gathered(lambda s: s.effort), gathered(lambda s: s.declared)
    setpoint, position, velocity = (
        gathered(f) for f in (lambda s: s.extra["setpoint"], lambda s: s.position, lambda s: s.velocity)
    )
    # the setpoint's unit is the encoder's, the position's is not: their slopes are free
    told = np.column_stack([setpoint, position, velocity, np.ones(len(current))])
    way = velocity > 0
    state = np.column_stack([declared, _cells(position, PLACES, way), _cells(np.abs(velocity), SPEEDS, way)])
    by_target, by_state = (float(np.std(current - m @ coefficients(m, current))) for m in (told, state))
    return by_target < COMMANDED * by_state


def _cells(values: Array, count: int, way: NDArray[np.bool_]) -> Array:
    """One column for each of `count` bins of equal occupation and each way, (n, 2 count) at most."""
    label = 2 * np.searchsorted(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]), values) + way
    return (label[:, None] == np.unique(label)).astype(float)


def echoes_command(logs: Sequence[Log]) -> bool:
    """Whether the position column repeats the setpoint: just after each change of the setpoint it is already there,
    which no machine of finite speed is."""
    near = []
    for log in logs:
        if "setpoint" not in log.columns:
            return False
        position, setpoint = log.column("position"), log.column("setpoint")
        low, high = extremes([log], "setpoint")
        span = max(high - low, 1e-9)
        changed = np.r_[False, np.abs(np.diff(setpoint)) > 0]
        near.append(np.abs(position - setpoint)[changed & np.isfinite(position) & np.isfinite(setpoint)] / span)
    gaps = np.concatenate(near) if near else np.zeros(0)
    return len(gaps) >= 5 and float(np.mean(gaps < ECHO)) > 0.9


def rests_on_command(logs: Sequence[Log]) -> bool:
    """Whether the position column is a drive's reference: at the setpoint to the count wherever the next one finds it,
    as an encoder of so many counts reads only where an integrator is at work, and under way before the current is, as
    no drive with friction."""
    on, seen = [np.zeros(0)], [np.zeros(0)]
    for log in logs:
        if "setpoint" not in log.columns:
            return False
        position, setpoint = log.column("position"), log.column("setpoint")
        before = np.flatnonzero(np.diff(setpoint) != 0)
        on.append((position == setpoint)[before][np.isfinite(position[before])])
        seen.append(position[np.isfinite(position)])
    rests = np.concatenate(on)
    fine = len(rests) >= FEWEST_RESTS and len(np.unique(np.concatenate(seen))) >= FINE
    return fine and float(np.mean(rests)) > 0.9 and not _driven(logs)


def _driven(logs: Sequence[Log]) -> bool:
    """Whether the position begins to move after the current has answered a new setpoint."""
    moved, drove = list[float](), list[float]()
    for log in (log for log in logs if "current" in log.columns):
        setpoint, position, current = (log.column(name) for name in ("setpoint", "position", "current"))
        whole = np.isfinite(setpoint + position + current)
        moved += latencies(log.time_s[whole], setpoint[whole], position[whole])
        drove += latencies(log.time_s[whole], setpoint[whole], current[whole])
    return bool(moved) and bool(drove) and float(np.median(moved)) > float(np.median(drove))


def extremes(logs: list[Log], name: str) -> tuple[float, float]:
    """Least and largest value of a column over several logs, nan where it is empty in all."""
    values = np.concatenate([log.columns[name] for log in logs])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (np.nan, np.nan)


def coefficients(columns: Array, effort: Array) -> Array:
    """Of columns (n, k) of any size, by least squares on the effort (n,)."""
    scale = np.linalg.norm(columns, axis=0) + 1e-12
    return np.linalg.lstsq(columns / scale, effort, rcond=None)[0] / scale
