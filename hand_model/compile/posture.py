"""Keyframes: open, close and grips, each on the linkages, and no finger inside another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import HandFileError, did_you_mean
from ..hand import Finger, Hand
from ..kinematics import displace, finger_angles
from .clearance import CLEARANCE, LEAST_SHARE, Key
from .coupling import limits
from .shape import Capsule, moved, segment_distance

STEP = 0.02  # a finger in the way of another stops short in steps of this fraction of its range
SHARE = 0.5 * (1 + LEAST_SHARE)  # share of their radii at which two fingers count as in each other's way


def grips_of(hand: Hand) -> dict[str, Mapping[str, float]]:
    """Keyframe -> {finger: fraction closed}: open, close, and what `hand.extra["grips"]` adds for the hand's own fingers."""
    out: dict[str, Mapping[str, float]] = {
        "open": {f.name: 0.0 for f in hand.fingers},
        "close": {f.name: 1.0 for f in hand.fingers},
    }
    fingers = {f.name for f in hand.fingers}
    for name, fractions in hand.extra.get("grips", {}).items():
        for finger, fraction in fractions.items():
            if not (isinstance(fraction, (int, float)) and 0 <= fraction <= 1):
                raise HandFileError(f'grip "{name}" closes "{finger}" by {fraction!r}; a fraction from 0 to 1 is needed')
        if set(fractions) <= fingers:
            out[name] = {f: float(fractions.get(f, 0.0)) for f in sorted(fingers)}
    return out


def known_grip_fingers(hand: Hand) -> None:
    """Raise HandFileError where a grip names a finger that the whole hand does not have."""
    fingers = [f.name for f in hand.fingers]
    for name, fractions in hand.extra.get("grips", {}).items():
        for finger in fractions:
            if finger not in fingers:
                raise HandFileError(f'grip "{name}" names finger "{finger}"; {did_you_mean(finger, fingers)}')


def finger_posture(finger: Finger, fraction: float) -> dict[str, float]:
    """Joint -> angle [rad] of a finger closed by a fraction: independent joints between rest and the end of their range."""
    bounds, followers = limits(finger), {c.follower for c in finger.couplings}
    drivers = {}
    for joint in finger.joints:
        if joint.name not in followers:
            low, high = bounds[joint.name]
            start = float(np.clip(0.0, low, high))
            drivers[joint.name] = start + fraction * (high - start)
    angles = finger_angles(finger, drivers)[0]
    return {joint.name: float(angle) for joint, angle in zip(finger.joints, angles, strict=True)}


def posture(
    hand: Hand, fractions: Mapping[str, float], shapes: Mapping[Key, tuple[Capsule, ...]]
) -> tuple[dict[Key, float], dict[str, float]]:
    """Angles of one keyframe, {(finger, joint): [rad]}, and the fractions that were reached.

    Fingers close in their order, thumbs last; each was recorded alone, so one that meets another stops short of it.
    """
    angles: dict[Key, float] = {}
    reached: dict[str, float] = {}
    placed: list[Capsule] = []
    bodies = {f.name: _placed(f, finger_posture(f, 0.0), shapes) for f in hand.fingers}
    order = sorted(hand.fingers, key=lambda f: f.name.startswith("thumb"))
    for index, finger in enumerate(order):
        others = placed + [c for later in order[index + 1 :] for c in bodies[later.name] if later.name.startswith("thumb")]
        fraction = fractions[finger.name]
        while True:
            joints = finger_posture(finger, fraction)
            own = _placed(finger, joints, shapes)
            if fraction <= 0 or not _in_the_way(own, others):
                break
            fraction = max(0.0, round(fraction - STEP, 10))
        placed += own
        reached[finger.name] = fraction
        angles.update({(finger.name, name): value for name, value in joints.items()})
    return angles, reached


def _placed(finger: Finger, angles: Mapping[str, float], shapes: Mapping[Key, tuple[Capsule, ...]]) -> list[Capsule]:
    motion = displace(finger, [angles[j.name] for j in finger.joints])
    return [
        moved(c, motion.rotation[0, i], motion.translation[0, i])
        for i, joint in enumerate(finger.joints)
        for c in shapes[finger.name, joint.name]
    ]


def _in_the_way(own: list[Capsule], others: list[Capsule]) -> bool:
    return any(
        segment_distance(a.start, a.end, b.start, b.end) < SHARE * (a.radius + b.radius) + CLEARANCE for a in own for b in others
    )
