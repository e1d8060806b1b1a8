"""How far the information matrix can be trusted: parametric bootstrap of the chain estimate on short arcs.

With many poses to estimate beside a few shared unknowns, maximum likelihood is biased to second order in noise over arc
(Neyman & Scott 1948). On the usual arcs that is nothing; on short ones the true error is larger than the covariance
says.
Recordings of the fitted chain with the fitted noise, fitted again, show by how much.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .chain import propagate
from .likelihood import ChainFit, angle_noise_ratio, fit_chain

Array = NDArray[np.float64]

# Noise of a joint angle over its spread, below which bias is far smaller than noise on any recording of minutes.
SAFE_RATIO = 0.08
REPLICATES = 8
FRAMES = 600


def variance_inflation(fit: ChainFit, seed: int = 0) -> Array:
    """(k,) factors, one or more, by which the covariance of each joint's axis and centre is too small.

    One for joints whose angle noise is less than SAFE_RATIO of the spread of their angles, without any simulation.
    """
    n_joints = len(fit.chain.axis_palm)
    if (angle_noise_ratio(fit) < SAFE_RATIO).all():
        return np.ones(n_joints)
    rng = np.random.default_rng(seed)
    n = len(fit.pose.angle_rad)
    frames = np.unique(np.linspace(0, n - 1, min(n, FRAMES)).astype(int))
    pose, data = fit.pose.take(frames), fit.data.take(frames)
    exact = pose.to_world(propagate(fit.chain, data.body, pose.angle_rad)[0])
    exact = np.where((fit.weight[frames] > 0.5)[..., None], exact, np.nan)
    square = np.zeros((REPLICATES, n_joints))
    for i in range(REPLICATES):
        again = fit_chain(replace(data, position_world=exact + rng.normal(0, fit.noise_m, exact.shape)), fit.chain)
        for k in range(n_joints):
            start = 3 * len(data.body) + 4 * k
            covariance = again.covariance[start : start + 2, start : start + 2]
            off = again.chain.tangent[k] @ (fit.chain.axis_palm[k] - again.chain.axis_palm[k])
            square[i, k] = off @ np.linalg.pinv(covariance, hermitian=True) @ off / 2
    measured = np.mean(square, axis=0)
    # One is expected, with this scatter; what is beyond is bias, which does not shrink with more frames.
    beyond = np.maximum(measured - 1 - 1 / np.sqrt(REPLICATES), 0.0)
    return 1 + beyond * n / len(frames)
