"""Rotations, unit vectors and coloured noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter


def unit(x: ArrayLike) -> np.ndarray:
    """The vector at length 1."""
    return np.asarray(x, float) / np.linalg.norm(x)


def across(x: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """The direction of what of x is at right angles to the unit vector `axis`."""
    rest = x - axis * (axis @ x)
    return rest / np.linalg.norm(rest)


def turned_about(axis: ArrayLike, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) by angles (n,) rad about one axis."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def turned_by(w: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3) rad."""
    angle = np.linalg.norm(w, axis=1)
    k = w / np.where(angle > 1e-12, angle, 1)[:, None]
    cross = np.zeros((len(w), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -k[:, 2], k[:, 1], -k[:, 0]
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = k[:, 2], -k[:, 1], k[:, 0]
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def coloured(rng: np.random.Generator, n: int, sigma: float, memory: float, shape: tuple[int, ...] = ()) -> np.ndarray:
    """First-order coloured noise (n, *shape) of standard deviation sigma; memory: correlation of neighbours."""
    e = rng.normal(size=(n, *shape)) * sigma * np.sqrt(1 - memory**2)
    e[0] /= np.sqrt(1 - memory**2)
    return lfilter([1], [1, -memory], e, axis=0)
