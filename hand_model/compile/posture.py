"""Keyframes: open, close and grips, each on the linkages, and no finger inside another."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ..errors import HandFileError, did_you_mean
from ..hand import Finger, Hand
from ..kinematics import displace, finger_angles
from .clearance import CLEARANCE, Key
from .coupling import limits
from .shape import Capsule, moved, segment_distance

STEP = 0.02  # a finger in the way of another stops short in steps of this fraction of its range


def grips_of(hand: Hand) -> dict[str, Mapping[str, float]]:
    """Keyframe -> {finger: fraction closed}: open, close, and what `hand.extra["grips"]` adds for the hand's own
    fingers."""
    out: dict[str, Mapping[str, float]] = {
        "open": {f.name: 0.0 for f in hand.fingers},
        "close": {f.name: 1.0 for f in hand.fingers},
    }
    fingers = {f.name for f in hand.fingers}
    for name, fractions in hand.extra.get("grips", {}).items():
        for finger, fraction in fractions.items():
            if not (isinstance(fraction, (int, float)) and 0 <= fraction <= 1):
                raise HandFileError(
                    f'grip "{name}" closes "{finger}" by {fraction!r}; a fraction from 0 to 1 is needed'
                )
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
    """Joint -> angle [rad] of a finger closed by a fraction: independent joints between rest and the far end of their
    range."""
    bounds, followers = limits(finger), {c.follower for c in finger.couplings}
    drivers = {}
    for joint in finger.joints:
        if joint.name not in followers:
            low, high = bounds[joint.name]
            start = float(np.clip(0.0, low, high))
            drivers[joint.name] = start + fraction * ((high if abs(high) >= abs(low) else low) - start)
    angles = finger_angles(finger, drivers)[0]
    return {joint.name: float(angle) for joint, angle in zip(finger.joints, angles, strict=True)}


def posture(
    hand: Hand,
    fractions: Mapping[str, float],
    shapes: Mapping[Key, tuple[Capsule, ...]],
    excluded: Collection[frozenset[Key]],
) -> tuple[dict[Key, float], dict[str, float]]:
    """Angles of one keyframe, {(finger, joint): [rad]}, and the fractions that were reached.

    Fingers close in their order, thumbs last; each was recorded alone, so one that meets another stops short of it.
    excluded: pairs of bodies that need not keep clear of each other.
    """
    angles: dict[Key, float] = {}
    reached: dict[str, float] = {}
    placed = [_placed(f, finger_posture(f, 0.0), shapes) for f in hand.fingers if f.name.startswith("thumb")]
    for finger in sorted(hand.fingers, key=lambda f: f.name.startswith("thumb")):
        if finger.name.startswith("thumb"):
            placed = [p for p in placed if all(key[0] != finger.name for key in p)]
        fraction = fractions[finger.name]
        while True:
            joints = finger_posture(finger, fraction)
            own = _placed(finger, joints, shapes)
            if fraction <= 0 or not any(_in_the_way(own, other, excluded) for other in placed):
                break
            fraction = max(0.0, round(fraction - STEP, 10))
        placed.append(own)
        reached[finger.name] = fraction
        angles.update({(finger.name, name): value for name, value in joints.items()})
    return angles, reached


Placed = Mapping[Key, tuple[Capsule, ...]]


def _placed(finger: Finger, angles: Mapping[str, float], shapes: Mapping[Key, tuple[Capsule, ...]]) -> Placed:
    motion = displace(finger, [angles[j.name] for j in finger.joints])
    keys = [(finger.name, joint.name) for joint in finger.joints]
    return {
        key: tuple(moved(c, motion.rotation[0, i], motion.translation[0, i]) for c in shapes[key])
        for i, key in enumerate(keys)
    }


def _in_the_way(own: Placed, other: Placed, excluded: Collection[frozenset[Key]]) -> bool:
    pairs = (
        (a, b)
        for k, one in own.items()
        for j, two in other.items()
        if frozenset((k, j)) not in excluded
        for a in one
        for b in two
    )
    return any(
        segment_distance(a.start, a.end, b.start, b.end) < a.radius + b.radius + 0.999 * CLEARANCE for a, b in pairs
    )
