"""Palm frames: from three markers, and the repeatable one from three landmarks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import IdentificationError

Array = NDArray[np.float64]


def palm_rotation(origin: ArrayLike, medial: ArrayLike, lateral: ArrayLike, side: str) -> Array:
    """Rotation (3, 3) whose columns are the palm frame's axes x, y, z, from three points (3,) [m].

    z = (medial - origin) x (lateral - origin) on a left hand, operands swapped on a right one; y = z x ((lateral +
    medial) / 2 - origin); x = y x z, all normalised (thesis eq. 3.1 to 3.3). Raises IdentificationError where the
    points are on one line.
    """
    o, m, lat = (np.asarray(p, float) for p in (origin, medial, lateral))
    z = np.cross(m - o, lat - o) if side == "left" else np.cross(lat - o, m - o)
    if np.linalg.norm(z) < 1e-3 * np.linalg.norm(m - o) * np.linalg.norm(lat - o):
        raise IdentificationError("origin, medial and lateral lie on one line; a frame needs a triangle")
    y = np.cross(z, (lat + m) / 2 - o)
    x = np.cross(y, z)
    return np.stack([v / np.linalg.norm(v) for v in (x, y, z)], axis=1)


def palm_frame(points: ArrayLike, side: str) -> tuple[Array, Array]:
    """Rotation (3, 3) and origin (3,) of the palm frame of points (3, 3): rows origin, medial, lateral."""
    p = np.asarray(points, float)
    return palm_rotation(p[0], p[1], p[2], side), p[0]
