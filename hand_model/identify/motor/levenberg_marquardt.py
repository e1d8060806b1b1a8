"""One damped Gauss-Newton step within bounds (Levenberg 1944; Marquardt 1963), several dampings tried in one batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .memory import Predictors
from .misfit import misfits
from .moves import MoveData
from .normal_equations import limits, unpressed

Array = NDArray[np.float64]

# of one step, powers of ten of the last one; the second four where the first three fail on a fresh Jacobian
DAMPINGS = ((-1, 0, 1), (-2, 2, 3, 4))
# of one step, besides half of a value itself
ABSOLUTE_REACH = {
    "preload": 20.0,
    "viscous": 0.1,
    "stiffness": 0.2,
    "coulomb": 10.0,
    "bristle": 0.01,
    "damping": 2.0,
    "rise": 0.02,
    "fall": 0.02,
    "deadband": 0.2,
    "delay": 0.002,
    "lead": 0.002,
    "lag": 0.002,
}
OWN_REACH = np.array([0.01, 0.3, 0.01, 10.0])  # of one step


def step(
    data: Sequence[MoveData],
    q: dict[str, float],
    names: Sequence[str],
    own: Array,
    weights: list[Array],
    bounds: Mapping[str, tuple[float, float]],
    system: tuple[Array, Array, list[tuple[Array, Array, Array]]],
    cost: float,
    damping: float,
    controller: str,
    step_s: float,
    memory: tuple[Predictors, ...],
    dampings: Sequence[tuple[int, ...]],
) -> tuple[dict[str, float], Array, float, float, list[Array]] | None:
    """One Levenberg-Marquardt step, the best of the first dampings (powers of ten) that improve: new values, own
    unknowns, cost, damping and residuals;
    None where nothing improves."""
    normal, gradient, blocks = system
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    free = unpressed(gradient, np.array([q[n] for n in names]), limits(names, bounds))
    system = (normal / np.outer(scale, scale))[np.ix_(free, free)]
    for powers in dampings:
        candidates = []
        for strength in (tried := damping * 10.0 ** np.array(powers, float)):
            move = np.zeros(len(names))
            move[free] = (
                np.linalg.lstsq(system + strength * np.eye(free.sum()), (gradient / scale)[free], rcond=1e-12)[0]
                / scale[free]
            )
            new_q = dict(q)
            for n, d in zip(names, move, strict=True):
                low, high = bounds.get(n, (-np.inf, np.inf))
                reach = 0.5 * abs(q[n]) + ABSOLUTE_REACH.get(n, 0.0)
                new_q[n] = float(np.clip(q[n] + np.clip(d, -reach, reach), low, high))
            actual = np.array([new_q[n] - q[n] for n in names])
            local = np.array([inverse @ (b - c @ actual) for inverse, b, c in blocks])
            candidates.append((new_q, own + np.clip(local, -OWN_REACH, OWN_REACH)))
        costs, best, residual = misfits(
            data, [c[0] for c in candidates], [c[1] for c in candidates], weights, controller, step_s, memory
        )
        if costs[best] < cost:
            return (*candidates[best], float(costs[best]), float(np.clip(tried[best], 1e-8, 1e3)), residual)
    return None
