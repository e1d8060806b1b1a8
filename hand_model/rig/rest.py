"""Where a joint stands still, and the weight by which a balance leaves that out before anything is filtered.

What holds a joint that stands (its friction, within bounds) is unknown, and a low-pass filter spreads it over the
motion beside it, where it looks like friction at low speed or by load. A balance holds at every instant: multiplied by
a weight that is zero at rest it holds still, and both sides of it pass the filter without what nobody knows (test
functions that vanish at the ends of each stroke, as in weak-form identification, Messenger & Bortz 2021).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .states import noise_std

Array = NDArray[np.float64]
QUIET = 7.0  # standard deviations: within so much the readings of a joint at rest stay, noise or steps of an encoder
SHORTEST = 0.5  # periods of the cut-off: what is shorter the filter does not tell from a reversal
# periods of the states' cut-off, over which the weight rises: states are not known better beside a jump of acceleration
EDGE = 1.0


def stands(position: Array, rate_hz: float, cutoff_hz: float, creep: float = 0.0) -> Array:
    """Where a joint stands, (n,) bool: all readings (n,) [rad or m] of a stretch that the filter of a balance can tell
    lie within their noise, or within what a joint covers at a speed `creep` below which no direction is known: a
    controller that hunts lets its joint dither."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    size = max(3, round(SHORTEST * rate_hz / cutoff_hz)) | 1
    if size > len(position):
        return np.zeros(len(position), bool)
    within = maximum_filter1d(position, size, mode="nearest") - minimum_filter1d(position, size, mode="nearest")
    quiet = within <= max(QUIET * noise_std(position), creep * (size - 1) / rate_hz)
    return maximum_filter1d(quiet.astype(np.uint8), size) > 0  # the whole stretch, not its middle alone


def moving_weight(position: Array, rate_hz: float, cutoff_hz: float, states_hz: float, creep: float = 0.0) -> Array:
    """Weight (n,) of every sample: zero where the joint stands, from there a cosine up to one over a period of the
    states' cut-off; empty where it never stands."""
    from scipy.ndimage import distance_transform_edt

    still = stands(position, rate_hz, cutoff_hz, creep)
    if not still.any() or still.all():  # of a joint that is held throughout there is nothing else
        return np.zeros(0)
    away = distance_transform_edt(~still) / rate_hz
    return 0.5 - 0.5 * np.cos(np.pi * np.minimum(away * states_hz / EDGE, 1.0))
