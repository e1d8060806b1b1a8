"""Bounded linear least squares from block sums, so that leaving a block out costs one small solve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def solve_bounded(gram: Array, moment: Array, low: Array, high: Array, prior: Array, weight: Array) -> Array:
    """argmin of theta' G theta - 2 m' theta + sum weight (theta - prior)^2 in a box, by an active set on the bounds.

    gram (P, P), moment (P,), all others (P,). Parameters that the data says nothing about stay at their prior.
    """
    h = gram + np.diag(weight)
    g = moment + weight * prior
    scale = 1.0 / np.sqrt(np.maximum(np.diag(h), 1e-300))
    h, g = h * scale[:, None] * scale, g * scale
    low, high = low / scale, high / scale
    theta = np.clip(np.zeros(len(g)), low, high)
    fixed = np.zeros(len(g), bool)
    for _ in range(3 * len(g) + 5):
        free = ~fixed
        trial = theta.copy()
        if free.any():
            rows = h[free]
            trial[free] = np.linalg.solve(
                rows[:, free] + 1e-13 * np.eye(len(rows)), g[free] - rows[:, fixed] @ theta[fixed]
            )
        beyond = free & ((trial < low) | (trial > high))
        if beyond.any():
            theta = np.clip(trial, low, high)
            fixed |= beyond
            continue
        theta = trial
        slope = h @ theta - g  # a clamped parameter is freed where the cost falls into the box
        release = fixed & (((theta <= low) & (slope < -1e-10)) | ((theta >= high) & (slope > 1e-10)))
        if not release.any():
            break
        worst = np.argmax(np.abs(slope) * release)
        fixed[worst] = False
    return np.clip(theta, low, high) * scale


def sums_of(x: Array, y: Array, used: NDArray[np.int64], width: int) -> tuple[Array, Array, float, int]:
    """Normal equations of columns x (m, k), which stand at the places `used` (k,) among `width` others that are zero,
    and y (m,): gram (width, width), moment (width,), square, count."""
    gram, moment = np.zeros((width, width)), np.zeros(width)
    gram[np.ix_(used, used)], moment[used] = x.T @ x, x.T @ y
    return gram, moment, float(y @ y), len(y)


def squared_error(gram: Array, moment: Array, square: float, theta: Array) -> float:
    """Sum of squares that theta (P,) leaves, from normal equations: below zero by rounding at most."""
    return float(square - 2 * moment @ theta + theta @ gram @ theta)
