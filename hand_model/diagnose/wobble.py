"""How far a joint's second rotation swings, read from the displacements that were fitted to its markers.

Another axis of the hinge and other places of the markers on their segment explain part of any displacement: what they could explain is
free, and a half or a full wave over the range is read beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks

Array = NDArray[np.float64]


def wobble_amplitude(blocks: Blocks, body: int, shift: Array) -> float:
    """Amplitude [rad] of the wave over the joint's range, about one direction of the segment before it or of its own, that describes
    the tilt best.

    body: the segment that the joint carries; shift: (b, m, 3) displacements [m] of all markers, palm frame.
    """
    tilt, angle = _tilt(blocks, body, shift), blocks.angle[:, body - 1]
    low, high = np.quantile(angle, [0.005, 0.995])
    u = (angle - low) / max(high - low, 1e-9)
    waves = ([np.sin(np.pi * u)], [np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)])
    return min(_wave(tilt, angle, forms, own) for forms in waves for own in (False, True))[1]


def _tilt(blocks: Blocks, body: int, shift: Array) -> Array:
    """Rotation (b, 2) [rad] of a segment across its joint's axis, about two directions that turn with the segment before it."""
    mine = blocks.body == body
    arm = blocks.position[:, mine] - blocks.position[:, mine].mean(1, keepdims=True)
    inertia = np.einsum("bmi,bmj->bij", arm, arm)
    inertia = np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    turned = np.linalg.solve(inertia, np.cross(arm, shift[:, mine]).sum(1)[..., None])[..., 0]
    axis = blocks.axes[:, body - 1]
    helper = np.eye(3)[np.argmin(np.abs(axis[0]))]
    if body > 1:
        before = blocks.rotation[:, int(np.flatnonzero(blocks.body == body - 1)[0])]
        helper = before @ before[0].T @ helper
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([np.einsum("bi,bi->b", turned, d) for d in (first, np.cross(axis, first))], axis=1)


def _wave(tilt: Array, angle: Array, forms: list[Array], own: bool) -> tuple[float, float]:
    """Sum of squares left of a tilt (b, 2), and the amplitude, of a wave beside rotations that are constant before and behind the joint.
    own: its direction turns with the segment that the joint carries."""
    none, one = np.zeros(len(angle)), np.ones(len(angle))
    cosine, sine = np.cos(angle), np.sin(angle)
    columns = [np.r_[one, none], np.r_[none, one], np.r_[cosine, sine], np.r_[-sine, cosine]]
    across = columns[2:] if own else columns[:2]
    columns += [np.r_[f, f] * direction for direction in across for f in forms]
    matrix, target = np.stack(columns, axis=1), np.r_[tilt[:, 0], tilt[:, 1]]
    found = np.linalg.lstsq(matrix, target, rcond=None)[0]
    along = np.linalg.svd(found[4:].reshape(2, len(forms)))[1][0]
    return float(np.sum((target - matrix @ found) ** 2)), float(along)
