"""A surface closed to a solid, and the convex parts that stand for it in contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .mend import face_normals, rims
from .triangulate import BALLS, circumradius

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

CLOSED = "closed by the sweep"
UNSWEPT = 0.03  # area share that was not swept from which a surface is called open
LID = "open side closed by a lid"
SHELL_M = 0.002  # m: wall of a surface that is open and that no lid closes
HULL = "convex hull of the points"

CONVEX = 0.95  # share of the vertices that lie on the convex hull, within
NEAR = 0.2  # of the distance of the points: such a solid is taken as convex
CORNERS = 64  # of a convex part
PARTS = 8
VOXELS, PERCENT = 100_000, 5.0  # resolution of V-HACD, volume by which its parts may miss


def volume(vertices: Array, faces: Faces) -> float:
    """Signed volume [m^3] of a closed mesh, positive where faces look outwards."""
    a, b, c = (vertices[faces[:, i]] - vertices.mean(0) for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def closed(vertices: Array, faces: Faces, points: Array, spacing_m: float) -> tuple[Array, Faces, str]:
    """A watertight mesh from a mended surface, and how it was closed.

    In this order: closed already; a fan from the rim's middle, where every face of the surface can be seen from there;
    a shell of 2 mm; the convex hull of points (n, 3) [m], which lie about spacing_m [m] apart.
    """
    loops = rims(faces)
    if len(faces) >= 4:
        if not loops and volume(vertices, faces) > 0:
            bare = _unswept(vertices, faces, BALLS[-1] * spacing_m)
            return vertices, faces, CLOSED if bare <= UNSWEPT else f"{LID} over {100 * bare:.0f} % of the area"
        if len(loops) == 1:
            lid = _lidded(vertices, faces, loops[0])
            if lid is not None:
                return *lid, LID
        if loops:
            shell = _shell(vertices, faces, loops)
            if volume(*shell) > 0:
                return *shell, f"open: a shell of {SHELL_M * 1e3:g} mm behind the surface"
    return *hull(points), HULL


def _unswept(vertices: Array, faces: Faces, ball_m: float) -> float:
    """Area share of triangles that a ball of that radius [m] falls through: nothing was probed within them."""
    area = np.linalg.norm(face_normals(vertices, faces), axis=1)
    return float(area[circumradius(vertices[faces]) > ball_m].sum() / max(area.sum(), 1e-300))


def _lidded(vertices: Array, faces: Faces, loop: list[int]) -> tuple[Array, Faces] | None:
    middle = vertices[loop].mean(0)
    seen = np.einsum("ij,ij->i", face_normals(vertices, faces), vertices[faces].mean(1) - middle)
    if (seen <= 0).any():
        return None
    fan = [(a, b, len(vertices)) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)]
    out = np.concatenate([vertices, middle[None]]), np.concatenate([faces, np.array(fan, np.int64)])
    return out if volume(*out) > 0 else None


def _shell(vertices: Array, faces: Faces, loops: list[list[int]]) -> tuple[Array, Faces]:
    normal = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normal, faces[:, corner], face_normals(vertices, faces))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    n, sides = len(vertices), []
    for loop in loops:
        for a, b in zip(loop, [*loop[1:], loop[0]], strict=True):
            sides += [(a, b, b + n), (a, b + n, a + n)]
    both = np.concatenate([vertices, vertices - SHELL_M * normal])
    return both, np.concatenate([faces, faces[:, ::-1] + n, np.array(sides, np.int64)])


def hull(points: Array, corners: int | None = None) -> tuple[Array, Faces]:
    """Convex hull of points (n, 3) [m], outwards; with `corners`, of the furthest points in that many directions."""
    from scipy.spatial import ConvexHull

    used = points[np.unique(ConvexHull(points).vertices)]
    if corners is not None and len(used) > corners:
        turn = np.arange(corners) + 0.5
        height, angle = 1 - 2 * turn / corners, np.pi * (1 + 5**0.5) * turn
        ring = np.sqrt(1 - height**2)
        directions = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
        # of equal reach in all directions: those of a flat body would all end at its rim
        centred = (used - used.mean(0)) / np.maximum(np.ptp(used, axis=0), 1e-9)
        used = used[np.unique((centred @ directions.T).argmax(0))]
    found = ConvexHull(used)
    faces = found.simplices.astype(np.int64)
    inwards = np.einsum("ij,ij->i", face_normals(used, faces), found.equations[:, :3]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return used, faces


def convex_parts(vertices: Array, faces: Faces, spacing_m: float) -> tuple[tuple[tuple[Array, Faces], ...], str]:
    """Convex meshes that together cover a watertight one, and how they were found.

    One hull where hardly a vertex lies deeper in it than a part of spacing_m [m], the distance of the points that it
    was made from; else the parts of V-HACD (Mamou 2009) where vhacdx is installed; else one hull.
    """
    from scipy.spatial import ConvexHull

    whole = hull(vertices, CORNERS)
    planes = ConvexHull(vertices).equations
    depth = -(vertices @ planes[:, :3].T + planes[:, 3]).max(1)
    if (depth <= NEAR * spacing_m).mean() >= CONVEX:
        return (whole,), "one hull"
    try:
        import vhacdx
    except ImportError:
        return (whole,), "one hull, though the surface is concave: vhacdx is not installed"
    packed = np.hstack([np.full((len(faces), 1), 3), faces]).astype(np.uint32)
    found = vhacdx.compute_vhacd(
        vertices,
        packed,
        maxConvexHulls=PARTS,
        maxNumVerticesPerCH=CORNERS,
        resolution=VOXELS,
        minimumVolumePercentErrorAllowed=PERCENT,
        asyncACD=False,
    )
    parts = []
    for corner, _ in found:
        if np.linalg.matrix_rank(np.asarray(corner) - np.mean(corner, axis=0), tol=1e-5) == 3:
            parts.append(hull(np.asarray(corner, float), CORNERS))
    return (tuple(parts), f"{len(parts)} parts (V-HACD)") if parts else ((whole,), "one hull")
