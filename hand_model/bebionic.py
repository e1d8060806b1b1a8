"""The BeBionic hand as published: a Hand from the tables of the thesis, for whoever has no recording of their own.

Source: "Modelling of Robotic Hands: Kinematic and Dynamic Parameter Identification", tables 4.1 to 4.4 and 4.9. What it
does not give (ranges, linkages, fingertips) is nominal and says so.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from .errors import HandModelError, did_you_mean
from .hand import Coupling, Finger, Hand, Joint
from .published import axis_repeatability_deg
from .twin.published import FINGERS, SIDES, published_joint

Array = NDArray[np.float64]

SEGMENTS = ("proximal", "distal")

# Nominal, not published: full flexion of proximal and distal joint [rad] and length of the distal segment [m].
FLEXION = MappingProxyType(
    {
        "thumb_0": (0.62, 0.35),
        "thumb_1": (0.66, 0.40),
        "index": (1.35, 1.20),
        "middle": (1.40, 1.25),
        "ring": (1.38, 1.22),
        "little": (1.30, 1.15),
    }
)
DISTAL_LENGTH = MappingProxyType(
    {"thumb_0": 0.033, "thumb_1": 0.033, "index": 0.036, "middle": 0.040, "ring": 0.038, "little": 0.032}
)
STRAIGHT = 0.75  # slope of a finger's nominal linkage at rest, over its mean slope: the distal joint starts slowly

# Fractions of the range: the grips of the BeBionic's manual that differ in the fingers' posture.
GRIPS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "power": {"thumb_0": 1.0, "index": 0.8, "middle": 0.8, "ring": 0.8, "little": 0.8},
        "tripod": {"thumb_0": 1.0, "index": 0.62, "middle": 0.62},
        "tripod_closed": {"thumb_0": 1.0, "index": 0.62, "middle": 0.62, "ring": 1.0, "little": 1.0},
        "pinch": {"thumb_0": 1.0, "index": 0.62},
        "precision_closed": {"thumb_0": 1.0, "index": 0.62, "middle": 1.0, "ring": 1.0, "little": 1.0},
        "active_index": {"thumb_0": 0.6, "index": 0.4, "middle": 0.9, "ring": 0.9, "little": 0.9},
        "hook": {"index": 0.7, "middle": 0.7, "ring": 0.7, "little": 0.7},
        "key": {"thumb_1": 1.0, "index": 0.8, "middle": 0.8, "ring": 0.8, "little": 0.8},
        "finger_point": {"thumb_1": 0.6, "middle": 1.0, "ring": 1.0, "little": 1.0},
        "column": {"thumb_1": 0.0, "index": 1.0, "middle": 1.0, "ring": 1.0, "little": 1.0},
        "mouse": {"thumb_1": 0.3, "index": 0.25, "middle": 0.25, "ring": 0.35, "little": 0.5},
        "open_palm": {},
        "relaxed": {"index": 0.2, "middle": 0.22, "ring": 0.25, "little": 0.28},
    }
)

NOTES = (
    "The thesis rounds axes to three digits and centres to a millimetre; axes are set to length one here.",
    (
        "Covariances come from the thesis's own tables: axes from two captures of the left hand, "
        "centres from left and right."
    ),
    "Ranges, linkages and fingertips are nominal: the thesis prints none. There is no marker, encoder map or motor.",
    "The tables orient every axis towards +y. The thumb closes against that sense, so its angles are negative.",
)


def published_deviations() -> tuple[float, float]:
    """Standard deviations per coordinate across an axis [rad] and of a centre [m] that the thesis's own tables imply.

    Axis: two captures of the left hand lie this far apart (table 4.9); two estimates, two directions: E[angle^2] = 4
    sd^2.
    Centre: left against mirrored right (tables 4.3, 4.4), as if both hands were made alike: E[d^2] = 2 sd^2 per
    coordinate.
    """
    angle = np.radians([axis_repeatability_deg(name) for name in FINGERS])
    centre = {side: np.array([published_joint(side, name)[1] for name in FINGERS]) for side in SIDES}
    difference = centre["left"] - centre["right"] * [1.0, -1.0, 1.0]
    return float(np.sqrt((angle**2).mean() / 4)), float(np.sqrt((difference**2).mean() / 2))


def published_hand(side: str) -> Hand:
    """The left or right BeBionic hand of the thesis's tables, with both thumb positions and the grips as
    `extra["grips"]`.

    Raises HandModelError for another side.
    """
    if side not in SIDES:
        raise HandModelError(f'no published hand of side "{side}"; {did_you_mean(side, SIDES)}')
    figures = [[*(a.tolist() for a in published_joint(side, name)), axis_repeatability_deg(name)] for name in FINGERS]
    return Hand(
        name="bebionic",
        side=side,
        palm_markers_palm={},
        landmarks_palm={"origin": np.zeros(3)},
        fingers=tuple(_finger(side, name) for name in FINGERS),
        noise_m=0.0,
        provenance={"thesis, tables 4.1 to 4.4 and 4.9": hashlib.sha256(json.dumps(figures).encode()).hexdigest()},
        notes=NOTES,
        extra={
            "origin": "Axes and centres are the thesis's (tables 4.1 to 4.4), not identified here.",
            "grips": {name: dict(fractions) for name, fractions in GRIPS.items()},
        },
    )


def _finger(side: str, name: str) -> Finger:
    axes, centres = published_joint(side, name)
    axis_sd, centre_sd = published_deviations()
    along = (centres[1] - centres[0]) / np.linalg.norm(centres[1] - centres[0])
    # Fingers flex about +y, towards the palm (-z); the thumb, on the palmar side, closes the other way, towards them.
    sign = -1.0 if name.startswith("thumb") else 1.0
    joints = []
    for i, segment in enumerate(SEGMENTS):
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = axis_sd**2 * (np.eye(3) - np.outer(axes[i], axes[i]))
        covariance[3:, 3:] = centre_sd**2 * np.eye(3)
        far = sign * FLEXION[name][i]
        tip = centres[1] + DISTAL_LENGTH[name] * along if segment == "distal" else None
        joints.append(Joint(segment, axes[i], centres[i], covariance, (min(0.0, far), max(0.0, far)), {}, tip))
    return Finger(name, "thumb" if name.startswith("thumb") else name, tuple(joints), (), (_linkage(name),))


def _linkage(name: str) -> Coupling:
    """Nominal: a straight line for the thumb, a parabola through both ends for the fingers."""
    proximal, distal = FLEXION[name]
    mean = distal / proximal
    slope = mean if name.startswith("thumb") else STRAIGHT * mean
    return Coupling(*SEGMENTS, np.array([0.0, slope, (mean - slope) / proximal]), {}, {})
