"""A first chain, close enough for the likelihood: rigid clusters, then the fixed axis of each relative motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError
from ..rotation import kabsch
from .chain import Chain, ChainData

Array = NDArray[np.float64]


# Frames that the first guess looks at.
START_FRAMES = 600


def cluster_shape(position: Array, iterations: int = 10) -> Array:
    """Rigid shape (m, 3) [m] of a marker cluster from trajectories (n, m, 3) [m]: robust generalised Procrustes mean.

    The shape sits where the first complete frame has it. Raises IdentificationError where no frame shows all markers.
    """
    complete = np.isfinite(position).all((1, 2))
    if not complete.any():
        raise IdentificationError("no frame shows all markers of a cluster at once")
    frames = position[complete]
    sides = np.linalg.norm(frames[:, :, None] - frames[:, None], axis=-1)
    typical = np.abs(sides - np.median(sides, axis=0)).max((1, 2))
    frames = frames[typical <= np.median(typical) * 3 + 1e-12]
    shape = frames[0]
    for _ in range(iterations):
        rotation, translation = kabsch(frames, shape)
        aligned = np.einsum("nij,nmj->nmi", rotation, frames) + translation[:, None]
        mean = np.median(aligned, axis=0) if len(frames) > 8 else aligned.mean(0)
        if np.abs(mean - shape).max() < 1e-9:
            break
        shape = mean
    return shape


def rotation_vectors(rotation: Array) -> Array:
    """Rotation vectors (n, 3) [rad] of rotation matrices (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_rotvec()


def start_chain(data: ChainData, rest: Array, palm_shape: Array, axis_palm: Array | None = None) -> Chain:
    """Chain estimate from cluster poses.

    data: observations. rest: (r,) frames that define angle zero. palm_shape: (p, 3) [m] palm markers in the palm frame.
    Axis: dominant direction of the relative rotation vectors, or axis_palm (3,) for every joint where it is given.
    Centre: least squares of (I - R) c = t over all frames.
    Raises IdentificationError where a segment never shows with the palm.
    """
    few = np.unique(np.concatenate([rest, np.linspace(0, len(data.position_world) - 1, START_FRAMES).astype(int)]))
    data, rest = data.take(few), np.flatnonzero(np.isin(few, rest))
    palm = data.body == 0
    palm_rotation, palm_translation = kabsch(palm_shape, data.position_world[:, palm])
    shown = np.isfinite(data.position_world[:, palm]).all((1, 2))
    marker = np.empty((len(data.body), 3))
    marker[palm] = palm_shape
    outer_rotation = np.broadcast_to(np.eye(3), palm_rotation.shape)
    outer_translation = np.zeros((len(palm_rotation), 3))
    axes, centres = [], []
    for k in range(1, data.n_joints + 1):
        columns = np.flatnonzero(data.body == k)
        in_palm = np.einsum("nji,nmj->nmi", palm_rotation, data.position_world[:, columns] - palm_translation[:, None])
        good = np.isfinite(in_palm).all((1, 2)) & shown
        if good.sum() < 10:
            names = ", ".join(data.labels[c] for c in columns)
            raise IdentificationError(
                f"markers {names} show together with the palm in {good.sum()} frames; 10 are needed"
            )
        marker[columns] = _rest_shape(in_palm, good, rest)
        rotation, translation = kabsch(marker[columns], in_palm)
        relative = np.swapaxes(outer_rotation, 1, 2) @ rotation
        shift = np.einsum("nji,nj->ni", outer_rotation, translation - outer_translation)
        axis, centre = _hinge(relative[good], shift[good], marker[columns].mean(0), axis_palm)
        axes.append(axis)
        centres.append(centre)
        outer_rotation, outer_translation = rotation, translation
    return Chain(marker, np.stack(axes), np.stack(centres))


def _rest_shape(in_palm: Array, good: Array, rest: Array) -> Array:
    """The cluster's rigid shape (m, 3) placed where it is at rest."""
    shape = cluster_shape(in_palm[good])
    at_rest = np.intersect1d(rest, np.flatnonzero(good))
    target = np.median(in_palm[at_rest], axis=0) if at_rest.size else in_palm[np.flatnonzero(good)[0]]
    rotation, translation = kabsch(shape, target)
    return shape @ rotation.T + translation


def _hinge(rotation: Array, shift: Array, near: Array, given: Array | None) -> tuple[Array, Array]:
    """Axis (3,) and centre (3,) of relative motions x -> R x + t; the centre is the point of the axis nearest to
    `near`."""
    vector = rotation_vectors(rotation)
    size = np.linalg.norm(vector, axis=1)
    kept = size <= np.quantile(size, 0.98)
    axis = np.linalg.eigh(vector[kept].T @ vector[kept])[1][:, -1] if given is None else given
    if np.median(vector @ axis) < 0:  # flexion is positive and starts from the open hand
        axis = -axis
    lever = np.eye(3) - rotation
    weight = np.ones(len(rotation))
    for _ in range(5):
        normal = np.einsum("n,nji,njk->ik", weight, lever, lever)
        pinned = np.outer(axis, axis) * (np.trace(normal) + 1e-12)  # nothing is known along the axis
        centre = np.linalg.solve(normal + pinned, np.einsum("n,nji,nj->i", weight, lever, shift) + pinned @ near)
        miss = np.linalg.norm(np.einsum("nij,j->ni", lever, centre) - shift, axis=1)
        weight = 1 / (1 + (miss / (2 * np.median(miss) + 1e-12)) ** 2)
    return axis, centre + axis * (axis @ (near - centre))


def other_starts(data: ChainData, rest: Array, palm_shape: Array, first: Chain) -> list[Chain]:
    """Further starting chains for arcs so short that noise hides their axis: parallel joints along each axis already
    guessed and along the palm's own directions."""
    return [start_chain(data, rest, palm_shape, axis) for axis in (*first.axis_palm, *np.eye(3))]
