"""Points to triangles: ball pivoting by Open3D where it is installed, Delaunay carving where it is not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import MissingDependencyError
from .distance import distance_to_mesh

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

BALLS = (0.75, 1.0, 1.5, 2.0, 3.0)  # radii of the ball over the distance of the points
COVERED = 0.95  # share of the points that must lie on the surface, within
NEAR = 0.25  # of their distance
FACING = 0.9  # share of the probed faces that must look away from the segment

FILLINGS = 20  # rounds of filling where a carved solid touches itself

PIVOTING = "ball pivoting (Open3D)"
CARVING = "Delaunay carving"
HEIGHT_FIELD = "height field over the plane of the points"


def has_open3d() -> bool:
    """Whether the extra for ball pivoting (`pip install hand_model[surface]`) is there and loads."""
    try:
        import open3d  # noqa: F401
    except (ImportError, OSError):  # OSError: a system library that it needs (libEGL, libGL, libX11, libusb) is missing
        return False
    return True


def triangulated(points: Array, normals: Array, spacing_m: float, pivoting: bool | None = None) -> tuple[Faces, str]:
    """Faces (f, 3) over points (n, 3) [m] with outward unit normals (n, 3), and the method's name.

    spacing_m: distance of the points [m]. pivoting: ball pivoting (Bernardini et al. 1999); None: if Open3D is
    installed.
    Raises MissingDependencyError where it is asked for and Open3D is not installed.
    """
    available = has_open3d() if pivoting is not False else False
    if pivoting and not available:
        raise MissingDependencyError(
            "ball pivoting needs Open3D: pip install 'hand_model[surface]' (on a bare Linux also libegl1, libgl1, "
            "libx11-6, libusb-1.0-0); without it surfaces come from the built-in Delaunay carving"
        )
    if available:
        return _pivoted(points, normals, spacing_m), PIVOTING
    for ball in (*BALLS[2:], 4.0, 6.0, 10.0):
        faces = carved(points, ball * spacing_m)
        if len(faces) and (distance_to_mesh(points, points, faces) <= NEAR * spacing_m).mean() >= COVERED:
            probed = faces[circumradius(points[faces]) <= BALLS[-1] * spacing_m]
            if _facing(points, probed, normals) >= FACING:
                return faces, f"{CARVING}, ball of {ball * spacing_m * 1e3:.1f} mm"
    return _height_field(points, normals, BALLS[-1] * spacing_m), HEIGHT_FIELD


def _pivoted(points: Array, normals: Array, spacing_m: float) -> Faces:
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.normals = open3d.utility.Vector3dVector(normals)
    radii = open3d.utility.DoubleVector([ball * spacing_m for ball in BALLS])
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        mesh = open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
    return _back_to(points, np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64))


def _back_to(points: Array, vertices: Array, faces: Faces) -> Faces:
    """Faces by the numbers of `points`, whatever order a library keeps its vertices in."""
    from scipy.spatial import cKDTree

    return cKDTree(points).query(vertices)[1][faces] if len(faces) else faces.reshape(0, 3)


def carved(points: Array, radius_m: float) -> Faces:
    """Boundary of the Delaunay tetrahedra that a ball of that radius [m] cannot reach from outside.

    The ball passes a triangle whose circumcircle is wider than it (alpha shape, Edelsbrunner & Mücke 1994, of the
    outside only). Faces (f, 3) enclose a solid, counter-clockwise from outside.
    """
    from scipy.spatial import Delaunay, QhullError

    try:
        mesh = Delaunay(points)
    except QhullError:
        return np.zeros((0, 3), np.int64)
    corners = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    opposite = mesh.simplices[:, corners].astype(np.int64)  # (t, 4, 3): face k lies opposite vertex k
    gate = circumradius(points[opposite]) > radius_m
    outside = np.zeros(len(opposite) + 1, bool)
    outside[-1] = True  # neighbour -1: beyond the hull
    while True:
        reached = (gate & outside[mesh.neighbors]).any(1) & ~outside[:-1]
        if not reached.any():
            break
        outside[:-1] |= reached
    for _ in range(FILLINGS):
        wall = outside[mesh.neighbors] & ~outside[:-1, None]
        filling = outside[:-1] & _touching(mesh.simplices, opposite[wall])
        if not filling.any():
            break
        outside[:-1] &= ~filling
    wall = outside[mesh.neighbors] & ~outside[:-1, None]
    faces = opposite[wall]
    inner = points[np.broadcast_to(mesh.simplices[:, :, None], wall.shape + (1,))[wall][:, 0]]
    a, b, c = (points[faces[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), inner - a) > 0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces


def _touching(tetrahedra: Faces, faces: Faces) -> NDArray[np.bool_]:
    """Tetrahedra (t, 4) at an edge along which more than two of the faces (f, 3) meet: filled, the solid no longer
    touches itself there."""
    edges, count = np.unique(
        np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    hit = np.zeros(len(tetrahedra), bool)
    for a, b in edges[count > 2]:
        hit |= (tetrahedra == a).any(1) & (tetrahedra == b).any(1)
    return hit


def circumradius(triangle: Array) -> Array:
    """Circumradius (...) [m] of triangles (..., 3, 3) [m]."""
    a, b, c = (np.linalg.norm(triangle[..., i, :] - triangle[..., j, :], axis=-1) for i, j in ((0, 1), (1, 2), (2, 0)))
    twice = np.linalg.norm(
        np.cross(triangle[..., 1, :] - triangle[..., 0, :], triangle[..., 2, :] - triangle[..., 0, :]), axis=-1
    )
    return a * b * c / np.maximum(2 * twice, 1e-300)


def _facing(points: Array, faces: Faces, normals: Array) -> float:
    """Area share of the faces that look to the side where the normals of their vertices point."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    agree = np.einsum("ij,ij->i", area, normals[faces].sum(1)) > 0
    size = np.linalg.norm(area, axis=1)
    return float(size[agree].sum() / max(size.sum(), 1e-300))


def _height_field(points: Array, normals: Array, longest_m: float) -> Faces:
    """Delaunay triangles over the plane across the mean normal, without those of longer circumradius [m]."""
    from scipy.spatial import Delaunay, QhullError

    from ...rotation import perpendicular_basis

    up = normals.mean(0)
    if np.linalg.norm(up) < 1e-6:
        return np.zeros((0, 3), np.int64)
    flat = points @ perpendicular_basis(up / np.linalg.norm(up)).T
    try:
        faces = Delaunay(flat).simplices.astype(np.int64)
    except QhullError:
        return np.zeros((0, 3), np.int64)
    return faces[circumradius(points[faces]) <= longest_m]
