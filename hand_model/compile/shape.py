"""Primitive shapes and inertias of the segments: a labelled fallback until probed surfaces come.

A segment is a capsule from its joint to the next one, the last to the fingertip; the palm is one capsule per finger.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..hand import Finger, Hand

Array = NDArray[np.float64]

DENSITY = 1100.0  # kg/m^3: plastics with some metal in them; nothing that was measured
SLENDERNESS = 0.22  # radius over length of a finger segment
LEAST_LENGTH = 0.004  # m
USUAL_TAPER = 0.8  # length of a last segment over that of the one before it
SPREAD = 0.6  # breadth of the palm at its middle over that at the fingers' bases


@dataclass(frozen=True)
class Capsule:
    """A capsule between two points (3,) [m] of one frame, with radius [m]."""

    start: Array
    end: Array
    radius: float


@dataclass(frozen=True)
class Inertia:
    """mass [kg], centre (3,) [m], tensor (3, 3) [kg m^2] about the centre, axes along those of the segment's frame."""

    mass: float
    centre: Array
    tensor: Array


def with_tips(hand: Hand) -> tuple[Hand, Mapping[str, str]]:
    """The hand with a tip on every finger's last segment, and finger -> how it was guessed where none was recorded.

    A missing tip is put straight on from the segment before the last, as far as a marker reaches that way and at least
    0.8 times as far as that segment is long; for a single segment, across its axis towards its markers, as far as the
    furthest; else 25 mm along palm x.
    """
    guessed: dict[str, str] = {}
    fingers = []
    for finger in hand.fingers:
        last = finger.joints[-1]
        if last.tip_palm is None:
            tip, guessed[finger.name] = _tip_guess(finger)
            finger = replace(finger, joints=(*finger.joints[:-1], replace(last, tip_palm=tip)))
        fingers.append(finger)
    return replace(hand, fingers=tuple(fingers)), guessed


def _tip_guess(finger: Finger) -> tuple[Array, str]:
    last = finger.joints[-1]
    centre = np.asarray(last.centre_palm, float)
    offsets = np.array(list(last.markers_palm.values()), float).reshape(-1, 3) - centre
    if len(finger.joints) > 1:
        step = centre - np.asarray(finger.joints[-2].centre_palm, float)
        length = float(np.linalg.norm(step))
        if length > 1e-6:
            reach = max([USUAL_TAPER * length, *(offsets @ step / length)])
            return (
                centre + reach * step / length,
                "no tip was recorded: straight on from the segment before it, as far as markers reach",
            )
    if len(offsets):
        sideways = np.asarray(last.axis_palm, float)
        direction = offsets.mean(0) - (offsets.mean(0) @ sideways) * sideways
        if np.linalg.norm(direction) > 1e-6:
            reach = np.linalg.norm(offsets, axis=1).max()
            return centre + reach * direction / np.linalg.norm(
                direction
            ), "no tip was recorded: as far out as the furthest marker"
    return centre + np.array([0.025, 0.0, 0.0]), "neither tip nor markers nor a segment before it: 25 mm along palm x"


def finger_capsules(hand: Hand, finger: Finger) -> tuple[Capsule, ...]:
    """One capsule per segment in the palm frame at rest; the hand must carry its tips.

    A finger does not grow thicker outwards, and no segment is much thicker than the hand's median one would be.
    """
    points, lengths = _bones(finger)
    usual = float(np.median([length for f in hand.fingers for length in _bones(f)[1]]))
    radii = np.minimum.accumulate([SLENDERNESS * min(length, 1.3 * usual) for length in lengths])
    shapes = []
    for i, radius in enumerate(radii):
        start, end = points[i], points[i + 1]
        if i == len(radii) - 1 and np.linalg.norm(end - start) > 2 * radius:  # the tip is on the surface
            end = end - radius * (end - start) / np.linalg.norm(end - start)
        shapes.append(Capsule(start, end, float(radius)))
    return tuple(shapes)


def _bones(finger: Finger) -> tuple[list[Array], list[float]]:
    points = [np.asarray(j.centre_palm, float) for j in finger.joints]
    points.append(np.asarray(finger.joints[-1].tip_palm, float))
    return points, [max(float(np.linalg.norm(b - a)), LEAST_LENGTH) for a, b in pairwise(points)]


def palm_capsules(hand: Hand) -> tuple[Capsule, ...]:
    """One capsule per finger in the palm frame, to the finger's base from the middle of the palm's landmarks (or
    markers).

    Those of the fingers beside the thumb start spread out, as the bones of a palm do.
    """
    known = list(hand.landmarks_palm.values()) or list(hand.palm_markers_palm.values()) or [np.zeros(3)]
    hub = np.mean(np.array(known, float), axis=0)
    bases = [np.asarray(f.joints[0].centre_palm, float) for f in hand.fingers if not f.name.startswith("thumb")]
    middle = np.mean(bases or [hub], axis=0)
    shapes = []
    for finger in hand.fingers:
        base = np.asarray(finger.joints[0].centre_palm, float)
        start = hub if finger.name.startswith("thumb") else hub + SPREAD * (base - middle)
        radius = finger_capsules(hand, finger)[0].radius
        shapes.append(Capsule(start, base, min(radius, max(0.5 * float(np.linalg.norm(base - start)), LEAST_LENGTH))))
    return tuple(shapes)


def capsule_inertia(capsule: Capsule, density: float = DENSITY) -> Inertia:
    """Mass properties of a solid capsule of uniform density [kg/m^3], in the frame of its points."""
    r, axis = capsule.radius, np.asarray(capsule.end, float) - capsule.start
    length = float(np.linalg.norm(axis))
    u = axis / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    cylinder, ball = density * np.pi * r**2 * length, density * 4 / 3 * np.pi * r**3
    along = cylinder * r**2 / 2 + ball * 2 / 5 * r**2
    # two half balls: own inertia about the ball's centre plus Steiner, 3/8 r from the flat face to the centre of mass
    across = cylinder * (length**2 / 12 + r**2 / 4) + ball * (2 / 5 * r**2 + length**2 / 4 + 3 / 8 * length * r)
    projector = np.outer(u, u)
    tensor = along * projector + across * (np.eye(3) - projector)
    return Inertia(cylinder + ball, (np.asarray(capsule.start, float) + capsule.end) / 2, tensor)


def combined(parts: tuple[Inertia, ...]) -> Inertia:
    """Mass properties of several bodies in one frame taken as one (Steiner)."""
    mass = sum(p.mass for p in parts)
    centre = sum(p.mass * p.centre for p in parts) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        d = part.centre - centre
        tensor = tensor + part.tensor + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertia(float(mass), centre, (tensor + tensor.T) / 2)


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> float:
    """Smallest distance [m] between the line segments a-b and c-d, each point (3,) [m] (Ericson 2005, 5.1.9)."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = u @ u, v @ v, u @ v
    if uu < 1e-18 and vv < 1e-18:
        return float(np.linalg.norm(w))
    if uu < 1e-18:
        s, t = 0.0, np.clip(v @ w / vv, 0, 1)
    elif vv < 1e-18:
        s, t = np.clip(-(u @ w) / uu, 0, 1), 0.0
    else:
        denominator = uu * vv - uv**2
        s = np.clip((uv * (v @ w) - (u @ w) * vv) / denominator, 0, 1) if denominator > 1e-12 * uu * vv else 0.0
        t = (uv * s + v @ w) / vv
        if t < 0 or t > 1:
            t = np.clip(t, 0, 1)
            s = np.clip((uv * t - u @ w) / uu, 0, 1)
    return float(np.linalg.norm(w + s * u - t * v))


def moved(capsule: Capsule, rotation: ArrayLike, translation: ArrayLike) -> Capsule:
    """The capsule after x -> rotation x + translation."""
    r, t = np.asarray(rotation, float), np.asarray(translation, float)
    return Capsule(r @ capsule.start + t, r @ capsule.end + t, capsule.radius)
