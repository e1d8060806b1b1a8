"""Bounded linear least squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIDGE = 1e-10  # of each column's square: what cannot be told apart is shared


def bounded_least_squares(matrix: Array, target: Array, low: Array, high: Array) -> Array:
    """min |A x - b| with low <= x <= high, bounds 0 or infinite."""
    return from_products(matrix.T @ matrix, matrix.T @ target, low, high)


def from_products(gram: Array, right: Array, low: Array, high: Array) -> Array:
    """The same from A'A (k, k) and A'b (k,): an active set on the normal equations."""
    diagonal = gram.diagonal()
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    gram, right = gram / scale[:, None] / scale, right / scale
    gram.flat[:: len(gram) + 1] += RIDGE
    low, high = low * scale, high * scale
    x = np.linalg.solve(gram, right)
    free = (x >= low) & (x <= high)
    while not free.all():
        x = np.zeros(len(low))
        x[free] = np.linalg.solve(gram[np.ix_(free, free)], right[free])
        wrong = free & ((x < low) | (x > high))
        if not wrong.any():
            break
        free &= ~wrong
    return x / scale
