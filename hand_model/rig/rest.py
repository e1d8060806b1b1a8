"""Where a joint stands still, and the weight by which a balance leaves that out before anything is filtered.

What holds a joint that stands (its friction, within bounds) is unknown, and a low-pass filter spreads it over the
motion beside it, where it looks like friction at low speed or by load. A balance holds at every instant: multiplied by
a weight that is zero at rest it holds still, and both sides of it pass the filter without what nobody knows (test
functions that vanish at the ends of each stroke, as in weak-form identification, Messenger & Bortz 2021).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .states import noise_std

Array = NDArray[np.float64]
QUIET = 7.0  # standard deviations: within so much the readings of a joint at rest stay, noise or steps of an encoder
SHORTEST = 0.5  # periods of the cut-off: what is shorter the filter does not tell from a reversal
# periods of the states' cut-off, over which the weight rises: states are not known better beside a jump of acceleration
EDGE = 1.0
TURN = 0.5  # of the time in which a joint reaches its speed, by both's root mean squares


@dataclass(frozen=True)
class Creep:
    """What is no motion of a joint, however smooth. speed: below which no direction is known [rad/s or m/s]; turn_s: for
    how long a joint is slow where it turns round, at most [s]."""

    speed: float = 0.0
    turn_s: float = 0.0

    @classmethod
    def of(cls, velocity: Array, acceleration: Array, speed: float) -> Creep:
        """Of a joint that moves like that (n,) [rad/s or m/s, and per s]."""
        return cls(speed, TURN * float(np.std(velocity) / max(np.std(acceleration), 1e-300)))


def stands(position: Array, rate_hz: float, cutoff_hz: float, creep: Creep = Creep()) -> Array:
    """Where a joint stands, (n,) bool: all readings (n,) [rad or m] of a stretch that the filter of a balance can tell
    lie within their noise; or those of a stretch longer than a turn takes, within what it covers at a creep: a controller
    that hunts lets its joint dither."""
    shortest = SHORTEST / cutoff_hz
    quiet = _within(position, round(shortest * rate_hz), QUIET * noise_std(position))
    if creep.speed <= 0:
        return quiet
    long = max(shortest, creep.turn_s)
    return quiet | _within(position, round(long * rate_hz), creep.speed * long, whole=True)


def _within(position: Array, size: int, width: float, whole: bool = False) -> Array:
    """Samples (n,) of all stretches of a size that lie within a width [rad or m]."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    size = max(3, size) | 1
    if size > len(position):
        return np.zeros(len(position), bool)
    across = maximum_filter1d(position, size, mode="nearest") - minimum_filter1d(position, size, mode="nearest")
    quiet = across <= width
    if whole:  # those that reach beyond an end are shorter than they should be
        quiet[: size // 2] = quiet[-(size // 2) :] = False
    return maximum_filter1d(quiet.astype(np.uint8), size) > 0  # the whole stretch, not its middle alone


def moving_weight(position: Array, rate_hz: float, cutoff_hz: float, states_hz: float, creep: Creep = Creep()) -> Array:
    """Weight (n,) of every sample: zero where the joint stands, from there a cosine up to one over a period of the
    states' cut-off; empty where it never stands."""
    from scipy.ndimage import distance_transform_edt

    still = stands(position, rate_hz, cutoff_hz, creep)
    if not still.any() or still.all():  # of a joint that is held throughout there is nothing else
        return np.zeros(0)
    away = distance_transform_edt(~still) / rate_hz
    return 0.5 - 0.5 * np.cos(np.pi * np.minimum(away * states_hz / EDGE, 1.0))
