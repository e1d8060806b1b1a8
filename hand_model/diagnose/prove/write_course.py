"""Courses into a hand: a finger's chain as fitted to the session's markers takes the place of the hand's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...hand import Course, Finger, Hand
from ...identify.chain import Chain
from ...rotation import kabsch
from ..findings import Finding
from ..locate.course import FingerCourses
from ..locate.markers import HINGE

Array = NDArray[np.float64]

ELSEWHERE_M = 1e-3  # palm markers further from where the model has them were put on anew


def written_courses(
    hand: Hand, findings: Sequence[Finding], courses: Mapping[str, FingerCourses]
) -> dict[str, FingerCourses]:
    """Those of `courses` (finger -> its own) that a finding names and that the hand can take: it has the session's
    markers where they are."""
    named = {f.where.get("finger") for f in findings if f.effect in HINGE}
    known = {f.name for f in hand.fingers}
    return {name: c for name, c in courses.items() if name in named & known and _placed(hand, c) is not None}


def with_chains(hand: Hand, courses: Mapping[str, FingerCourses], which: Callable[[FingerCourses], Chain]) -> Hand:
    """The hand with the axes, centres, markers and courses of one of the chains of each finger of `courses`."""
    fingers = [
        _with_chain(hand, f, courses[f.name], which(courses[f.name])) if f.name in courses else f for f in hand.fingers
    ]
    return replace(hand, fingers=tuple(fingers))


def _placed(hand: Hand, courses: FingerCourses) -> tuple[Array, Array] | None:
    """Rotation (3, 3) and translation (3,) [m] from the chain's palm frame to the hand's; None where the markers are
    others."""
    palm = np.flatnonzero(courses.body == 0)
    own = dict(hand.palm_markers_palm)
    if not {courses.labels[j] for j in palm} <= set(own):
        return None
    there = np.stack([np.asarray(own[courses.labels[j]], float) for j in palm])
    rotation, translation = kabsch(courses.plain.marker_palm[palm], there)
    off = courses.plain.marker_palm[palm] @ rotation.T + translation - there
    return None if np.linalg.norm(off, axis=1).max() > ELSEWHERE_M else (rotation, translation)


def _with_chain(hand: Hand, finger: Finger, courses: FingerCourses, chain: Chain) -> Finger:
    palm = courses.body == 0
    there = np.stack([np.asarray(hand.palm_markers_palm[courses.labels[j]], float) for j in np.flatnonzero(palm)])
    rotation, translation = kabsch(chain.marker_palm[palm], there)
    joints = []
    for k, joint in enumerate(finger.joints):
        markers = {
            courses.labels[j]: rotation @ chain.marker_palm[j] + translation
            for j in np.flatnonzero(courses.body == k + 1)
        }
        joints.append(
            replace(
                joint,
                axis_palm=rotation @ chain.axis_palm[k],
                centre_palm=rotation @ chain.centre_palm[k] + translation,
                markers_palm={**joint.markers_palm, **markers},
                course=_turned(chain.course(k), rotation),
            )
        )
    return replace(finger, joints=tuple(joints))


def _turned(course: Course | None, rotation: Array) -> Course | None:
    if course is None:
        return None
    return replace(course, joints=tuple(replace(e, axis_palm=_unit(rotation @ e.axis_palm)) for e in course.joints))


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)
