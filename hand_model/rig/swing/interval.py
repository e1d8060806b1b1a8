"""Intervals of parameters fitted by output error: the sandwich estimator, clustered by stretch.

Residuals of a simulated motion are correlated within a stretch and partly systematic; the gradients of whole stretches
are what varies independently (White 1982; Liang & Zeger 1986). Around a model that still misses something the interval
is that of the best such model, not of the truth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fit import Task, jacobian, lowest, typical
from .simulation import INDEX, Swing

Array = NDArray[np.float64]
QUANTILE = 1.96


def intervals(swing: Swing, free: tuple[str, ...], theta: Array) -> dict[str, tuple[float, float]]:
    """95 % interval of each free parameter at the solution theta (len(PARAMETERS),), within its physical bounds."""
    stretches = tuple(int(i) for i in swing.train())
    residual, slopes = jacobian(swing, Task(free, theta, stretches), theta)
    per = slopes.reshape(len(stretches), -1, len(free))
    gradient = np.einsum("snp,sn->sp", per, residual.reshape(len(stretches), -1))
    # what a bound holds does not move with the data, and the others do not make up for it
    low = lowest(swing)
    loose = np.array([theta[INDEX[n]] > low[INDEX[n]] for n in free])
    bread = np.zeros((len(free), len(free)))
    own = slopes[:, loose]
    bread[np.ix_(loose, loose)] = np.linalg.pinv(own.T @ own, hermitian=True, rcond=1e-10)
    few = len(stretches) / max(len(stretches) - len(free), 1)  # each stretch has bent the fit towards itself
    spread = np.sqrt(np.maximum(np.diag(bread @ (gradient.T @ gradient) @ bread), 0.0) * few)
    unit = typical(swing)
    out = {}
    for name, s in zip(free, spread, strict=True):
        value, half = theta[INDEX[name]], QUANTILE * s * unit[INDEX[name]]
        out[name] = (float(max(value - half, low[INDEX[name]])), float(value + half))
    return out


__all__ = ["intervals"]
