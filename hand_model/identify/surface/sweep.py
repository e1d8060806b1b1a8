"""Probe sweeps: the tip's path over one segment in the palm frame, freed of outliers and resampled on a grid of
voxels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError
from ...hand import Hand
from ...rotation import kabsch
from ...session import Probe, Session, Trial
from ..probe import tip_and_shaft

Array = NDArray[np.float64]

LEAST_POINTS = 20  # resampled points below which nothing is triangulated
LEAST_NEIGHBOURS = 3  # occupied voxels around one that belongs to a surface rather than to a path beside it
FEW = 0.1  # of the usual number of tips around a tip, within a voxel's edge: with less it is a stray one
OUTLIER = 5.0  # standard deviations off the surface around it
STEP = 0.4  # of a voxel's edge: as far may a point be from where its neighbours expect it, even on a smooth surface


@dataclass(frozen=True)
class Cloud:
    """Points of one surface. points_palm: (n, 3) [m]; normals: (n, 3) unit, away from the segment.

    raw_palm: (m, 3) [m] tips that they are means of; dropped: tips left out as outliers.
    """

    points_palm: Array
    normals: Array
    raw_palm: Array
    dropped: int


def swept(trials: Sequence[Trial], session: Session, probe: Probe, hand: Hand) -> tuple[Array, Array]:
    """Tip positions (n, 3) [m] and shaft directions (n, 3) of all sweeps of one segment, in the hand's palm frame at
    rest.

    Where the segment's own markers are seen as well, its motion from rest is taken out: a probe pushes a finger.
    Raises IdentificationError where no frame shows palm and probe.
    """
    shape = np.stack([hand.palm_markers_palm[label] for label in session.palm.labels])
    tips, shafts = [], []
    for trial in trials:
        tip, shaft = tip_and_shaft(trial, session, probe, shape)
        turn, move = displacement(trial, session, hand, shape)
        tips.append((tip - move) @ turn)
        shafts.append(shaft @ turn)
    return np.concatenate(tips), np.concatenate(shafts)


def displacement(trial: Trial, session: Session, hand: Hand, shape: Array) -> tuple[Array, Array]:
    """Rotation (3, 3) and shift (3,) [m] of the swept segment from rest, median over the trial; none for unseen
    markers."""
    finger, _, name = (trial.segment or "palm").partition("/")
    rest = {j.name: j.markers_palm for j in hand.finger(finger).joints}.get(name, {}) if name else {}
    mocap = trial.mocap()
    if len(rest) < 3 or not set(rest) <= set(mocap.labels):
        return np.eye(3), np.zeros(3)
    rotation, origin = kabsch(shape, mocap.markers(session.palm.labels))
    seen = np.einsum("nji,nmj->nmi", rotation, mocap.markers(list(rest)) - origin[:, None])
    good = np.isfinite(seen).all((1, 2))
    if not good.any():
        return np.eye(3), np.zeros(3)
    return kabsch(np.stack(list(rest.values())), np.median(seen[good], axis=0))


def resampled(tip: Array, shaft: Array, voxel_m: float) -> Cloud:
    """One point per occupied voxel of that edge [m]: the mean of its tips, projected on the quadric through its
    neighbourhood.

    Tips off the surface around them (spikes, the way to and from the segment) are dropped first.
    Raises IdentificationError where too few points remain.
    """
    if not voxel_m > 0:
        raise IdentificationError(f"voxels of {voxel_m * 1e3:g} mm; an edge above zero is needed")
    kept = _on_surface(tip, shaft, voxel_m)
    points, hint = _voxel_means(tip[kept], shaft[kept], voxel_m)
    for group in (_surrounded, _continued):
        part = group(points, hint, voxel_m)
        points, hint = points[part], hint[part]
    if len(points) < LEAST_POINTS:
        raise IdentificationError(
            f"{len(tip)} tips make {len(points)} points {voxel_m * 1e3:g} mm apart, "
            f"too few for a surface ({LEAST_POINTS} or more); sweep longer, or ask for smaller voxels"
        )
    points, normals = _projected(points, hint, tip[kept], voxel_m)
    return Cloud(points, normals, tip[kept], len(tip) - int(kept.sum()))


def _voxel_means(points: Array, shaft: Array, voxel_m: float) -> tuple[Array, Array]:
    """Mean tips (n, 3) [m] and summed shafts (n, 3) of the occupied voxels."""
    cell = np.floor((points - points.min(0)) / voxel_m).astype(int)
    _, index, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    index = index.reshape(-1)
    sums = [np.stack([np.bincount(index, v[:, k]) for k in range(3)], axis=1) for v in (points, shaft)]
    return sums[0] / count[:, None], sums[1]


def _surrounded(points: Array, hint: Array, voxel_m: float) -> NDArray[np.bool_]:
    """Points with neighbours on more than one line, in the largest group that hangs together."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    keep = np.ones(len(points), bool)
    for _ in range(3):  # the ends of a path wear away
        at = np.flatnonzero(keep)
        if len(at) < LEAST_POINTS:
            return keep
        near = cKDTree(points[at]).query_ball_point(points[at], 1.8 * voxel_m)
        flat = []
        for around in near:
            spread = np.linalg.svd(points[at[around]] - points[at[around]].mean(0), compute_uv=False)
            flat.append(len(around) > LEAST_NEIGHBOURS and spread[1] > 0.2 * spread[0])
        if all(flat):
            break
        keep[at[~np.array(flat)]] = False
    at = np.flatnonzero(keep)
    pairs = cKDTree(points[at]).query_pairs(2.2 * voxel_m, output_type="ndarray").reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(at), len(at)))
    _, label = connected_components(graph, directed=False)
    keep[at[label != np.bincount(label).argmax()]] = False
    return keep


def _continued(points: Array, hint: Array, voxel_m: float) -> NDArray[np.bool_]:
    """Points that lie where the quadric through their neighbours expects them: not the last of a path that leaves the
    surface."""
    from scipy.spatial import cKDTree

    keep = np.ones(len(points), bool)
    for _ in range(4):
        at = np.flatnonzero(keep)
        if len(at) < LEAST_POINTS:
            return keep
        _, near = cKDTree(points[at]).query(points[at], k=13)
        off = np.zeros(len(at))
        for i, around in enumerate(near):
            height, _ = _quadric(points[at[around[1:]]], points[at[i]], hint[at[i]], voxel_m)
            off[i] = abs(height(points[at[i]][None])[0])
        limit = max(OUTLIER * 1.4826 * float(np.median(off)), STEP * voxel_m)
        # of neighbours that accuse each other the worst goes first
        worst = (off > limit) & (off >= off[near].max(1))
        if not worst.any():
            break
        keep[at[worst]] = False
    return keep


def _on_surface(tip: Array, shaft: Array, voxel_m: float) -> NDArray[np.bool_]:
    """Tips with others around them, within a few deviations of the quadric through those."""
    from scipy.spatial import cKDTree

    crowd = cKDTree(tip).query_ball_point(tip, voxel_m, return_length=True) - 1
    kept = crowd >= FEW * np.median(crowd)
    kept[kept] = _near_quadric(tip[kept], shaft[kept], voxel_m)
    return kept


def _near_quadric(tip: Array, shaft: Array, voxel_m: float) -> NDArray[np.bool_]:
    from scipy.spatial import cKDTree

    centres, hint = _voxel_means(tip, shaft, voxel_m)
    _, nearest = cKDTree(centres).query(tip)
    tree, off = cKDTree(tip), np.zeros(len(tip))
    near = tree.query_ball_point(centres, 1.5 * voxel_m)
    for i, around in enumerate(near):
        own = np.flatnonzero(nearest == i)
        if len(around) >= 12 and len(own):
            height, _ = _quadric(tip[around], centres[i], hint[i], voxel_m)
            off[own] = height(tip[own])
    scale = 1.4826 * np.median(np.abs(off)) + 1e-9
    return np.abs(off) <= max(OUTLIER * scale, 0.02 * voxel_m)


def _projected(points: Array, hint: Array, tips: Array, voxel_m: float) -> tuple[Array, Array]:
    """Points moved along their normal on the quadric of the tips around, and the unit normals there."""
    from scipy.spatial import cKDTree

    moved, normals = points.copy(), np.zeros_like(points)
    near = cKDTree(tips).query_ball_point(points, 1.5 * voxel_m)
    _, wide = cKDTree(points).query(points, k=12)
    for i, point in enumerate(points):
        around = tips[near[i]] if len(near[i]) >= 12 else points[wide[i]]
        height, normals[i] = _quadric(around, point, hint[i], voxel_m)
        step = float(np.clip(height(point[None])[0], -0.2 * voxel_m, 0.2 * voxel_m))
        moved[i] = point - step * normals[i]
    return moved, normals


def _quadric(around: Array, centre: Array, hint: Array, voxel_m: float):  # type: ignore[no-untyped-def]
    """Height function of points over a robust quadric through `around`, and the plane's normal on the hint's side."""
    local = around - centre
    middle = np.median(local, axis=0)
    _, _, axes = np.linalg.svd(local - middle, full_matrices=False)
    normal = axes[2] if axes[2] @ hint >= 0 else -axes[2]
    frame = np.stack([axes[0], axes[1], normal], axis=1)

    def basis(points: Array) -> tuple[Array, Array]:
        u, v, h = ((points - centre) @ frame / voxel_m).T
        return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1), h

    design, h = basis(around)
    weight, ridge = np.ones(len(h)), 1e-4 * len(h) * np.eye(6)
    for _ in range(5):  # Cauchy weights
        solution = np.linalg.solve(design.T @ (weight[:, None] * design) + ridge, design.T @ (weight * h))
        miss = h - design @ solution
        scale = 1.4826 * np.median(np.abs(miss)) + 1e-6
        weight = 1 / (1 + (miss / (2.4 * scale)) ** 2)

    def height(points: Array) -> Array:
        rows, own = basis(points)
        return (own - rows @ solution) * voxel_m

    slope = frame @ np.array([-solution[1], -solution[2], 1.0])
    return height, slope / np.linalg.norm(slope)
