"""Angle of a joint that drives, with as little noise as its encoder: noise in a regressor would bend the map behind it
and hide small departures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .load import PassedOn
from .motion import WHITE, estimate_motion, lasting_errors, least_error

Array = NDArray[np.float64]

SLOW = 0.25  # of the fastest speed: slower, what an angle departs by hardly changes while noise may last
APART_S = 1e3  # between recordings that are laid one after the other


@dataclass(frozen=True)
class LogAtFrames:
    """A log at mocap frames: counts, speed, acceleration (where it is sure) [counts, s], accounts of the load that is passed
    on, inside: where it was running and its rows tell the position. (n,)."""

    counts: Array
    speed: Array
    acceleration: Array
    loads: tuple[PassedOn, ...]
    inside: NDArray[np.bool_]

    @property
    def accounts(self) -> dict[str, Array]:
        """The accounts as a state's `extra` has them (`with_likelier_load`)."""
        names = (("load", "drag"), ("held_load", "held_drag"))
        return {
            k: v
            for name, p in zip(names, self.loads, strict=False)
            for k, v in zip(name, (p.load, p.drag), strict=True)
        }


@dataclass(frozen=True)
class Foreseen:
    """The course (n,) of a joint's angle as far as its encoder tells it: angle, rate, acceleration [deg, s]. departure:
    of the seen angle from that; slow: where it hardly changes; sure: where the encoder tells."""

    angle: Array
    rate: Array
    acceleration: Array
    departure: Array
    slow: NDArray[np.bool_]
    sure: NDArray[np.bool_]


def foresee(time_s: Array, angle: Array, log: LogAtFrames, expected: tuple[Array, Array] | None) -> Foreseen:
    """What is expected of the encoder, which is far quieter than one frame's markers, else a cubic of it."""
    use = log.inside
    middle, half = float(np.mean(log.counts[use])), float(np.ptp(log.counts[use])) / 2
    u = (log.counts - middle) / half
    fitted = np.polynomial.Polynomial.fit(u[use], angle[use], 3)
    base, slope = fitted(u), fitted.deriv()(u) / half
    # of what it does not cover, a recording's rest at first, the cubic tells how the angle goes on
    if expected is not None:
        at, foreseen = expected
        base = base + np.interp(time_s, at, foreseen - np.interp(at, time_s, base))
    slow = np.abs(log.speed) < SLOW * float(np.percentile(np.abs(log.speed), 98))
    return Foreseen(base, slope * log.speed, slope * log.acceleration, angle - base, slow, use)


def lasting(told: Sequence[tuple[Array, Foreseen]]) -> Array:
    """Covariance (k,) of a joint's errors one to k samples apart, by all its recordings: times [s] and courses."""
    if not told:
        return WHITE
    times, end = [], 0.0
    for time_s, _ in told:  # one after the other, far apart
        times.append(end + time_s - time_s[0])
        end = float(times[-1][-1]) + APART_S
    departure, slow = (np.concatenate([getattr(c, part) for _, c in told]) for part in ("departure", "slow"))
    return lasting_errors(np.concatenate(times), departure, slow)[1]


def driver_angle(
    time_s: Array, angle: Array, course: Foreseen | None, alike: Array
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Angle, velocity, acceleration (n,) of a joint with little noise, and where they are sure.

    With a course: that plus what the angle departs from it, smoothed (alike: covariance (k,) of its errors).
    Without one: the angle by local quadratics, sure only while it moves (at rest its noise would be all there is).
    """
    if course is None:
        motion = estimate_motion(time_s, angle)
        return motion.position, motion.velocity, motion.acceleration, motion.moving
    departure, rate = least_error(time_s, course.departure, alike)
    return course.angle + departure, course.rate + rate, course.acceleration, course.sure
