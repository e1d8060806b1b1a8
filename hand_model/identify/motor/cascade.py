"""The controller of cascades: a position loop round a speed loop, simulated for many drives at once (equations in
`drive`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .batch import Moves
    from .grid import Grid

Array = NDArray[np.float64]


class Cascade:
    """What a position loop round a speed loop adds to the current. ahead (n, B) [%]: the reference less the position,
    which within the deadband stays;
    wanted (n, B) [%/s]: its velocity. The current that the preload takes is left out of `ahead`."""

    def __init__(self, moves: Moves, q: Mapping[str, Array], times: Grid) -> None:
        self.times, self.hold = times, moves.hold
        self.starting = (times.at.min(axis=1) * times.step_s < moves.start_s.max()).tolist()
        self.gain, self.damping, self.preload = q["gain"], q["damping"], q["preload"] / q["gain"]
        self.stiffness = 0.0
        self.start_s, self.target, self.origin, self.loop = (
            moves.start_s,
            moves.target,
            moves.origin,
            Loop(q, moves.speed),
        )
        self.ahead, self.wanted = np.zeros((2, len(times.at) + 1, len(self.gain)))

    def begin(self, p: Array, v: Array) -> Array:
        """Current (B,) [raw] before the move: what held the drive."""
        self.ahead[0] = (self.hold + self.damping * v) / self.gain - self.preload
        return self.hold

    def pace(self, first: int, last: int, step_s: Array) -> None:
        """The first k drives from row `first` to `last` on, in steps (k,) [s]."""
        k = len(step_s)
        self.loop.pace(step_s)
        self.step_s, self.half, self.own_gain = step_s, 0.5 * step_s, self.gain[:k]
        # current by the way that the reference goes in a step
        self.per_way = 0.5 * self.own_gain + self.damping[:k] / step_s
        self.own_target, (self.error, self.way, self.work, self.given) = self.target[:k], np.empty((4, k))
        self.w, self.d = self.wanted[first, :k], self.ahead[first, :k]
        self.coming = zip(self.wanted[first + 1 : last + 1, :k], self.ahead[first + 1 : last + 1, :k], strict=True)

    def push(self, i: int, p: Array, v: Array) -> Array:
        """Its part of the current (k,) [raw] in the middle of step i, less the preload and what `stiffness` takes."""
        way, given, wanted = self.way, self.given, self.w
        np.subtract(self.own_target, p, out=self.error)
        share, change = self.loop.step(self.error, v, wanted)
        if self.starting[i]:
            share, change = self._begun(i, p, v, wanted, share.copy(), change.copy())
        self.w, self.next = next(self.coming)
        np.add(wanted, change, out=self.w)
        np.add(wanted, self.w, out=way)
        np.multiply(way, self.half, out=way)
        np.multiply(way, self.per_way, out=given)
        np.multiply(self.own_gain, self.d, out=self.work)
        np.add(given, self.work, out=given)
        self.share = share
        return given

    def _begun(self, i: int, p: Array, v: Array, wanted: Array, share: Array, change: Array) -> tuple[Array, Array]:
        """The share of step i that lies behind the command counts, so that the command's instant counts within a step
        too."""
        k = len(p)
        since = np.minimum(
            np.maximum(
                (self.times.each(self.times.at[i])[:k] * self.times.step_s + self.step_s - self.start_s[:k])
                / self.step_s,
                0.0,
            ),
            1.0,
        )
        old_share, old_change = self.loop.step(self.origin[:k] - p, v, wanted)
        return since * share + (1 - since) * old_share, since * change + (1 - since) * old_change

    def advance(self, gone: Array) -> None:
        """One step in which the drive has gone so far (k,) [%]: within the deadband the integral holds."""
        way = self.way
        np.subtract(way, gone, out=way)
        np.multiply(way, self.share, out=way)
        np.add(self.d, way, out=self.next)
        self.d = self.next

    def asked(self, position: Array) -> Array:
        """What the reference adds to the current at the steps, (n, B) [raw], of drives at positions (n, B) [%]."""
        found = self.ahead[:-1] + position
        found += self.preload
        found *= self.gain
        found += self.damping * self.wanted[:-1]
        return found


class Loop:
    """The position loop of cascades: the wanted speed, within a slew rate, of a position error."""

    def __init__(self, q: Mapping[str, Array], speed: Array) -> None:
        self.slope, self.top, self.delay = (
            q["speed_full"] / np.maximum(q["rise"], 1e-4),
            q["speed_full"] * speed,
            q["delay"],
        )
        self.deadband, self.edge, self.gain = q["deadband"], q["edge"], q["position_gain"]

    def pace(self, step_s: Array) -> None:
        """The first k drives from here on, in steps (k,) [s]."""
        k = len(step_s)
        delay, top, slew = self.delay[:k], self.top[:k], step_s * self.slope[:k]
        self.own = self.deadband[:k], self.edge[:k], self.gain[:k], np.full(k, 0.5)
        # a step's travel, and where the drive will be seen at the middle and at the end of the step
        self.ahead_s = step_s, 0.5 * step_s - delay, step_s - delay
        self.bounds = np.array([0 * top, -top]), np.array([0 * top + 1, top])
        self.slew = np.array([-slew, -slew]), np.array([slew, slew])
        self.sizes, self.bounded, self.changes = np.empty((3, 2, k))
        self.views = *self.sizes, *self.bounded, *self.changes, *np.empty((2, k))

    def step(self, error: Array, v: Array, wanted: Array) -> tuple[Array, Array]:
        """Share (k,) (0..1) in which position errors (k,) [%] at velocities v (k,) [%/s] are outside the deadband, and
        the change of the wanted speed [%/s], in one step;
        both until the next call."""
        (deadband, edge, gain, half), (low, high), (down, up) = self.own, self.bounds, self.slew
        step_s, middle, end = self.ahead_s
        travel, far, share, speed, outside, inside, width, seen = self.views
        np.multiply(step_s, v, out=travel)
        np.multiply(middle, v, out=far)
        np.subtract(error, far, out=far)
        np.multiply(end, v, out=seen)
        np.subtract(error, seen, out=seen)
        np.multiply(gain, seen, out=speed)
        np.absolute(self.sizes, out=self.sizes)  # of travel and far
        # a deadband narrower than the step's travel sets in within the step
        np.maximum(travel, edge, out=width)
        np.subtract(far, deadband, out=share)
        np.divide(share, width, out=share)
        np.add(share, half, out=share)
        np.maximum(self.bounded, low, out=self.bounded)  # share and speed
        np.minimum(self.bounded, high, out=self.bounded)
        np.subtract(speed, wanted, out=outside)
        np.negative(wanted, out=inside)
        np.maximum(self.changes, down, out=self.changes)  # outside and inside
        np.minimum(self.changes, up, out=self.changes)
        np.subtract(outside, inside, out=outside)
        np.multiply(outside, share, out=outside)
        np.add(outside, inside, out=outside)
        return share, outside


def cascade_step(
    q: Mapping[str, float], error: float, speed: float, reference: float, wanted: float, velocity: float, step_s: float
) -> tuple[float, float]:
    """Reference [%] and wanted speed [%/s] of the cascade after one step of step_s [s], for a controller in another
    simulator's loop.

    error [%]: setpoint less position; speed: share of full; velocity [%/s] of the drive.
    """
    one = {
        k: np.atleast_1d(np.asarray(q[k], float))
        for k in ("deadband", "edge", "position_gain", "speed_full", "rise", "delay")
    }
    loop = Loop(one, np.atleast_1d(speed))
    loop.pace(np.atleast_1d(step_s))
    share, change = (float(x[0]) for x in loop.step(*map(np.atleast_1d, (error, velocity, wanted))))
    w = wanted + change
    # within the deadband the integral holds: the reference goes with the drive
    return share * (reference + 0.5 * step_s * (wanted + w)) + (1 - share) * (reference + step_s * velocity), w
