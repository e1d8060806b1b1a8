"""Centre of rotation from markers in the parent's frame, as published."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from ..errors import IdentificationError

Array = NDArray[np.float64]


def sphere_centre(position: ArrayLike) -> Array:
    """Common centre (3,) [m] of the spheres on which markers (n, m, 3) [m] move: normalised algebraic fit.

    Each sample gives a |v|^2 + b . v + c = 0 with a and b shared and one c per marker; the normalisation |b|^2 - 4 a c
    = 1, summed over markers, leads to D'D u = lambda C u, whose eigenvector of the smallest positive lambda is taken
    (Pratt's normalisation; Chang & Pollard 2007, J. Biomech. 40, "Constrained least-squares optimization for robust
    estimation of center of rotation", eq. 13 to 17). Raises IdentificationError where the motion determines no centre.
    """
    x = np.asarray(position, float)
    shift = np.nanmean(x, axis=(0, 1))
    scale = np.nanstd(x) + 1e-15
    v = (x - shift) / scale
    n, m, _ = v.shape
    design = np.zeros((n, m, 4 + m))
    design[..., 0] = (v**2).sum(-1)
    design[..., 1:4] = v
    design[:, np.arange(m), 4 + np.arange(m)] = 1.0
    rows = design.reshape(n * m, -1)
    rows = rows[np.isfinite(rows).all(1)]
    constraint = np.zeros((4 + m, 4 + m))
    constraint[1:4, 1:4] = np.eye(3) * m
    constraint[0, 4:] = constraint[4:, 0] = -2.0
    values, vectors = scipy.linalg.eig(rows.T @ rows / len(rows), constraint)
    real = (
        np.isfinite(values)
        & (np.abs(np.imag(values)) < 1e-9 * (1 + np.abs(np.real(values))))
        & (np.real(values) > -1e-12)
    )
    if not real.any():
        raise IdentificationError("the markers' motion determines no centre of rotation; a larger arc is needed")
    best = np.flatnonzero(real)[np.argmin(np.real(values[real]))]
    u = np.real(vectors[:, best])
    if abs(u[0]) < 1e-12 * np.abs(u).max():
        raise IdentificationError("the markers move on a plane as far as their noise shows: no centre of rotation")
    return shift + scale * (-u[1:4] / (2 * u[0]))


def project_on_line(point: ArrayLike, axis: ArrayLike, on_line: ArrayLike) -> Array:
    """The point (3,) of the line through on_line (3,) along the unit axis (3,) that is nearest to `point` (3,)."""
    p, a, c = (np.asarray(v, float) for v in (point, axis, on_line))
    return c + a * (a @ (p - c))
