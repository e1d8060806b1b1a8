"""Covariance of a fit whose residuals are independent from move to move only: the model's, and a jackknife over moves.

The model's covariance is right where the noise is what it is taken for. A load that wanders, a detail of the drive that
is not in the model, make the residuals of one move alike; what that does to the estimate is seen by leaving out one
move after the other (Cameron & Miller 2015, section VI). As moves are few and some weigh more than others, intervals
are Student's, with the degrees of freedom that the moves' weights leave (Satterthwaite;
Bell & McCaffrey 2002).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def covariance(parts: Array, prior: Array, scores: Array, gradient: Array, chi2: float) -> Array:
    """Covariance (k, k): of the model or of the jackknife, whichever is larger for each parameter, so that 1.96
    deviations hold 95 % (Student).

    parts (moves, k, k): normal matrix by move; prior (k, k): what is added to their sum; scores (moves, k): gradient by
    move; gradient (k,): of all, what is left of it where the search ended; chi2: mean square of the whitened residuals.
    """
    from scipy.stats import t

    normal = parts.sum(axis=0) + prior
    bread = np.linalg.pinv(normal, hermitian=True)
    n = len(parts)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    left_out = (normal - parts) / np.outer(scale, scale)
    moved = np.array(
        [
            np.linalg.lstsq(a, g / scale, rcond=1e-10)[0] / scale
            for a, g in zip(left_out, gradient - scores, strict=True)
        ]
    )
    moved -= moved.mean(axis=0)
    jackknife = (n - 1) / n * moved.T @ moved + bread @ prior @ bread
    model = bread * max(1.0, chi2)
    weight = np.einsum("ij,njk,ki->ni", bread, parts, bread)
    freedom = np.clip(weight.sum(axis=0) ** 2 / np.maximum((weight**2).sum(axis=0), 1e-300), 2.0, None)
    ratio = np.sqrt(np.maximum(np.diag(jackknife), 0) / np.maximum(np.diag(model), 1e-300))
    wider = np.maximum(ratio, 1.0) * t.ppf(0.975, freedom) / 1.96
    return model * np.outer(wider, wider)
