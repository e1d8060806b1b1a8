"""Flat triangles bent to the curvature that the normals at their corners tell: a coarse grid then no longer cuts
corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .mend import directed_edges

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

# cosine of the angle between the normals at an edge's ends from which the edge stays straight: a true ridge, or noise
BEND = 0.5


def refined(vertices: Array, faces: Faces, normals: Array) -> tuple[Array, Faces]:
    """Every face cut in four; the new vertices lie on the cubics through their edges (PN triangles, Vlachos et al.
    2001).

    vertices: (v, 3) [m], faces: (f, 3), normals: (v, 3) unit, outward. What was closed stays closed.
    """
    edges, index = np.unique(np.sort(directed_edges(faces), axis=1), axis=0, return_inverse=True)
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    at_a, at_b = normals[edges[:, 0]], normals[edges[:, 1]]
    along = b - a
    rise = ((along * at_a).sum(1, keepdims=True) * at_a - (along * at_b).sum(1, keepdims=True) * at_b) / 8
    smooth = (at_a * at_b).sum(1, keepdims=True) > BEND
    middle = (a + b) / 2 - np.where(smooth, rise, 0.0)
    one, two, three = index.reshape(3, -1) + len(vertices)  # on the edges 0-1, 1-2, 2-0 of every face
    p, q, r = faces.T
    cut = [np.stack(corner, axis=1) for corner in ((p, one, three), (one, q, two), (three, two, r), (one, two, three))]
    return np.concatenate([vertices, middle]), np.concatenate(cut).astype(np.int64)
