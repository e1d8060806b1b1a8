"""The profile generator: trapezoidal velocity from the old to the new setpoint (equations in `drive`)."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .batch import Moves
from .grid import Grid

Array = NDArray[np.float64]


def profile(time_s: Array, moves: Moves, q: Mapping[str, Array]) -> tuple[Array, Array]:
    """Reference [%] and its velocity [%/s], (n, B), of trapezoidal moves at times (n,) [s]; the velocity `lag` [s]
    behind."""
    t = time_s[:, None] - moves.start_s
    sign, shape = np.sign(moves.target - moves.origin), Trapezoid(moves, q)
    return moves.origin + sign * shape.way(t), sign * shape.speed(t - q["lag"])


class Trapezoid:
    """Way [%] and speed [%/s] of moves over the time since their command."""

    def __init__(self, moves: Moves, q: Mapping[str, Array]) -> None:
        distance = np.abs(moves.target - moves.origin)
        self.up, self.down = (
            q["speed_full"] / np.maximum(q["rise"], 1e-4),
            q["speed_full"] / np.maximum(q["fall"], 1e-4),
        )
        top = np.minimum(
            q["speed_full"] * moves.speed, np.sqrt(2 * distance * self.up * self.down / (self.up + self.down))
        )
        self.top = np.maximum(top, 1e-9)
        self.rise, self.fall = self.top / self.up, self.top / self.down
        self.flat = np.maximum(distance / self.top - 0.5 * (self.rise + self.fall), 0.0)

    def some(self, columns: NDArray[np.int64]) -> Trapezoid:
        """Those of these columns."""
        found = copy.copy(self)
        for name, x in vars(self).items():
            setattr(found, name, x[columns])
        return found

    def way(self, t: Array) -> Array:
        """Way [%] at times (n, B) [s] after the command."""
        a = _within(t, self.rise)
        b = _within(t - self.rise, self.flat)
        c = _within(t - (self.rise + self.flat), self.fall)
        return 0.5 * self.up * a * a + self.top * b + (self.top - 0.5 * self.down * c) * c

    def speed(self, t: Array) -> Array:
        """Speed [%/s] at times (n, B) [s] after the command."""
        return self.up * _within(t, self.rise) - self.down * _within(t - (self.rise + self.flat), self.fall)


def _within(t: Array, duration: Array) -> Array:
    """Times (n, B) cut to 0..duration (B,)."""
    return np.minimum(np.maximum(t, 0.0), duration)


class Profile:
    """What a trapezoidal profile adds to the current: gain r + damping r', the mean over each step (at)."""

    def __init__(self, moves: Moves, q: Mapping[str, Array], times: Grid) -> None:
        t, sign = times.at_s - moves.start_s, np.sign(moves.target - moves.origin)
        shape = Trapezoid(moves, q)
        r = moves.origin + sign * shape.way(t)
        t -= q["lag"]
        way = shape.way(t)
        # the mean over a step is exact where the velocity jumps within it
        self.at = q["gain"] * r
        self.at[:-1] = 0.5 * (self.at[1:] + self.at[:-1]) + q["damping"] * sign * np.diff(way, axis=0) / times.each(
            times.steps()[:-1]
        )
        self.given, self.hold, self.stiffness = self.at - q["preload"], q["gain"] * r[0], q["gain"]

    def begin(self, p: Array, v: Array) -> Array:
        """Current (B,) [raw] before the move, at rest at positions (B,) [%]."""
        return self.hold - self.stiffness * p

    def pace(self, first: int, last: int, step_s: Array) -> None:
        """Nothing: the reference is known beforehand."""

    def push(self, i: int, p: Array, v: Array) -> Array:
        """Its part of the current (k,) [raw] in the middle of step i, less the preload and what `stiffness` takes."""
        return self.given[i, : len(p)]

    def advance(self, gone: Array) -> None:
        """Nothing: the profile does not see the drive."""

    def asked(self, position: Array) -> Array:
        """What the reference adds to the current at the steps, (n, B) [raw]."""
        return self.at
