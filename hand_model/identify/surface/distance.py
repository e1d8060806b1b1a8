"""How far points are from a mesh, as the three figures by which a surface is judged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

CHUNK = 400_000  # pairs of point and triangle at a time


def distance_to_mesh(points: ArrayLike, vertices: Array, faces: Faces) -> Array:
    """Distance (n,) [m] of points (n, 3) from the nearest triangle of a mesh: (v, 3) [m], (f, 3)."""
    p = np.asarray(points, float).reshape(-1, 3)
    corners = vertices[faces]
    step = max(1, CHUNK // max(len(faces), 1))
    parts = [_to_triangles(p[i : i + step, None], corners[None]).min(1) for i in range(0, len(p), step)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _to_triangles(p: Array, triangle: Array) -> Array:
    """Distances of points (..., 3) from triangles (..., 3, 3): of the foot within the triangle, else of the nearest edge."""
    a, b, c = (triangle[..., i, :] for i in range(3))
    ab, ac, ap = b - a, c - a, p - a
    normal = np.cross(ab, ac)
    square = (normal * normal).sum(-1)
    flat, square = square < 1e-24, np.maximum(square, 1e-24)  # a triangle without area has edges only
    v = (np.cross(ap, ac) * normal).sum(-1) / square  # barycentric weights of the foot
    w = (np.cross(ab, ap) * normal).sum(-1) / square
    off = np.abs((ap * normal).sum(-1)) / np.sqrt(square)
    edges = np.minimum.reduce([_to_edges(p, a, b), _to_edges(p, b, c), _to_edges(p, c, a)])
    return np.where((v >= 0) & (w >= 0) & (v + w <= 1) & ~flat, off, edges)


def _to_edges(p: Array, a: Array, b: Array) -> Array:
    along, arm = b - a, p - a
    share = np.clip((arm * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-300), 0, 1)
    return np.linalg.norm(arm - share[..., None] * along, axis=-1)


def summary_mm(distance_m: ArrayLike) -> dict[str, Any]:
    """Median, 95 % quantile and maximum [mm] of distances (n,) [m], and their number."""
    d = 1e3 * np.abs(np.asarray(distance_m, float))
    return {"median_mm": float(np.median(d)), "p95_mm": float(np.quantile(d, 0.95)), "max_mm": float(d.max()), "points": len(d)}
