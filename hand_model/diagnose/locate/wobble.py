"""How far a joint's second rotation swings and its centre travels, read from the displacements that were fitted to its
markers; how far in the readings, and how surely: `course_amount.py`.

Another axis of the hinge and other places of the markers on their segment explain part of any displacement: what they
could explain is free, and a course over the range is read beside it: half or full waves of a tilt; of a centre an even
or a growing travel, or an ellipse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks, across_axis, share_of_range, way_of_motion

Array = NDArray[np.float64]


def wobble_amplitude(blocks: Blocks, body: int, shift: Array) -> float:
    """Amplitude [rad] of the wave over the joint's range, about one direction of the segment before it or of its own,
    that describes the tilt best.

    body: the segment that the joint carries; shift: (b, m, 3) displacements [m] of all markers, palm frame.
    """
    tilt, angle, u = _tilt(blocks, body, shift), blocks.angle[:, body - 1], share_of_range(blocks, body - 1)
    waves = ([np.sin(np.pi * u)], [np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)])
    _, along = min(
        (_course(tilt, angle, forms, own) for forms in waves for own in (False, True)), key=lambda found: found[0]
    )
    return float(np.linalg.svd(along)[1][0])


def centre_travel(blocks: Blocks, body: int, shift: Array) -> float:
    """Farthest distance [m] from where it began, over the joint's range, of the travelling centre that describes the
    displacement best:
    proportional to the angle, to its square, or along an ellipse. Arguments as in `wobble_amplitude`."""
    moved = _carried(blocks, body, shift)
    angle, u = blocks.angle[:, body - 1], share_of_range(blocks, body - 1)
    at = np.linspace(0, 1, 101)
    forms = (lambda x: [x], lambda x: [x**2], lambda x: [np.sin(np.pi * x), 1 - np.cos(np.pi * x)])
    left = [_course(moved, angle, form(u), False) for form in forms]
    best = min(range(len(forms)), key=lambda i: left[i][0])
    return float(np.linalg.norm(left[best][1] @ np.array(forms[best](at)), axis=0).max())


def possible(blocks: Blocks, body: int, shift: Array) -> bool:
    """Whether a joint may travel and tilt so far: less than its markers are away from it, and than half a right angle.
    Arguments as in `wobble_amplitude`."""
    arm = blocks.position[:, blocks.body == body].mean(1) - blocks.centres[:, body - 1]
    reach = float(np.median(np.linalg.norm(arm, axis=1)))
    return centre_travel(blocks, body, shift) < reach and wobble_amplitude(blocks, body, shift) < np.pi / 4


def side_to_side(blocks: Blocks, body: int, shift: Array, shifts: bool = False) -> float:
    """Half of the tilt [rad] by which a joint's play changes sides with the way of motion, or of the way [m] by which
    it shifts what the joint carries. Arguments as in `wobble_amplitude`."""
    moved = (_carried if shifts else _tilt)(blocks, body, shift)
    _, along = _course(moved, blocks.angle[:, body - 1], [way_of_motion(blocks, body - 1)], False)
    return float(np.linalg.norm(along))


def _carried(blocks: Blocks, body: int, shift: Array) -> Array:
    """Mean displacement (b, 2) [m] of a segment across its joint's axis."""
    return _across(blocks, body, shift[:, blocks.body == body].mean(1))


def _tilt(blocks: Blocks, body: int, shift: Array) -> Array:
    """Rotation (b, 2) [rad] of a segment across its joint's axis, about two directions that turn with the segment
    before it."""
    mine = blocks.body == body
    arm = blocks.position[:, mine] - blocks.position[:, mine].mean(1, keepdims=True)
    inertia = np.einsum("bmi,bmj->bij", arm, arm)
    inertia = np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    turned = np.linalg.solve(inertia, np.cross(arm, shift[:, mine]).sum(1)[..., None])[..., 0]
    return _across(blocks, body, turned)


def _across(blocks: Blocks, body: int, vector: Array) -> Array:
    """Components (b, 2) of vectors (b, 3) across a joint's axis, along two directions that turn with the segment before
    it."""
    return np.stack([np.einsum("bi,bi->b", vector, d) for d in across_axis(blocks, body - 1)], axis=1)


def _course(across: Array, angle: Array, forms: list[Array], own: bool) -> tuple[float, Array]:
    """Sum of squares left of a course (b, 2), and the coefficients (2, forms) along two directions of `forms`, beside
    what is constant before and behind the joint. own: the directions turn with the segment that the joint carries."""
    none, one = np.zeros(len(angle)), np.ones(len(angle))
    cosine, sine = np.cos(angle), np.sin(angle)
    columns = [np.r_[one, none], np.r_[none, one], np.r_[cosine, sine], np.r_[-sine, cosine]]
    columns += [np.r_[f, f] * direction for direction in (columns[2:] if own else columns[:2]) for f in forms]
    matrix, target = np.stack(columns, axis=1), np.r_[across[:, 0], across[:, 1]]
    found = np.linalg.lstsq(matrix, target, rcond=None)[0]
    return float(np.sum((target - matrix @ found) ** 2)), found[4:].reshape(2, len(forms))
