"""Axis of rotation from markers in the parent's frame, as published."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import IdentificationError

Array = NDArray[np.float64]


def gamage_lasenby_axis(position: ArrayLike) -> Array:
    """Axis (3,) unit, sign arbitrary, of markers (n, m, 3) that turn about a fixed line; frames with gaps are left out
    per marker.

    Smallest singular vector of sum over markers of E[v v'] - E[v] E[v]' (Gamage & Lasenby 2002, J. Biomech. 35, eq. 8).
    Raises IdentificationError where fewer than three frames show a marker.
    """
    x = np.asarray(position, float)
    total = np.zeros((3, 3))
    for marker in np.moveaxis(x, 1, 0):
        seen = marker[np.isfinite(marker).all(1)]
        if len(seen) < 3:
            raise IdentificationError(f"a marker is seen in {len(seen)} frames; an axis needs three")
        total += np.cov(seen.T, bias=True)
    return np.linalg.svd(total)[2][-1]


def dominant_axis(position: ArrayLike, start_axis: ArrayLike, start_centre: ArrayLike) -> tuple[Array, Array]:
    """Axis (3,) and centre (3,) of the cylinders on which markers (n, m, 3) [m] move: planar plus radial cost.

    Minimises over axis a, point c, and per marker the plane height and the radius, the squared distance of every sample
    from its circle: (a . (v - c) - h)^2 + (|v - c - a a.(v - c)| - r)^2 (Chang & Pollard 2007, J. Biomech. 40, "Robust
    estimation of dominant axis of rotation", eq. 3 to 8). Heights and radii are eliminated (they are means). Starts
    near start_axis [-], start_centre [m]; the centre returned is the point of the axis nearest to start_centre.
    """
    from scipy.optimize import least_squares

    from ..rotation import perpendicular_basis, rotation_from_vector

    x = np.asarray(position, float)
    axis0, centre0 = np.asarray(start_axis, float), np.asarray(start_centre, float)
    basis = perpendicular_basis(axis0)
    scale = np.nanstd(x) + 1e-12

    def place(step: Array) -> tuple[Array, Array]:
        axis = rotation_from_vector(np.cross(axis0, step[:2] @ basis)) @ axis0
        return axis, centre0 + scale * step[2:] @ basis

    def residual(step: Array) -> Array:
        axis, centre = place(step)
        arm = x - centre
        height = arm @ axis
        radius = np.linalg.norm(arm - height[..., None] * axis, axis=-1)
        planar, radial = height - np.nanmean(height, axis=0), radius - np.nanmean(radius, axis=0)
        return np.nan_to_num(np.concatenate([planar.ravel(), radial.ravel()])) / scale

    solution = least_squares(residual, np.zeros(4), x_scale="jac")
    axis, centre = place(solution.x)
    return axis, centre + axis * (axis @ (centre0 - centre))
