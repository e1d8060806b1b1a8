"""The normal equations of the linearised misfit: the moves' own unknowns eliminated (Schur complement), parameters held
by their bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .misfit import PRIOR
from .moves import MoveData

Array = NDArray[np.float64]


def expected_fall(normal: Array, gradient: Array, blocks: list[tuple[Array, Array, Array]]) -> float:
    """Fall of the cost that the linear model promises."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    shared = (gradient / scale) @ np.linalg.lstsq(normal / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0]
    return float(shared + sum(b @ inverse @ b for inverse, b, _ in blocks))


def normal_equations(
    data: Sequence[MoveData],
    r: list[Array],
    g: list[Array],
    local: list[Array],
    own: Array,
    q: Mapping[str, float],
    names: Sequence[str],
) -> tuple[Array, Array, list[tuple[Array, Array, Array]], Array, Array]:
    """Shared normal matrix (k, k) and gradient (k,) with every move's own unknowns eliminated, what restores these, and
    by move the score (moves, k) and the normal matrix (moves, k, k).

    r, g, local: whitened residuals (2n,), shared (2n, k) and own (2n, 4) Jacobian of every move; own: (moves, 4).
    """
    parts, scores, blocks = [], [], []
    for m, e, a, b, x in zip(data, r, g, local, own, strict=True):
        w = 1 / m.own_sd**2
        inverse = np.linalg.inv(b.T @ b + np.diag(w))
        rhs, cross = b.T @ e + w * (m.own - x), b.T @ a
        parts.append(a.T @ a - cross.T @ inverse @ cross)
        scores.append(a.T @ e - cross.T @ inverse @ rhs)
        blocks.append((inverse, rhs, cross))
    gradient, normal = np.sum(scores, axis=0), np.sum(parts, axis=0)
    for i, n in enumerate(names):
        if n in PRIOR:
            mean, sd = PRIOR[n]
            normal[i, i] += 1 / sd**2
            gradient[i] -= (q[n] - mean) / sd**2
    return normal, gradient, blocks, np.array(scores), np.array(parts)


def unresolved(normal: Array, gradient: Array, bounds: Array, values: Array) -> Array:
    """The step (k,) that the linear model still asks for where the search ended: what a misfit with kinks (sticking)
    leaves open.

    Parameters that are held by their bounds (k, 2) stay.
    """
    free = unpressed(gradient, values, bounds)
    step = np.zeros(len(values))
    if free.any():
        scale = np.sqrt(np.maximum(np.diag(normal)[free], 1e-30))
        step[free] = (
            np.linalg.lstsq(normal[np.ix_(free, free)] / np.outer(scale, scale), gradient[free] / scale, rcond=1e-8)[0]
            / scale
        )
    return step


def limits(names: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Array:
    """Bounds (k, 2) of the named parameters, infinite where there are none."""
    return np.array([bounds.get(n, (-np.inf, np.inf)) for n in names]).reshape(-1, 2)


def unpressed(gradient: Array, values: Array, bounds: Array) -> NDArray[np.bool_]:
    """Which of the values (k,) are not pressed against their bounds (k, 2) by the descent."""
    low, high = bounds.T
    margin = 1e-9 + 0.01 * np.abs(np.where(np.isfinite(low), low, 0.0))
    return ~(
        ((values <= low + margin) & (gradient < 0))
        | ((values >= high - 1e-9 - 0.01 * np.abs(np.where(np.isfinite(high), high, 0.0))) & (gradient > 0))
    )
