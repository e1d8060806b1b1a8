"""Bounded linear least squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bounded_least_squares(matrix: Array, target: Array, low: Array, high: Array) -> Array:
    """min |A x - b| with low <= x <= high, bounds 0 or infinite."""
    return from_products(matrix.T @ matrix, matrix.T @ target, low, high)


def from_products(gram: Array, right: Array, low: Array, high: Array) -> Array:
    """The same from A'A (k, k) and A'b (k,): an active set on the normal equations."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0, scale, 1.0)
    gram, right = gram / np.outer(scale, scale), right / scale
    gram = gram + 1e-10 * np.eye(len(gram))
    free = np.ones(len(low), bool)
    x = np.zeros(len(low))
    for _ in range(len(low) + 1):
        x[:] = 0.0
        x[free] = np.linalg.solve(gram[np.ix_(free, free)], right[free])
        wrong = free & ((x < low * scale) | (x > high * scale))
        if not wrong.any():
            break
        free &= ~wrong
    return x / scale
