"""The twin's own geometry, by unit quaternions (w, x, y, z): shares nothing with the identification that it tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import HandModelError

Array = NDArray[np.float64]


def unit(vector: ArrayLike) -> Array:
    """Vectors (..., 3) scaled to length one."""
    v = np.asarray(vector, float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def turn(axis: ArrayLike, angle_rad: ArrayLike) -> Array:
    """Quaternions (..., 4) of rotations about an axis (3,) or axes (..., 3) by angles (...) [rad]."""
    half = 0.5 * np.asarray(angle_rad, float)[..., None]
    return np.concatenate([np.cos(half), np.sin(half) * unit(axis)], axis=-1)


def compose(left: Array, right: Array) -> Array:
    """Hamilton product (..., 4): `right` is applied first."""
    w1, v1, w2, v2 = left[..., :1], left[..., 1:], right[..., :1], right[..., 1:]
    w = w1 * w2 - (v1 * v2).sum(-1, keepdims=True)
    return np.concatenate([w, w1 * v2 + w2 * v1 + np.cross(v1, v2)], axis=-1)


def conjugate(rotation: Array) -> Array:
    """Inverse rotations (..., 4)."""
    return rotation * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(rotation: Array, vector: ArrayLike) -> Array:
    """Vectors (..., 3) turned by quaternions (..., 4)."""
    v = np.asarray(vector, float)
    twice = 2.0 * np.cross(rotation[..., 1:], v)
    return v + rotation[..., :1] * twice + np.cross(rotation[..., 1:], twice)


def random_turn(rng: np.random.Generator, angle_rad: float | None = None) -> Array:
    """A quaternion (4,) about a random axis, by `angle_rad` or, where that is None, uniformly distributed."""
    if angle_rad is None:
        q = rng.normal(size=4)
        return q / np.linalg.norm(q)
    return turn(rng.normal(size=3), angle_rad)


def landmark_frame(origin: ArrayLike, medial: ArrayLike, lateral: ArrayLike, side: str) -> Array:
    """Axes (3, 3), rows v_x, v_y, v_z, of the repeatable frame of three palm landmarks (3,).

    v_z = (m - o) x (l - o) on a left hand, the operands swapped on a right one; v_y = v_z x ((l + m)/2 - o);
    v_x = v_y x v_z; all normalised (thesis, Eq. 3.1 to 3.3).
    """
    if side not in ("left", "right"):
        raise HandModelError(f'side is "{side}"; valid: left, right')
    to_medial, to_lateral = np.subtract(medial, origin), np.subtract(lateral, origin)
    z = np.cross(to_medial, to_lateral) if side == "left" else np.cross(to_lateral, to_medial)
    y = np.cross(z, 0.5 * (to_lateral + to_medial))
    return unit(np.stack([np.cross(y, z), y, z]))
