"""The time steps of simulated moves: short where a drive was seen to start and to stop, long where it cruised or
rested, where all is smooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONG_S = 1e-2  # the longest step [s]
GROUP = 8  # short steps by which a stretch grows, so that drives change their steps together
NEVER = 1e9  # [s]: the end of a stretch that has none


@dataclass(frozen=True)
class Grid:
    """Steps of B simulated drives, every `width` neighbours of which share theirs. step_s [s]: a short one. ends_s (3,
    B) [s]: of the stretch in short steps at the start, of the long steps after it, of the short ones at the stop; long
    ones follow. at (n, B / width): times of all steps, in short ones."""

    step_s: float
    ends_s: Array
    at: Array
    width: int = 1

    @property
    def at_s(self) -> Array:
        """Times (n, B) [s] of all steps."""
        return self.each(self.at * self.step_s)

    def each(self, x: Array) -> Array:
        """Values (..., B / width) for every drive, (..., B)."""
        return np.repeat(x, self.width, axis=-1)

    def index(self, t: Array, columns: NDArray[np.int64]) -> Array:
        """Row, with its fraction, of times t (..., C) [s] of these columns (..., C or 1)."""
        if self.ends_s[0].min() >= NEVER:
            return t / self.step_s
        return _index(t, self.ends_s[:, columns], self.step_s)

    def steps(self) -> Array:
        """Length (n, B / width) [s] of the step that begins in each row."""
        return np.diff(self.at, axis=0, append=self.at[-1:] + 1.0) * self.step_s


def _index(t: Array, ends_s: Array, step_s: float) -> Array:
    a, b, c = ends_s
    short = np.minimum(t, a) + np.minimum(np.maximum(t - b, 0.0), c - b)
    long = np.minimum(np.maximum(t - a, 0.0), b - a) + np.maximum(t - c, 0.0)
    return (short + long / _long(step_s)) / step_s


def _long(step_s: float) -> int:
    """Short steps in a long one: a power of two, as groups of them are."""
    return 1 << int(np.log2(max(LONG_S / step_s, 1.0)) + 1e-9)


def rows(calm_s: Array, duration_s: Array, step_s: float) -> tuple[Array, NDArray[np.int64]]:
    """Ends (3, B) [s] of the stretches, in whole steps, and the steps (B,) that moves of these durations (B,) [s] take.

    calm_s (3, B) [s]: begin and end of a cruise, begin of a rest; NEVER where there is none.
    """
    if _long(step_s) == 1:
        calm_s = np.full_like(calm_s, NEVER)
    group = GROUP * step_s
    a = np.ceil(np.minimum(calm_s[0], NEVER) / group) * group
    b = a + np.maximum(np.floor((np.minimum(calm_s[1], NEVER) - a) / group), 0.0) * group
    c = np.maximum(b, np.ceil(np.minimum(calm_s[2], NEVER) / group) * group)
    ends = np.where(calm_s[0] >= NEVER, NEVER, np.stack([a, b, c]))
    return ends, np.ceil(_index(duration_s, ends, step_s) - 1e-9).astype(int) + 2


def grid(ends_s: Array, n: int, step_s: float, width: int = 1) -> Grid:
    """The grid of n rows with these ends (3, B) [s] of its stretches, as `rows` found them; the same of every `width`
    neighbours."""
    i = np.arange(n)[:, None]
    distinct = ends_s[:, ::width]
    if ends_s[0].min() >= NEVER:
        return Grid(step_s, ends_s, np.broadcast_to(1.0 * i, (n, distinct.shape[1])), width)
    long, (a, b, c) = _long(step_s), distinct / step_s
    first, second, third = a, (b - a) / long, c - b  # rows of each stretch
    after = np.maximum(i - first, 0.0)
    at = np.minimum(i, first) + long * np.minimum(after, second)
    after = np.maximum(after - second, 0.0)
    at = at + np.minimum(after, third) + long * np.maximum(after - third, 0.0)
    return Grid(step_s, ends_s, np.round(at), width)
