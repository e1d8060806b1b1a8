"""Noise with a memory: residuals freed of what those before them foretell, by autoregression (Cochrane & Orcutt 1949;
Box & Jenkins 1976, ch. 7).

A load that wanders while the drive moves, or a current that is filtered before it is logged, leaves residuals that are
alike from sample to sample:
taken for independent they count for more than they are worth, in the estimate and in its interval.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ORDER = 4  # samples that the prediction looks back
# by order from 0: coefficients of the samples before, latest first, and share of the deviation left
Predictors = tuple[tuple[Array, float], ...]


def autocorrelation(residual: Sequence[Array]) -> Array:
    """Autocorrelation (channels, ORDER + 1) of residuals (n, channels) of several stretches, from lag 0; windowed,
    which keeps it positive definite."""
    lags = [np.sum([np.sum(e[k:] * e[: len(e) - k], axis=0) for e in residual], axis=0) for k in range(ORDER + 1)]
    found = np.array(lags).T
    return found / found[:, :1] * (1 - np.arange(ORDER + 1) / (10 * (ORDER + 1)))


def predictors(correlation: Array) -> Predictors:
    """Best linear predictions of a sample from 0 to ORDER samples before it (Yule & Walker), of one channel's
    autocorrelation (ORDER + 1,)."""
    from scipy.linalg import solve_toeplitz

    found = [(np.empty(0), 1.0)]
    for order in range(1, len(correlation)):
        a = solve_toeplitz(correlation[:order], correlation[1 : order + 1])
        found.append((a, float(np.sqrt(max(1 - a @ correlation[1 : order + 1], 1e-3)))))
    return tuple(found)


def freed(e: Array, channels: Sequence[Predictors]) -> Array:
    """Rows (channels * n, ...), one channel after the other, less what the rows before foretell, of the same
    variance."""
    if not channels:
        return e
    n = len(e) // len(channels)
    out = e.copy()
    for c, known in enumerate(channels):
        one, whole = out[c * n : (c + 1) * n], e[c * n : (c + 1) * n]
        last = len(known) - 1
        for row in range(1, min(last, n)):
            a, share = known[row]
            one[row] = (whole[row] - a @ whole[row - 1 :: -1]) / share
        a, share = known[last]
        for i, x in enumerate(a, 1):
            one[last:] -= x * whole[last - i : n - i]
        one[last:] /= share
    return out
