"""The thesis's three checks of identified hands: repeatability, mirror relation, parallelism (tables 4.9 to 4.11).

Each difference comes with what the uncertainty of both sides explains, so that "they differ" is a statement that can
fail.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from .errors import HandModelError
from .hand import Finger, Hand, Joint
from .published import axis_parallelism_deg, axis_repeatability_deg
from .rotation import angle_between, skew
from .twin.published import FINGERS, published_joint

Array = NDArray[np.float64]
Published = Callable[[str], tuple[float, ...] | None]

# Reflection that turns a left hand into a right one, in the palm frame.
MIRROR = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Difference:
    """A length or angle that ought to be zero, and its uncertainty.

    value: as measured. noise: root mean square that the uncertainty alone gives. ci95: interval of the true value.
    significance: probability of a difference this large, were there none. Angles [rad], lengths [m].
    """

    value: float
    noise: float
    ci95: tuple[float, float]
    significance: float

    @property
    def real(self) -> bool:
        """Whether the uncertainty does not explain it (at 1 %)."""
        return self.significance < 0.01


@dataclass(frozen=True)
class JointRow:
    """One row of a table: angle between two axes, distance of two centres [m] (None where it is not compared).

    published_deg: the thesis's angle for the hand that it measured.
    """

    finger: str
    joint: str
    angle: Difference
    distance: Difference | None
    published_deg: float | None
    degenerate: bool


def repeatability(first: Hand, second: Hand) -> tuple[JointRow, ...]:
    """Axes and centres of one hand from two sessions (table 4.9). Raises HandModelError where they share no joint."""
    if first.side != second.side:
        raise HandModelError(
            f"repeatability needs two sessions of one hand; these are a {first.side} and a {second.side} one"
        )
    return _compared(first, second, np.eye(3), axis_repeatability_deg)


def mirror(left: Hand, right: Hand) -> tuple[JointRow, ...]:
    """The left hand, reflected, against the right one (table 4.10). Raises HandModelError where they share no joint."""
    if {left.side, right.side} != {"left", "right"}:
        raise HandModelError(
            f"the mirror relation needs a left and a right hand; these are {left.side} and {right.side}"
        )
    pair = (left, right) if left.side == "left" else (right, left)
    return _compared(*pair, MIRROR, _published_mirror_deg)


def frame_covariance(hand: Hand) -> Array:
    """(6, 6) of turn [rad] and shift [m] of the palm frame as the landmarks give it, in that frame; zero where it is
    not known.
    """
    return np.array(hand.extra.get("frame_covariance", np.zeros((6, 6))), float)


def joint_covariance(hand: Hand, joint: Joint) -> Array:
    """(6, 6) of axis and centre without the palm frame's own uncertainty, which moves all joints of the hand
    together.
    """
    by_frame = np.zeros((6, 6))
    by_frame[:3, :3] = skew(joint.axis_palm)
    by_frame[3:, :3] = skew(joint.centre_palm)
    by_frame[3:, 3:] = -np.eye(3)
    rest = joint.covariance - by_frame @ frame_covariance(hand) @ by_frame.T
    value, vector = np.linalg.eigh((rest + rest.T) / 2)
    return (vector * np.maximum(value, 0.0)) @ vector.T  # a difference of covariances: rounding may leave -1e-20


def parallelism(hand: Hand) -> tuple[JointRow, ...]:
    """Angle between the first axis of a finger and each further one (table 4.11), the palm frame's uncertainty left
    out.

    Both axes count as independently uncertain.
    """
    rows = []
    for finger in hand.fingers:
        first = finger.joints[0]
        for joint in finger.joints[1:]:
            published = axis_parallelism_deg(hand.side, finger.name) if len(finger.joints) == 2 else None
            uncertain = joint_covariance(hand, first) + joint_covariance(hand, joint)
            angle = axis_difference(first.axis_palm, joint.axis_palm, uncertain[:3, :3])
            rows.append(
                JointRow(
                    finger.name,
                    f"{first.name} to {joint.name}",
                    angle,
                    None,
                    published,
                    first.degenerate or joint.degenerate,
                )
            )
    return tuple(rows)


def axis_difference(a: Array, b: Array, covariance: Array) -> Difference:
    """Angle between unit axes (3,) [rad] whose difference has covariance (3, 3)."""
    turn = np.cross(a, b)
    angle = float(np.arctan2(np.linalg.norm(turn), a @ b))
    middle = (a + b) / np.linalg.norm(a + b) if np.linalg.norm(a + b) > 1e-9 else a
    across = np.linalg.svd(middle[None])[2][1:]  # (2, 3): directions in which an axis can tilt
    difference = across @ (b - a)
    size = np.linalg.norm(difference)
    return _difference(difference * (angle / size if size > 0 else 1.0), across @ covariance @ across.T)


def point_difference(a: Array, b: Array, covariance: Array) -> Difference:
    """Distance of two points (3,) [m] whose difference has covariance (3, 3) [m^2]."""
    return _difference(b - a, covariance)


def _difference(vector: Array, covariance: Array) -> Difference:
    """95 % interval along the difference; where noise explains it, its direction is chance and the worst one counts."""
    length, noise = float(np.linalg.norm(vector)), float(np.sqrt(np.trace(covariance)))
    if noise == 0:
        return Difference(length, 0.0, (length, length), float(length == 0))
    significance = float(chi2.sf(vector @ np.linalg.pinv(covariance, hermitian=True) @ vector, len(vector)))
    if significance < 0.05:
        along = vector / length
        half = 1.96 * float(np.sqrt(along @ covariance @ along))
        return Difference(length, noise, (max(0.0, length - half), length + half), significance)
    return Difference(
        length, noise, (0.0, length + 1.96 * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))), significance
    )


def _compared(first: Hand, second: Hand, reflection: Array, published: Published) -> tuple[JointRow, ...]:
    other = {finger.name: finger for finger in second.fingers}
    rows = []
    for finger in first.fingers:
        if finger.name in other:
            rows += _finger_rows(finger, other[finger.name], reflection, published)
    if not rows:
        names = ", ".join(f.name for f in first.fingers), ", ".join(other)
        raise HandModelError(
            f"the two hands share no finger with the same joints (first: {names[0]}; second: {names[1]})"
        )
    return tuple(rows)


def _finger_rows(a: Finger, b: Finger, reflection: Array, published: Published) -> list[JointRow]:
    partner = {joint.name: joint for joint in b.joints}
    known = published(a.name) if len(a.joints) == 2 else None
    rows = []
    for k, joint in enumerate(a.joints):
        if joint.name in partner:
            turned, other = reflected(joint, reflection), partner[joint.name]
            total = turned.covariance + other.covariance
            angle = axis_difference(turned.axis_palm, other.axis_palm, total[:3, :3])
            distance = point_difference(turned.centre_palm, other.centre_palm, total[3:, 3:])
            rows.append(
                JointRow(
                    a.name,
                    joint.name,
                    angle,
                    distance,
                    known[k] if known else None,
                    joint.degenerate or other.degenerate,
                )
            )
    return rows


def reflected(joint: Joint, reflection: Array) -> Joint:
    """A joint seen in a mirror: the centre as a point, the axis as the pseudovector that it is (flexion stays
    positive).
    """
    turn = np.linalg.det(reflection) * reflection
    both = np.block([[turn, np.zeros((3, 3))], [np.zeros((3, 3)), reflection]])
    return replace(
        joint,
        axis_palm=turn @ joint.axis_palm,
        centre_palm=reflection @ joint.centre_palm,
        covariance=both @ joint.covariance @ both.T,
        markers_palm={label: reflection @ point for label, point in joint.markers_palm.items()},
        tip_palm=None if joint.tip_palm is None else reflection @ joint.tip_palm,
    )


def _published_mirror_deg(finger: str) -> tuple[float, ...] | None:
    """Angles [deg] between the published axes of the left hand, reflected, and of the right one (tables 4.1, 4.2)."""
    if finger not in FINGERS:
        return None
    turned = published_joint("left", finger)[0] @ -MIRROR
    return tuple(
        np.rad2deg(angle_between(a, b)) for a, b in zip(turned, published_joint("right", finger)[0], strict=True)
    )
