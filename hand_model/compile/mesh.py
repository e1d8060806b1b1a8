"""Triangle meshes: capsules as visuals until probed surfaces come, and binary STL with the same bytes for the same
mesh."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from ..rotation import perpendicular_basis
from .plan import Link
from .shape import Capsule

Array = NDArray[np.float64]

ROUND, RINGS = 16, 5  # vertices around a capsule, rings on each of its half balls


def capsule_mesh(capsule: Capsule) -> tuple[Array, NDArray[np.int64]]:
    """Watertight mesh of a capsule: vertices (v, 3) [m], faces (f, 3) counter-clockwise from outside."""
    along = capsule.end - capsule.start
    length = np.linalg.norm(along)
    u = along / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    x, y = perpendicular_basis(u)
    latitude = np.linspace(-np.pi / 2, 0, RINGS + 1)[1:]
    rings = [(capsule.start, a) for a in latitude] + [(capsule.end, -a) for a in latitude[::-1]]
    turn = np.arange(ROUND) * 2 * np.pi / ROUND
    circle = np.outer(np.cos(turn), x) + np.outer(np.sin(turn), y)
    r = capsule.radius
    rows = [centre + r * np.sin(a) * u + r * np.cos(a) * circle for centre, a in rings]
    vertices = np.concatenate([[capsule.start - r * u], *rows, [capsule.end + r * u]])
    faces, last = [], len(vertices) - 1
    for i in range(ROUND):
        j = (i + 1) % ROUND
        faces.append((0, 1 + j, 1 + i))
        for k in range(len(rings) - 1):
            a, b = 1 + k * ROUND, 1 + (k + 1) * ROUND
            faces += [(a + i, a + j, b + j), (a + i, b + j, b + i)]
        top = last - ROUND
        faces.append((last, top + i, top + j))
    return vertices, np.array(faces)


def joined(meshes: list[tuple[Array, NDArray[np.int64]]]) -> tuple[Array, NDArray[np.int64]]:
    """Several meshes as one."""
    offsets = np.cumsum([0, *(len(v) for v, _ in meshes[:-1])])
    return np.concatenate([v for v, _ in meshes]), np.concatenate(
        [f + o for (_, f), o in zip(meshes, offsets, strict=True)]
    )


def link_meshes(link: Link) -> dict[str, tuple[Array, NDArray[np.int64]]]:
    """File name -> mesh of everything that a link shows, and of the convex parts that it collides with."""
    probed = link.surface
    whole = (probed.vertices, probed.faces) if probed else joined([capsule_mesh(shape) for shape in link.solid])
    parts = {f"{link.mesh}_part_{i}.stl": (part.vertices, part.faces) for i, part in enumerate(link.parts)}
    return {f"{link.mesh}.stl": whole, **parts}


def stl(vertices: Array, faces: NDArray[np.int64]) -> bytes:
    """Binary STL [m] of a mesh."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    record = np.zeros(len(faces), dtype=[("f", "<f4", (4, 3)), ("attribute", "<u2")])
    record["f"][:, 0], record["f"][:, 1:] = normal, corners
    return b"\0" * 80 + struct.pack("<I", len(faces)) + record.tobytes()
