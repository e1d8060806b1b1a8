"""Forward kinematics of a Hand by products of rotations about fixed lines, vectorised over poses, with Jacobians.

At rest every segment frame is the palm frame moved to its joint's centre, so that a segment's *displacement* (its
motion from rest) and its *pose* share one rotation. Source: product of exponentials, Brockett 1984; Lynch & Park 2017,
eq. 4.14.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .course import motion
from .errors import HandModelError
from .hand import Finger, Hand
from .rotation import rotation_about

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Displacement:
    """Motion of each segment of a finger away from rest, in the palm frame: x -> rotation x + translation.

    rotation: (n, k, 3, 3). translation: (n, k, 3) [m]. axis_palm, centre_palm: (n, k, 3) of every joint as it is
    carried by the segments before it [-], [m]. spin_palm (n, k, 3) [rad/rad], drift_palm (n, k, 3) [m/rad]: how what a
    joint carries turns, and how its centre moves, per angle: the axis and zero, but for a joint with a course.
    """

    rotation: Array
    translation: Array
    axis_palm: Array
    centre_palm: Array
    spin_palm: Array
    drift_palm: Array

    def points(self, segment: int, rest_palm: ArrayLike) -> Array:
        """Positions (n, m, 3) [m] of points that are at rest_palm (m, 3) [m] on one segment of the open hand."""
        rest = np.asarray(rest_palm, float).reshape(-1, 3)
        return rest @ self.rotation[:, segment].swapaxes(-1, -2) + self.translation[:, segment, None]

    def point_jacobian(self, segment: int, rest_palm: ArrayLike) -> Array:
        """Derivative (n, m, 3, k) [m/rad] of `points` by the k joint angles; columns of joints further out are zero."""
        position = self.points(segment, rest_palm)
        lever = position[:, :, None] - self.centre_palm[:, None]
        columns = np.cross(self.spin_palm[:, None], lever) + self.drift_palm[:, None]
        columns[:, :, segment + 1 :] = 0.0
        return columns.swapaxes(-1, -2)

    def rotation_jacobian(self, segment: int) -> Array:
        """Angular velocity (n, 3, k) [rad/rad] in the palm frame of one segment per joint rate."""
        columns = self.spin_palm.copy()
        columns[:, segment + 1 :] = 0.0
        return columns.swapaxes(-1, -2)


def displace(finger: Finger, angles_rad: ArrayLike) -> Displacement:
    """Motion of the segments of one finger.

    angles_rad: (n, k) or (k,) [rad], palm outwards, zero at rest. Raises HandModelError on another number of joints.
    """
    angles = np.atleast_2d(np.asarray(angles_rad, float))
    k = len(finger.joints)
    if angles.ndim != 2 or angles.shape[1] != k:
        raise HandModelError(
            f'finger "{finger.name}" has {k} joints; angles of shape (n, {k}) are needed, not {angles.shape}'
        )
    n = len(angles)
    rotation, translation = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    parts: tuple[list[Array], ...] = ([], [], [], [], [], [])
    for joint, angle in zip(finger.joints, angles.T, strict=True):
        axis, centre = unit(joint.axis_palm), np.asarray(joint.centre_palm, float)
        if joint.course is None:
            turn = rotation_about(axis, angle)
            shift = centre - turn @ centre
            carried = [rotation @ axis, rotation @ centre + translation, rotation @ axis, np.zeros((n, 3))]
        else:
            own = motion(axis, centre, joint.course, angle)
            turn, shift = own.rotation, own.translation
            moved = (rotation @ own.centre[..., None])[..., 0] + translation
            carried = [(rotation @ v[..., None])[..., 0] for v in (own.axis, own.centre, own.spin, own.drift)]
            carried[1] = moved
        translation = (rotation @ shift[..., None])[..., 0] + translation
        rotation = rotation @ turn
        for part, values in zip(parts, [rotation, translation, *carried], strict=True):
            part.append(values)
    return Displacement(*(np.stack(part, axis=1) for part in parts))


def unit(axis: ArrayLike) -> Array:
    """The axis (3,) at length one; raises HandModelError where it has none."""
    v = np.asarray(axis, float)
    length = np.linalg.norm(v)
    if not (np.isfinite(length) and length > 1e-9):
        raise HandModelError(f"a joint axis is {v.tolist()}; a vector of length above zero is needed")
    return v / length


def joint_keys(hand: Hand) -> tuple[tuple[str, str], ...]:
    """(finger, joint) of every joint, in the order of the columns of `hand_points`."""
    return tuple((finger.name, joint.name) for finger in hand.fingers for joint in finger.joints)


def hand_points(hand: Hand, angles_rad: ArrayLike) -> tuple[Mapping[tuple[str, str], Array], Mapping[str, Array]]:
    """Marker and tip positions of a whole hand in the palm frame.

    angles_rad: (n, joints) [rad] in the order of `joint_keys`. Returns ({(finger, label): (n, 3)}, {finger: tip (n,
    3)}) [m].
    """
    angles = np.atleast_2d(np.asarray(angles_rad, float))
    if angles.shape[1] != len(joint_keys(hand)):
        raise HandModelError(f"the hand has {len(joint_keys(hand))} joints; angles of shape (n, that) are needed")
    markers: dict[tuple[str, str], Array] = {}
    tips: dict[str, Array] = {}
    start = 0
    for finger in hand.fingers:
        motion = displace(finger, angles[:, start : start + len(finger.joints)])
        start += len(finger.joints)
        for i, joint in enumerate(finger.joints):
            if joint.markers_palm:
                position = motion.points(i, list(joint.markers_palm.values()))
                markers.update({(finger.name, label): position[:, j] for j, label in enumerate(joint.markers_palm)})
            if joint.tip_palm is not None:
                tips[finger.name] = motion.points(i, joint.tip_palm)[:, 0]
    return markers, tips


def finger_angles(finger: Finger, driver_rad: Mapping[str, ArrayLike]) -> Array:
    """All joint angles (n, k) [rad] of a finger from those of its drivers, through its couplings.

    driver_rad: joint -> (n,) [rad]; joints that are neither given nor coupled stay at zero.
    Raises HandModelError where couplings form a circle.
    """
    known = {name: np.atleast_1d(np.asarray(angle, float)) for name, angle in driver_rad.items()}
    coupling = {c.follower: c for c in finger.couplings}

    def angle(name: str, path: Sequence[str] = ()) -> Array:
        if name in path:
            raise HandModelError(f'couplings of finger "{finger.name}" form a circle: {" -> ".join([*path, name])}')
        if name in coupling:
            return coupling[name].follower_rad(angle(coupling[name].driver, [*path, name]))
        return known.get(name, np.zeros(1))

    return np.stack(np.broadcast_arrays(*(angle(joint.name) for joint in finger.joints)), axis=-1)
