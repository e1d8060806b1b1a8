"""What a joint with a course does: its hinge and its extra joints, one after the other, as the angle grows.

A displacement is a motion away from rest in the frame of the segment before the joint (the palm's axes at rest): x ->
rotation x + translation. Joints are applied as MuJoCo applies those of one body: each is carried by those listed before
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .hand import Course, ExtraJoint
from .rotation import rotation_about

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """A joint's whole displacement: rotation (n, 3, 3), translation (n, 3) [m]; axis, centre: (n, 3) of its hinge as
    the extra joints before it carry it; spin (n, 3) [rad/rad] and drift (n, 3) [m/rad]: a point x behind the joint
    moves by spin x (x - centre) + drift per angle."""

    rotation: Array
    translation: Array
    axis: Array
    centre: Array
    spin: Array
    drift: Array


def value(extra: ExtraJoint, angle_rad: Array) -> Array:
    """Coordinate (...) [rad or m] of an extra joint at angles (...) [rad]."""
    return np.polynomial.polynomial.polyval(np.asarray(angle_rad, float), np.asarray(extra.coefficients, float))


def rate(extra: ExtraJoint, angle_rad: Array) -> Array:
    """Its derivative (...) by the angle."""
    derivative = np.polynomial.polynomial.polyder(np.asarray(extra.coefficients, float))
    return np.polynomial.polynomial.polyval(np.asarray(angle_rad, float), derivative)


def listed(course: Course) -> tuple[ExtraJoint | None, ...]:
    """The joints of a body in their order, None for its hinge: what stays with the segment before it comes first."""
    return (None, *course.joints) if course.turning else (*course.joints, None)


def motion(axis: Array, centre: Array, course: Course, angle_rad: Array) -> Motion:
    """Displacement of a joint with its hinge about `axis` (3,) through `centre` (3,) [m] at angles (n,) [rad]."""
    n = len(angle_rad)
    rotation, translation = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    spin, drift = np.zeros((n, 3)), np.zeros((n, 3))
    carried = axis, centre
    for extra in listed(course):
        own = np.asarray(axis if extra is None else extra.axis_palm, float)
        at, speed = (angle_rad, np.ones(n)) if extra is None else (value(extra, angle_rad), rate(extra, angle_rad))
        direction, anchor = rotation @ own, rotation @ centre + translation
        if extra is None:
            carried = direction, anchor
        if extra is not None and extra.kind == "slide":
            drift = drift + speed[:, None] * direction
            translation = translation + at[:, None] * direction
            continue
        spin = spin + speed[:, None] * direction
        drift = drift - speed[:, None] * np.cross(direction, anchor)
        turn = rotation_about(own, at)
        translation = (rotation @ (centre - turn @ centre)[..., None])[..., 0] + translation
        rotation = rotation @ turn
    return Motion(rotation, translation, *carried, spin, drift + np.cross(spin, carried[1]))


def ranges(course: Course, low: float, high: float, samples: int = 401) -> Sequence[tuple[float, float]]:
    """(low, high) [rad or m] of what each extra joint reaches while the angle goes from low to high [rad]."""
    grid = np.linspace(low, high, samples)
    reached = [value(extra, grid) for extra in course.joints]
    return tuple((float(v.min()), float(v.max())) for v in reached)
