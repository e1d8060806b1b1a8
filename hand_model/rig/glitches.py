"""Single readings that no machine gave: a broken word on a bus, a counter that jumps by a turn and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAR = 5.0  # times as far from the middle as 99 of 100 readings at most are
MOST = 0.01  # of the readings: what comes more often is how the channel reads
WIDTH = 5  # readings, of whose median the middle one is no outlier if its next two are as far


def glitches(values: Array) -> NDArray[np.bool_]:
    """Which readings (n,) stand alone (or two by two) far outside all others; none where it is more than a few, and none
    that is nan."""
    from scipy.ndimage import median_filter

    seen = np.isfinite(values)
    out = np.zeros(len(values), bool)
    if seen.sum() < WIDTH:
        return out
    known = values[seen]
    away = np.abs(known - np.median(known))
    usual = FAR * float(np.quantile(away, 0.99))
    alone = np.abs(known - median_filter(known, WIDTH, mode="nearest")) > usual
    found = alone & (away > usual) & (usual > 0)
    if np.mean(found) <= MOST:
        out[np.flatnonzero(seen)[found]] = True
    return out
