"""How far points are from a mesh, as the three figures by which a surface is judged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

CANDIDATES = 40  # nearest triangles, by their middles, that are looked at first
CHUNK = 400_000  # pairs of point and triangle at a time


def distance_to_mesh(points: ArrayLike, vertices: Array, faces: Faces) -> Array:
    """Distance (n,) [m] of points (n, 3) from the nearest triangle of a mesh: (v, 3) [m], (f, 3)."""
    from scipy.spatial import cKDTree

    p, corners = np.asarray(points, float).reshape(-1, 3), vertices[faces]
    middle = corners.mean(1)
    reach = np.linalg.norm(corners - middle[:, None], axis=-1).max()
    count = min(CANDIDATES, len(faces))
    far, near = cKDTree(middle).query(p, k=np.arange(1, count + 1))
    found = _in_chunks(p, corners[near], count)
    # a face beyond the candidates may be nearer only where the last candidate's middle is not far enough away
    unsure = np.flatnonzero(found > far[:, -1] - reach) if count < len(faces) else np.zeros(0, int)
    found[unsure] = _in_chunks(p[unsure], np.broadcast_to(corners, (len(unsure), *corners.shape)), len(faces))
    return found


def _in_chunks(points: Array, triangles: Array, count: int) -> Array:
    """Distance (n,) of points (n, 3) from the nearest of their own triangles (n, count, 3, 3)."""
    step = max(1, CHUNK // max(count, 1))
    parts = [
        _to_triangles(points[i : i + step, None], triangles[i : i + step]).min(1) for i in range(0, len(points), step)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _to_triangles(p: Array, triangle: Array) -> Array:
    """Distances of points (..., 3) from triangles (..., 3, 3): of the foot within the triangle, else of the nearest
    edge."""
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
    return {
        "median_mm": float(np.median(d)),
        "p95_mm": float(np.quantile(d, 0.95)),
        "max_mm": float(d.max()),
        "points": len(d),
    }
