"""Operators along the recorded path: turning points, distance since reversal, Dahl friction, play.

Every one runs over strokes (between turning points), in closed form inside a stroke: linear in the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def turning_points(position: Array, threshold: float) -> list[int]:
    """Sample indices at which the motion reverses by more than `threshold` [position unit], first and last included."""
    x = np.asarray(position, float)
    turns, extreme, direction = [0], 0, 0
    # Only local extremes can turn: the loop visits those, not every sample.
    step = np.sign(np.diff(x))
    visit = np.flatnonzero(step[1:] != step[:-1]) + 1
    for i in [*visit.tolist(), len(x) - 1]:
        if direction == 0:
            if abs(x[i] - x[0]) > threshold:
                direction = 1 if x[i] > x[0] else -1
                extreme = i
        elif (x[i] - x[extreme]) * direction > 0:
            extreme = i
        elif (x[extreme] - x[i]) * direction > threshold:
            turns.append(extreme)
            direction, extreme = -direction, i
    turns.append(len(x) - 1)
    return turns


def default_threshold(position: Array) -> float:
    """Reversals below this are noise: six standard deviations of the sample-to-sample jitter, at least 0.5 % of the
    span."""
    x = np.asarray(position, float)
    if len(x) < 5:
        return 0.0
    jitter = np.median(np.abs(np.diff(x, 2))) / 0.6745 / np.sqrt(6)
    return float(max(6 * jitter, 0.005 * (x.max() - x.min())))


def strokes(position: Array, threshold: float | None = None) -> list[tuple[int, int, int]]:
    """(start, stop, direction) of every stroke; samples start..stop-1, direction -1, 0 (no motion) or 1."""
    return list(_strokes(np.asarray(position, float).tobytes(), threshold))


@lru_cache(256)  # operators of many shapes run along the same few paths
def _strokes(position: bytes, threshold: float | None) -> tuple[tuple[int, int, int], ...]:
    x = np.frombuffer(position)
    if len(x) < 2:
        return ((0, len(x), 0),)
    t = default_threshold(x) if threshold is None else threshold
    turns = turning_points(x, t)
    out = []
    for a, b in pairwise(turns):
        moved = x[b] - x[a]
        out.append((a, b, int(np.sign(moved)) if abs(moved) > t else 0))
    out[-1] = (out[-1][0], len(x), out[-1][2])
    return tuple(s for s in out if s[1] > s[0])


def travelled(position: Array, threshold: float | None = None) -> Array:
    """Distance (n,) since the last reversal [position unit], never falling within a stroke."""
    return _ways(np.asarray(position, float).tobytes(), threshold)[0].copy()


def runs(flag: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of every run of True in a flag (n,)."""
    edges = np.flatnonzero(np.diff(np.r_[False, flag, False].astype(int))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def from_rest(position: Array, moving: NDArray[np.bool_]) -> Array:
    """Distance (n,) from where the drive rested last, zero at rest."""
    begin = np.maximum.accumulate(np.where(~moving, np.arange(len(position)), 0))
    return np.abs(position - position[begin])


def dahl(position: Array, length: float, start: float = 0.0, threshold: float | None = None) -> Array:
    """Dahl friction state (n,) in [-1, 1]: dz/ds = (1 - z sign(ds)) / length (Dahl 1968, exponent 1).

    length: [position unit] over which friction builds up after a reversal; start: state at the first sample.
    """
    reach = max(length, 1e-12)
    return _along_strokes(position, lambda z, d, path: d + (z - d) * np.exp(-path / reach), start, threshold)


def lugre(position: Array, length: float, level: Array, threshold: float | None = None) -> Array:
    """State (n,) of the bristles of a LuGre model (Canudas de Wit et al. 1995) that hold level (n,) while they slide:
    dz/ds = (level sign(ds) - z) / (length level); of level one, `dahl`."""
    way, direction, _, _ = _ways(np.asarray(position, float).tobytes(), threshold)
    moved = np.diff(way, prepend=0.0)  # less than zero from one stroke to the next
    decay = np.exp(-np.maximum(moved, 0.0) / (max(length, 1e-12) * level))
    return _recurrence(decay, (1.0 - decay) * direction * level)


def jenkins(position: Array, length: float, start: float = 0.0, threshold: float | None = None) -> Array:
    """Jenkins element state (n,) in [-1, 1]: an elastic element of reach `length` [position unit] that yields (stop
    operator)."""
    reach = max(length, 1e-12)
    return _along_strokes(
        position, lambda z, d, path: np.minimum(np.maximum(z + d * path / reach, -1.0), 1.0), start, threshold
    )


def _along_strokes(
    position: Array, law: Callable[[Any, Any, Any], Any], start: float, threshold: float | None
) -> Array:
    """A state (n,) that goes on from stroke to stroke and holds at rest; law: of the state at a stroke's begin, its
    direction and the way since then, of numbers or of arrays."""
    way, direction, stroke, lasts = _ways(np.asarray(position, float).tobytes(), threshold)
    begins, z = np.empty(len(lasts)), start
    for k, (end, d) in enumerate(lasts):
        begins[k] = z
        z = law(z, d, end) if d else z
    return np.where(direction != 0, law(begins[stroke], direction, way), begins[stroke])


@lru_cache(256)
def _ways(
    position: bytes, threshold: float | None
) -> tuple[Array, Array, NDArray[np.int64], tuple[tuple[float, int], ...]]:
    """Of every sample the way since its stroke began, the stroke's direction and number; of every stroke its way and
    direction."""
    x, every = np.frombuffer(position), _strokes(position, threshold)
    way, direction, stroke = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x), int)
    for k, (a, b, d) in enumerate(every):
        way[a:b] = np.maximum.accumulate(np.maximum((x[a:b] - x[a]) * d, 0.0)) if d else 0.0
        direction[a:b], stroke[a:b] = d, k
    return way, direction, stroke, tuple((float(way[b - 1]), d) for _, b, d in every)


def lowpass(time_s: Array, values: Array, time_constant_s: float) -> Array:
    """First-order low pass (n,) on irregular samples (exact for a held input), started at rest on the first value."""
    v = np.asarray(values, float)
    step = np.diff(time_s) / max(time_constant_s, 1e-9)
    return _recurrence(np.r_[0.0, np.exp(-step)], np.r_[v[:1], -np.expm1(-step) * 0.5 * (v[1:] + v[:-1])])


def _recurrence(decay: Array, brought: Array) -> Array:
    """state[i] = decay[i] state[i - 1] + brought[i] (n,), of which ever longer runs are joined (Hillis & Steele 1986)."""
    decay, state, run = decay.copy(), brought.copy(), 1
    while run < len(state) and decay.any():
        state[run:] += decay[run:] * state[:-run]
        decay[run:] = decay[run:] * decay[:-run]
        run *= 2
    return state
