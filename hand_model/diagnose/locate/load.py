"""Load that a motor passes on, with as little noise as its current allows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...effects.path import dahl, jenkins
from .motion import Motion, least_error

Array = NDArray[np.float64]

REACHES = np.geomspace(0.001, 0.05, 12)  # of the range, over which friction builds up after a reversal
ORDER = 4  # of the load over the position


def transmitted_load(time_s: Array, current: Array, motion: Motion) -> Array:
    """Load (n,) [raw] that a motor passes on: its current without what accelerates it and without its noise.

    A current's noise would be an error of a regressor, and smoothing it rounds what happens at a reversal, which is
    what tells a give from a play. Speed, friction that builds up after reversals (Dahl's or Jenkins's, whichever the
    current prefers) and position explain nearly all of it; of the rest, what a smoothing with least error leaves.
    """
    moved = np.stack([motion.acceleration, motion.velocity, np.ones_like(time_s)], axis=-1)
    span = float(np.ptp(motion.position))
    if span == 0:
        return least_error(time_s, current)[0]
    powers = ((motion.position - motion.position.min()) / span)[:, None] ** np.arange(1, ORDER + 1)
    best, explained, inertia = np.inf, current, 0.0
    for rise in (dahl, jenkins):
        for reach in REACHES * span:
            columns = np.c_[moved, rise(motion.position, reach), powers]
            fitted = np.linalg.lstsq(columns, current, rcond=1e-12)[0]
            error = float(np.sum((current - columns @ fitted) ** 2))
            if error < best:
                best, explained, inertia = error, columns @ fitted, float(fitted[0])
    return explained + least_error(time_s, current - explained)[0] - max(inertia, 0.0) * motion.acceleration
