"""Collision primitives that do not touch at any keyframe: shrunk where that is enough, excluded with a reason where
not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from ..hand import Hand
from ..kinematics import displace
from .shape import Capsule, moved, segment_distance

Array = NDArray[np.float64]
Key = tuple[str, str]  # (finger, joint), the palm is ("", "palm")

PALM: Key = ("", "palm")
SHARE_A_JOINT = "share a joint"
CLEARANCE = 5e-4  # m between primitives at a keyframe
LEAST_SHARE = 0.5  # a primitive that would have to shrink below this share of its radius is excluded instead


def adjacent(hand: Hand) -> dict[frozenset[Key], str]:
    """Pairs of bodies that share a joint: they overlap by construction."""
    pairs: dict[frozenset[Key], str] = {}
    for finger in hand.fingers:
        chain = [PALM, *((finger.name, j.name) for j in finger.joints)]
        for inner, outer in pairwise(chain):
            pairs[frozenset((inner, outer))] = SHARE_A_JOINT
    return pairs


def cleared(
    hand: Hand,
    shapes: Mapping[Key, tuple[Capsule, ...]],
    postures: Mapping[str, Mapping[Key, float]],
    known: Mapping[frozenset[Key], str] | None = None,
) -> tuple[dict[Key, tuple[Capsule, ...]], dict[frozenset[Key], str]]:
    """Shrunk capsules and excluded pairs -> reason, so that nothing touches at rest or at any posture.

    shapes: body -> capsules in the palm frame at rest. postures: keyframe -> {(finger, joint): angle [rad]}.
    known: pairs that are excluded already.
    """
    excluded = adjacent(hand) | dict(known or {})
    placed = {name: _placed(hand, shapes, angles) for name, angles in {"rest": {}, **postures}.items()}
    radius = {key: [c.radius for c in capsules] for key, capsules in shapes.items()}
    closest: list[tuple[float, Key, int, Key, int, str]] = []
    for one, other in combinations(shapes, 2):
        if frozenset((one, other)) in excluded:
            continue
        for posture, bodies in placed.items():
            for i, a in enumerate(bodies[one]):
                for j, b in enumerate(bodies[other]):
                    closest.append((segment_distance(a.start, a.end, b.start, b.end), one, i, other, j, posture))
    for distance, one, i, other, j, posture in sorted(closest, key=lambda c: c[0]):
        share = (distance - CLEARANCE) / (shapes[one][i].radius + shapes[other][j].radius)
        if share < LEAST_SHARE:
            pair = frozenset((one, other))
            excluded.setdefault(pair, f"come within {distance * 1e3:.1f} mm, axis to axis, at {posture}")
    for distance, one, i, other, j, _ in closest:
        if frozenset((one, other)) in excluded:
            continue
        share = (distance - CLEARANCE) / (radius[one][i] + radius[other][j])
        if share < 1:
            radius[one][i] *= share
            radius[other][j] *= share
    shrunk = {
        key: tuple(replace(c, radius=float(r)) for c, r in zip(capsules, radius[key], strict=True))
        for key, capsules in shapes.items()
    }
    return shrunk, excluded


def _placed(
    hand: Hand, shapes: Mapping[Key, tuple[Capsule, ...]], angles: Mapping[Key, float]
) -> dict[Key, tuple[Capsule, ...]]:
    out = {PALM: shapes[PALM]}
    for finger in hand.fingers:
        motion = displace(finger, [angles.get((finger.name, j.name), 0.0) for j in finger.joints])
        for i, joint in enumerate(finger.joints):
            key = (finger.name, joint.name)
            out[key] = tuple(moved(c, motion.rotation[0, i], motion.translation[0, i]) for c in shapes[key])
    return out
