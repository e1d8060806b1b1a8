"""Vectors, rotations and random numbers that every module needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
RAD = np.pi / 180  # of a degree


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between low and high whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def unit(vectors: Array) -> Array:
    """Vectors of length one along the last axis."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def rotation(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Matrices (..., 3, 3) of turns about an axis, or one axis per angle [rad]."""
    axes = np.broadcast_to(unit(np.asarray(axis, float)), np.shape(angle) + (3,))
    x, y, z = np.moveaxis(axes, -1, 0)
    c, s = np.cos(angle), np.sin(angle)
    rest = 1 - c
    return np.stack(
        [
            np.stack([c + x * x * rest, x * y * rest - z * s, x * z * rest + y * s], -1),
            np.stack([y * x * rest + z * s, c + y * y * rest, y * z * rest - x * s], -1),
            np.stack([z * x * rest - y * s, z * y * rest + x * s, c + z * z * rest], -1),
        ],
        -2,
    )


def turn(vector: Array) -> Array:
    """Matrix of a rotation vector [rad]."""
    angle = np.linalg.norm(vector)
    return np.eye(3) if angle < 1e-12 else rotation(vector / angle, np.array(angle))
