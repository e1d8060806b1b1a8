"""Lines and turns in space."""

from __future__ import annotations

import numpy as np

from ..rotation import rotation_about
from .tree import Array, pose


def line_distance(axis_a: Array, point_a: Array, axis_b: Array, point_b: Array) -> tuple[Array, Array]:
    """Angle [rad] (0 to pi/2) between lines (..., 3), and the vector (..., 3) [m] from line b to point_a, across line
    b."""
    next_, last = [1, 2, 0], [2, 0, 1]  # np.cross spends most of its time on checks
    cross = axis_a[..., next_] * axis_b[..., last] - axis_a[..., last] * axis_b[..., next_]
    angle = np.arctan2(np.sqrt((cross * cross).sum(-1)), np.abs((axis_a * axis_b).sum(-1)))
    gap = point_a - point_b
    return angle, gap - (gap * axis_b).sum(-1, keepdims=True) * axis_b


def rotation_angle(rotation: Array) -> Array:
    """Angles (...) [rad] (0 to pi) of rotation matrices (..., 3, 3), exact near zero."""
    odd = rotation - np.swapaxes(rotation, -1, -2)
    twice_sine = np.sqrt((odd * odd).sum((-2, -1)) / 2)
    return np.arctan2(twice_sine, np.trace(rotation, axis1=-2, axis2=-1) - 1)


def about(axis: Array, point: Array, angle: float) -> Array:
    """Transform (4, 4) that turns by angle [rad] about the line through point (3,) [m] along the unit axis (3,)."""
    rotation = rotation_about(axis, angle)
    return pose(rotation, point - rotation @ point)


def foot(vector: Array, direction: Array) -> Array:
    """The vector (3,) [m] from a point to the nearest point of a line along the unit direction (3,), given one to any
    of its points."""
    return vector - (vector @ direction) * direction


def turn_between(axis: Array, start: Array, end: Array) -> float:
    """Turn [rad] about the unit axis (3,) that lays the vector start (3,) over end (3,), seen along the axis; 0 where
    one is parallel to it."""
    s, e = start - (start @ axis) * axis, end - (end @ axis) * axis
    if min(np.linalg.norm(s), np.linalg.norm(e)) < 1e-6:
        return 0.0
    return float(np.arctan2(axis @ np.cross(s, e), s @ e))
