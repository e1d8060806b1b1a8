"""Vectors and rotations that every module needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def unit(vector: ArrayLike) -> Array:
    """A vector of length one."""
    vector = np.asarray(vector, float)
    return vector / np.linalg.norm(vector)


def rotation(axis: ArrayLike, angles: ArrayLike) -> Array:
    """Matrices (n, 3, 3) of turns about a unit axis by angles [rad]."""
    x, y, z = np.asarray(axis, float)
    angles = np.atleast_1d(angles)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angles)[:, None, None] * cross + (1 - np.cos(angles))[:, None, None] * (cross @ cross)


def turns(vectors: ArrayLike) -> Array:
    """Matrices (n, 3, 3) of rotation vectors (n, 3) [rad]."""
    vectors = np.atleast_2d(vectors)
    angles = np.linalg.norm(vectors, axis=1)
    axes = vectors / np.maximum(angles, 1e-12)[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2] = -axes[:, 2], axes[:, 1]
    cross[:, 1, 0], cross[:, 1, 2] = axes[:, 2], -axes[:, 0]
    cross[:, 2, 0], cross[:, 2, 1] = -axes[:, 1], axes[:, 0]
    return np.eye(3) + np.sin(angles)[:, None, None] * cross + (1 - np.cos(angles))[:, None, None] * (cross @ cross)


def across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors at right angles to an axis of a joint and to each other."""
    first = unit(np.cross(axis, [0, 0, 1.0]))
    return first, np.cross(axis, first)
