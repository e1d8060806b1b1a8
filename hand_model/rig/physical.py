"""Mass, centre and inertia that a body can have, from inertial parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def physical(p: Array) -> tuple[float, Array, Array]:
    """Mass [kg], centre (3,) [m], inertia about it (3, 3) [kg m2] of parameters (10,), the nearest that a body can
    have.

    Moments that the motion does not show may be contradicted by those it does: they are raised until each principal
    moment is at most the sum of the other two (triangle inequality; Traversaro et al. 2016).
    """
    mass = max(float(p[0]), 1e-6)
    centre = p[1:4] / mass
    about = np.array([[p[4], p[7], p[8]], [p[7], p[5], p[9]], [p[8], p[9], p[6]]])
    inertia = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    level, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    level = np.maximum(level, 1e-9 * max(level.max(), 1e-9))
    excess = level[2] - level[0] - level[1]
    if excess > 0:
        level[:2] += 0.5 * excess * (1 + 1e-9)
    inertia = axes @ np.diag(level) @ axes.T
    return mass, centre, inertia
