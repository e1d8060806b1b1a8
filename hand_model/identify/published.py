"""The published identification, joint by joint (the thesis): the baseline that the likelihood is compared with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..rotation import kabsch
from .axis import dominant_axis, gamage_lasenby_axis
from .centre import project_on_line, sphere_centre
from .chain import Chain, ChainData

Array = NDArray[np.float64]


def in_parent(data: ChainData, chain: Chain, joint: int) -> Array:
    """Markers (n, m_k, 3) [m] of the segment behind `joint`, turned into the parent segment's frame placed at rest.

    The parent's pose comes from its own markers alone, frame by frame, as published: their noise times the lever arm.
    """
    parent = (data.body == joint) & (np.isfinite(data.position_world[..., 0]).mean(0) > 0.5)
    rotation, translation = kabsch(chain.marker_palm[parent], data.position_world[:, parent])
    shown = np.isfinite(data.position_world[:, parent]).all((1, 2))
    used = (data.body == joint + 1) & np.isfinite(data.position_world[..., 0]).any(0)
    moved = data.position_world[:, used] - translation[:, None]
    return np.where(shown[:, None, None], np.einsum("nji,nmj->nmi", rotation, moved), np.nan)


def published_joint(data: ChainData, chain: Chain, joint: int, probed_palm: Array | None) -> tuple[Array, Array]:
    """Axis (3,) by Gamage & Lasenby, centre (3,) [m] by Chang & Pollard, the probed centre projected on the axis where
    given."""
    markers = in_parent(data, chain, joint)
    axis = gamage_lasenby_axis(markers)
    if axis @ chain.axis_palm[joint] < 0:
        axis = -axis
    centre = sphere_centre(markers)
    return axis, centre if probed_palm is None else project_on_line(probed_palm, axis, centre)


def dominant_joint(data: ChainData, chain: Chain, joint: int, most: int = 200) -> tuple[Array, Array]:
    """Axis (3,) and centre (3,) [m] by Chang & Pollard's dominant-axis method, started from the published estimate."""
    markers = in_parent(data, chain, joint)
    markers = markers[:: max(1, len(markers) // most)]
    axis = gamage_lasenby_axis(markers)
    axis = axis if axis @ chain.axis_palm[joint] > 0 else -axis
    return dominant_axis(markers, axis, sphere_centre(markers))
