"""Rotations and rigid registration, vectorised over leading dimensions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def skew(vector: ArrayLike) -> Array:
    """Cross-product matrices [v]x of vectors (..., 3) -> (..., 3, 3), so that [v]x w = v x w."""
    v = np.asarray(vector, float)
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def rotation_about(axis: ArrayLike, angle_rad: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) about one unit axis (3,) by angles (...) [rad]: Rodrigues' formula."""
    k = skew(axis)
    a = np.asarray(angle_rad, float)[..., None, None]
    return np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * (k @ k)


def rotation_from_vector(vector: ArrayLike) -> Array:
    """Exponential map: rotation vectors (..., 3) [rad] -> rotation matrices (..., 3, 3)."""
    v = np.asarray(vector, float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = skew(v)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    sinc = np.where(small, 1 - angle**2 / 6, np.sin(safe) / safe)
    cosc = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + sinc * k + cosc * (k @ k)


def kabsch(source: ArrayLike, target: ArrayLike, weight: ArrayLike | None = None) -> tuple[Array, Array]:
    """Rigid registration: R, t minimising sum_j w_j |target_j - R source_j - t|^2 (Kabsch 1976).

    source: (m, 3) or (n, m, 3); target: (n, m, 3) or (m, 3); weight: (n, m) or (m,), zero where a point is missing
    (its coordinates may be nan). Lengths in one unit. Returns rotation (n, 3, 3) or (3, 3) and translation (n, 3) or
    (3,).
    """
    a, b = np.broadcast_arrays(np.asarray(source, float), np.asarray(target, float))
    w = np.ones(a.shape[:-1]) if weight is None else np.broadcast_to(np.asarray(weight, float), a.shape[:-1])
    w = np.where(np.isfinite(a).all(-1) & np.isfinite(b).all(-1), w, 0.0)[..., None]
    a, b = np.where(w > 0, a, 0.0), np.where(w > 0, b, 0.0)
    total = np.maximum(w.sum(-2, keepdims=True), 1e-300)
    mean_a, mean_b = (w * a).sum(-2, keepdims=True) / total, (w * b).sum(-2, keepdims=True) / total
    covariance = np.swapaxes(w * (a - mean_a), -1, -2) @ (b - mean_b)
    u, _, vt = np.linalg.svd(covariance)
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    u = u.copy()
    u[..., :, 2] *= sign[..., None]
    rotation = np.swapaxes(u @ vt, -1, -2)
    translation = mean_b[..., 0, :] - (rotation @ mean_a[..., 0, :, None])[..., 0]
    return rotation, translation


def angle_between(axis_a: ArrayLike, axis_b: ArrayLike, undirected: bool = False) -> Array:
    """Angle [rad] between vectors (..., 3); `undirected` treats v and -v as the same line."""
    a, b = np.asarray(axis_a, float), np.asarray(axis_b, float)
    cross, dot = np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1)
    return np.arctan2(cross, np.abs(dot) if undirected else dot)


def perpendicular_basis(axis: ArrayLike) -> Array:
    """Two unit vectors (2, 3) that complete the unit axis (3,) to a right-handed frame."""
    a = np.asarray(axis, float)
    helper = np.eye(3)[np.argmin(np.abs(a))]
    first = np.cross(a, helper)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(a, first)])
