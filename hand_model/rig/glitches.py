"""Single readings that no machine gave: a broken word on a bus, a counter that jumps by a turn and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAR = 5.0  # times as far from the middle as 99 of 100 readings at most are
OFF = 20.0  # times what 99 of 100 readings at most move from one to the next, or are off their neighbours
MOST = 0.01  # of the readings: what comes more often is how the channel reads
WIDTH = 5  # readings, of whose median the middle one is no outlier if its next two are as far


def glitches(values: Array, smooth: bool = False) -> NDArray[np.bool_]:
    """Which readings (n,) stand alone (or two by two) far outside all others; none where it is more than a few, and none
    that is nan. smooth: what is read moves no farther in one sample than it does in others, as a position does; then also
    those that lie within the range of all others and far off their neighbours."""
    from scipy.ndimage import median_filter

    seen = np.isfinite(values)
    out = np.zeros(len(values), bool)
    if seen.sum() < WIDTH:
        return out
    known = values[seen]
    away = np.abs(known - np.median(known))
    usual = FAR * float(np.quantile(away, 0.99))
    middle = median_filter(known, WIDTH, mode="nearest")
    off = np.abs(known - middle)
    found = (off > usual) & (away > usual) & (usual > 0)
    if smooth:
        # where all else hardly moves, what is off by a step of its reading is none
        typical = max(float(np.quantile(off, 0.99)), float(np.quantile(np.abs(np.diff(middle)), 0.99)))
        found |= (off > OFF * typical) & (typical > 0)
    if np.mean(found) <= MOST:
        out[np.flatnonzero(seen)[found]] = True
    return out
