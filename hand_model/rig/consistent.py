"""Inertial parameters that bodies can have: least squares over pseudo-inertias that are positive definite.

A body is physical exactly when its 4 x 4 pseudo-inertia is positive definite (Wensing, Kim & Slotine 2018); its
Cholesky factor has no constraint but positive diagonals, and those are exponentials (Rucker & Wensing 2022).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .balance import Column
from .dynamics import INERTIAL
from .physical import physical

Array = NDArray[np.float64]
LOWER = np.tril_indices(4)
AT = {"hx": (3, 0), "hy": (3, 1), "hz": (3, 2), "Ixy": (1, 0), "Ixz": (2, 0), "Iyz": (2, 1)}
LEAST = 1e-9  # smallest share of a body's own size that its pseudo-inertia is started from


def pseudo_inertia(p: Array) -> Array:
    """Pseudo-inertia (4, 4) of parameters (10,): second moments, first moments, mass."""
    about = np.array([[p[4], p[7], p[8]], [p[7], p[5], p[9]], [p[8], p[9], p[6]]])
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(about) * np.eye(3) - about
    out[3, :3] = out[:3, 3] = p[1:4]
    out[3, 3] = p[0]
    return out


def parameters(pseudo: Array) -> Array:
    """Parameters (10,) of a pseudo-inertia (4, 4)."""
    second = pseudo[:3, :3]
    about = np.trace(second) * np.eye(3) - second
    return np.array([pseudo[3, 3], *pseudo[3, :3], *np.diag(about), about[0, 1], about[0, 2], about[1, 2]])


LINEAR = np.array([parameters(e.reshape(4, 4)) for e in np.eye(16)])  # (16, 10): parameters are linear in it


def is_physical(p: Array) -> bool:
    """Whether a body can have parameters (10,), to the precision of floating point."""
    level = np.linalg.eigvalsh(pseudo_inertia(p))
    return bool(level[0] >= -1e-12 * max(level[-1], 1e-300))


def consistent(columns: Sequence[Column], declared: Array, theta: Array, gram: Array, moment: Array, low: Array,
               high: Array, mean: Array, weight: Array) -> Array:  # fmt: skip
    """theta (P + J,) again, or, where a body of it cannot exist, the least-squares solution over bodies that can.

    declared (bodies, 10): parameters as declared (what is zero there and no column stays zero), in the order in which
    bodies first appear in columns; all others as in `solve_bounded`.
    """
    from scipy.optimize import least_squares

    bodies = list(dict.fromkeys(c.name for c in columns if c.kind == "inertial"))
    index = {(c.name, c.part): i for i, c in enumerate(columns) if c.kind == "inertial"}
    own = [np.array([index.get((b, part), -1) for part in INERTIAL]) for b in bodies]
    full = [np.where(i >= 0, theta[i], d) for i, d in zip(own, declared, strict=True)]
    if all(is_physical(p) for p in full):
        return theta
    inertial = np.unique(np.concatenate([i[i >= 0] for i in own]))
    rest = np.setdiff1d(np.arange(len(theta)), inertial)
    h, g = gram + np.diag(weight), moment + weight * mean
    unit = 1.0 / np.sqrt(np.maximum(np.diag(h), 1e-300))
    level, axes = np.linalg.eigh(h * unit[:, None] * unit)
    root = np.sqrt(np.maximum(level, 1e-14 * level[-1]))
    matrix, target = (root[:, None] * axes.T) / unit, (axes.T @ (g * unit)) / root
    start, masks = [], []
    for p, at in zip((_nearest(d) for d in declared), own, strict=True):
        factor = np.linalg.cholesky(pseudo_inertia(p))
        mask = np.abs(factor) > 1e-9 * np.abs(factor).max()
        np.fill_diagonal(mask, True)
        for part, place in AT.items():
            mask[place] |= at[INERTIAL.index(part)] >= 0
        masks.append(mask[LOWER])
        values = factor.copy()
        np.fill_diagonal(values, np.log(np.diag(factor)))
        start.append(values[LOWER][masks[-1]])
    sizes = np.cumsum([0] + [len(s) for s in start])

    def factor_of(x: Array, k: int) -> Array:
        values = np.zeros(10)
        values[masks[k]] = x
        factor = np.zeros((4, 4))
        factor[LOWER] = values
        np.fill_diagonal(factor, np.exp(np.clip(np.diag(factor), -40, 20)))
        return factor

    def body(x: Array, k: int) -> Array:
        factor = factor_of(x, k)
        return parameters(factor @ factor.T)

    def body_slope(x: Array, k: int) -> Array:
        """d body / d x (10, len(x)): each entry of the factor changes one row of it."""
        factor = factor_of(x, k)
        unit = np.zeros((len(x), 4, 4))
        row, column = LOWER[0][masks[k]], LOWER[1][masks[k]]
        unit[np.arange(len(x)), row, column] = np.where(row == column, factor[row, column], 1.0)
        half = unit @ factor.T
        return (half + np.swapaxes(half, 1, 2)).reshape(-1, 16).dot(LINEAR).T

    def whole(x: Array) -> Array:
        out = np.zeros(len(theta))
        for k, i in enumerate(own):
            out[i[i >= 0]] = body(x[sizes[k] : sizes[k + 1]], k)[i >= 0]
        out[rest] = x[sizes[-1] :] * unit[rest]
        return out

    def slope(x: Array) -> Array:
        out = np.zeros((len(theta), len(x)))
        for k, i in enumerate(own):
            out[i[i >= 0], sizes[k] : sizes[k + 1]] = body_slope(x[sizes[k] : sizes[k + 1]], k)[i >= 0]
        out[rest, sizes[-1] + np.arange(len(rest))] = unit[rest]
        return matrix @ out

    x0 = np.concatenate([*start, np.clip(theta[rest], low[rest], high[rest]) / unit[rest]])
    bound = np.full(sizes[-1], np.inf)
    lows, highs = np.concatenate([-bound, low[rest] / unit[rest]]), np.concatenate([bound, high[rest] / unit[rest]])
    x0 = np.clip(x0, lows + 1e-9 * (np.abs(lows) < np.inf), highs)
    found = least_squares(lambda x: matrix @ whole(x) - target, x0, slope, bounds=(lows, highs), x_scale="jac",
                          max_nfev=300, xtol=1e-10, ftol=1e-9, gtol=1e-12)  # fmt: skip
    return whole(found.x)


def _nearest(p: Array) -> Array:
    """The nearest physical parameters (10,) to declared ones, well inside."""
    mass, centre, inertia = physical(p)
    about = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    about = about + LEAST * np.trace(about) * np.eye(3)
    return np.array([mass, *(mass * centre), *np.diag(about), about[0, 1], about[0, 2], about[1, 2]])
