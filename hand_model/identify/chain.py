"""The kinematic chain of one finger with its markers: what it predicts, and the derivatives of that.

Shared by all frames: marker positions, joint axes and centres, all at rest (every angle zero) in the palm frame.
Per frame: palm pose and joint angles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..course import motion
from ..hand import Course
from ..rotation import kabsch, perpendicular_basis, rotation_about, rotation_from_vector, skew
from ..session import Finger

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ChainData:
    """Marker observations of one finger.

    position_world: (n, m, 3) [m], nan where missing. body: (m,) 0 for the palm, k for the segment behind joint k.
    labels: (m,) marker labels; a marker that slipped has one column per epoch.
    """

    position_world: Array
    body: NDArray[np.int64]
    labels: tuple[str, ...]

    @property
    def n_joints(self) -> int:
        """Number of hinges."""
        return int(self.body.max())

    def take(self, frames: Array) -> ChainData:
        """The observations of some frames."""
        return ChainData(self.position_world[frames], self.body, self.labels)

    def thinned(self, most: int) -> ChainData:
        """At most that many frames, evenly spread."""
        return self.take(np.unique(np.linspace(0, len(self.position_world) - 1, most).astype(int)))


@dataclass(frozen=True)
class Chain:
    """What all frames share, at rest. marker_palm: (m, 3) [m]. axis_palm: (k, 3) unit. centre_palm: (k, 3) [m].
    courses: (k,) of joints that are no plain hinges; empty where all are."""

    marker_palm: Array
    axis_palm: Array
    centre_palm: Array
    courses: tuple[Course | None, ...] = ()

    @property
    def tangent(self) -> Array:
        """(k, 2, 3) directions in which each axis tilts and each centre shifts."""
        return np.stack([perpendicular_basis(axis) for axis in self.axis_palm])

    @property
    def size(self) -> int:
        """Number of shared unknowns: three per marker, four per joint."""
        return 3 * len(self.marker_palm) + 4 * len(self.axis_palm)

    def moved(self, step: Array) -> Chain:
        """The chain after a step (3 m + 4 k,): marker shifts [m], then per joint two tilts [rad] and two shifts [m]."""
        m = len(self.marker_palm)
        joint = step[3 * m :].reshape(-1, 4)
        tilt = np.einsum("ki,kij->kj", joint[:, :2], self.tangent)
        shift = np.einsum("ki,kij->kj", joint[:, 2:], self.tangent)
        axis = np.einsum("kij,kj->ki", rotation_from_vector(np.cross(self.axis_palm, tilt)), self.axis_palm)
        return Chain(self.marker_palm + step[: 3 * m].reshape(m, 3), axis, self.centre_palm + shift, self.courses)

    def course(self, k: int) -> Course | None:
        """What joint k does beside turning about its hinge."""
        return self.courses[k] if self.courses else None

    def at(self, angle_rad: Array, body: Array) -> Chain:
        """The chain (of plain hinges) with its zero moved to the joint angles (k,) [rad]: the same mechanism, that pose
        called rest."""
        x, _, joints = propagate(self, body, np.asarray(angle_rad, float)[None])
        return Chain(x[0], np.stack([a[0] for a, _ in joints]), np.stack([c[0] for _, c in joints]))


@dataclass(frozen=True)
class Pose:
    """Per frame: rotation (n, 3, 3) and translation (n, 3) [m] palm to world, angle_rad (n, k)."""

    rotation: Array
    translation: Array
    angle_rad: Array

    def take(self, frames: Array) -> Pose:
        """The poses of some frames."""
        return Pose(self.rotation[frames], self.translation[frames], self.angle_rad[frames])

    def put(self, frames: Array, poses: Pose) -> None:
        """Overwrite the poses of some frames."""
        for name in ("rotation", "translation", "angle_rad"):
            getattr(self, name)[frames] = getattr(poses, name)

    def to_palm(self, position_world: Array) -> Array:
        """World positions (n, m, 3) [m] expressed in the palm frame."""
        return np.einsum("nji,nmj->nmi", self.rotation, position_world - self.translation[:, None])

    def to_world(self, position_palm: Array) -> Array:
        """Palm-frame positions (n, m, 3) [m] expressed in the world frame."""
        return np.einsum("nij,nmj->nmi", self.rotation, position_palm) + self.translation[:, None]

    def moved(self, step: Array) -> Pose:
        """The poses after steps (n, 6 + k): translation and rotation in the palm frame, joint angles."""
        translation = self.translation + np.einsum("nij,nj->ni", self.rotation, step[:, :3])
        return Pose(self.rotation @ rotation_from_vector(step[:, 3:6]), translation, self.angle_rad + step[:, 6:])


def marker_body(finger: Finger) -> NDArray[np.int64]:
    """(m,) body of each marker: three of the palm, then those of the finger's segments, palm outwards."""
    return np.array([0, 0, 0] + [k + 1 for k, segment in enumerate(finger.segments) for _ in segment.markers])


def propagate(chain: Chain, body: Array, angle_rad: Array) -> tuple[Array, Array, list[tuple[Array, Array]]]:
    """Forward kinematics: markers (n, m, 3), body rotations (n, k + 1, 3, 3), per joint its moved axis and centre (n,
    3).

    angle_rad: (n, k). All in the palm frame, lengths in metres.
    """
    n = len(angle_rad)
    rotations = [np.broadcast_to(np.eye(3), (n, 3, 3))]
    offset = np.zeros((n, 3))
    x = np.empty((n, len(body), 3))
    joints = []
    for k in range(len(chain.axis_palm) + 1):
        if k > 0:
            outer, centre, course = rotations[-1], chain.centre_palm[k - 1], chain.course(k - 1)
            if course is None:
                moved_centre = offset + outer @ centre
                joints.append((outer @ chain.axis_palm[k - 1], moved_centre))
                rotations.append(outer @ rotation_about(chain.axis_palm[k - 1], angle_rad[:, k - 1]))
                offset = moved_centre - rotations[-1] @ centre
            else:
                own = motion(chain.axis_palm[k - 1], centre, course, angle_rad[:, k - 1])
                axis, at, shift = ((outer @ v[..., None])[..., 0] for v in (own.axis, own.centre, own.translation))
                joints.append((axis, offset + at))
                rotations.append(outer @ own.rotation)
                offset = offset + shift
        columns = np.flatnonzero(body == k)
        x[:, columns] = offset[:, None] + np.einsum("nij,mj->nmi", rotations[-1], chain.marker_palm[columns])
    return x, np.stack(rotations, axis=1), joints


def jacobians(chain: Chain, body: Array, angle_rad: Array) -> tuple[Array, Array, Array, Array]:
    """Positions and their derivatives.

    Returns x (n, m, 3) [m]; by frame unknowns (n, m, 3, 6 + k) as in `Pose.moved`; by marker (n, m, 3, 3): the rotation
    of its body; by joint unknowns (n, m, 3, 4 k) as in `Chain.moved`, those of a plain hinge (a course is small).
    """
    placed = propagate(chain, body, angle_rad)
    x, rotations, joints = placed
    by_frame = _by_frame(chain, body, angle_rad, placed)
    n, m, n_joints = len(x), len(body), angle_rad.shape[1]
    by_joint = np.zeros((n, m, 3, 4 * n_joints))
    tangent = chain.tangent
    for k in range(n_joints):
        moved = np.flatnonzero(body > k)
        outer, inner = rotations[:, k], rotations[:, k + 1]
        arm = x[:, moved] - joints[k][1][:, None]
        arm_rest = np.einsum("nji,nmj->nmi", inner, arm)
        for i in range(2):
            # tilting the axis along the tangent = turning it about this
            turn = np.cross(chain.axis_palm[k], tangent[k, i])
            tilt_after = np.cross((outer @ turn)[:, None], arm)
            tilt_before = np.einsum("nij,nmj->nmi", inner, np.cross(turn, arm_rest))
            by_joint[..., 4 * k + i][:, moved] = tilt_after - tilt_before
            by_joint[..., 4 * k + 2 + i][:, moved] = ((outer - inner) @ tangent[k, i])[:, None]
    return x, by_frame, rotations[:, body], by_joint


def frame_jacobian(chain: Chain, body: Array, angle_rad: Array) -> tuple[Array, Array]:
    """The first two of `jacobians`, sooner: positions x (n, m, 3) [m] and what frame unknowns do (n, m, 3, 6 + k)."""
    placed = propagate(chain, body, angle_rad)
    return placed[0], _by_frame(chain, body, angle_rad, placed)


def _by_frame(
    chain: Chain, body: Array, angle_rad: Array, placed: tuple[Array, Array, list[tuple[Array, Array]]]
) -> Array:
    x, rotations, joints = placed
    n, m, n_joints = len(x), len(body), angle_rad.shape[1]
    by_frame = np.zeros((n, m, 3, 6 + n_joints))
    by_frame[..., :3] = np.eye(3)
    by_frame[..., 3:6] = -skew(x)
    for k in range(n_joints):
        moved = np.flatnonzero(body > k)
        axis, centre = joints[k]
        arm = x[:, moved] - centre[:, None]
        by_frame[..., 6 + k][:, moved] = np.cross(axis[:, None], arm)
        if chain.course(k) is not None:
            own = motion(chain.axis_palm[k], chain.centre_palm[k], chain.course(k), angle_rad[:, k])
            spin, drift = ((rotations[:, k] @ v[..., None])[:, None, :, 0] for v in (own.spin, own.drift))
            by_frame[..., 6 + k][:, moved] = np.cross(spin, arm) + drift
    return by_frame


def palm_pose(chain: Chain, data: ChainData, weight: Array | None = None) -> Pose:
    """Start values: palm by Kabsch on its markers, then each joint angle in closed form (least squares about a known
    line).

    weight: (n, m), zero to leave a marker out. A frame whose palm markers are hidden or out of shape starts from the
    palm pose of the nearest sound frame.
    """
    n, n_joints = len(data.position_world), len(chain.axis_palm)
    w = np.isfinite(data.position_world[..., 0]) * (1.0 if weight is None else weight)
    rotation, translation = _palm(chain, data, w)
    pose = Pose(rotation, translation, np.zeros((n, n_joints)))
    z = pose.to_palm(np.nan_to_num(data.position_world))
    angle = np.zeros((n, n_joints))
    for k in range(n_joints):
        _, rotations, joints = propagate(chain, data.body, angle)
        axis, centre = joints[k]
        columns = np.flatnonzero(data.body == k + 1)
        arm = np.einsum("nij,mj->nmi", rotations[:, k], chain.marker_palm[columns] - chain.centre_palm[k])
        seen = z[:, columns] - centre[:, None]
        across = arm - np.einsum("nmi,ni->nm", arm, axis)[..., None] * axis[:, None]
        sine = (w[:, columns] * np.einsum("ni,nmi->nm", axis, np.cross(across, seen))).sum(1)
        cosine = (w[:, columns] * np.einsum("nmi,nmi->nm", across, seen)).sum(1)
        angle[:, k] = np.arctan2(sine, cosine)
    return Pose(rotation, translation, angle)


def _palm(chain: Chain, data: ChainData, weight: Array) -> tuple[Array, Array]:
    palm = data.body == 0
    shape, seen = chain.marker_palm[palm], data.position_world[:, palm]
    rotation, translation = kabsch(shape, seen, weight[:, palm])
    miss = np.linalg.norm(seen - np.einsum("nij,mj->nmi", rotation, shape) - translation[:, None], axis=-1)
    miss = np.where(weight[:, palm] > 0, miss, 0.0).max(1)
    enough = (weight[:, palm] > 0).sum(1) >= 3
    if not enough.any():
        return rotation, translation
    sound = np.flatnonzero(enough & (miss <= 8 * np.median(miss[enough]) + 1e-9))
    after = np.minimum(np.searchsorted(sound, np.arange(len(seen))), len(sound) - 1)
    before = np.maximum(after - 1, 0)
    frame = np.arange(len(seen))
    nearest = np.where(np.abs(sound[after] - frame) <= np.abs(frame - sound[before]), sound[after], sound[before])
    return rotation[nearest], translation[nearest]
