"""The hand of a session: fingers, markers on the palm, where it stands among the cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .geometry import Array, rotation, unit
from .laboratory import Laboratory
from .motor import Motor

SEGMENTS = ("proximal", "distal")
# Directions of the joints' axes and their centres [mm], palm's landmark frame, hand open; proximal, distal.
AXES = {
    "left": {
        "index": [[0.092, 0.986, 0.141], [0.113, 0.988, 0.102]],
        "middle": [[0.059, 0.998, 0.038], [0.065, 0.997, 0.045]],
        "ring": [[0.026, 0.993, -0.112], [0.054, 0.996, -0.076]],
        "little": [[-0.048, 0.989, -0.133], [0.020, 0.985, -0.170]],
    },
    "right": {
        "index": [[-0.088, 0.986, -0.139], [-0.098, 0.985, -0.141]],
        "middle": [[0.009, 0.997, -0.080], [-0.038, 0.999, 0.015]],
        "ring": [[0.030, 0.999, 0.026], [-0.037, 0.993, 0.115]],
        "little": [[0.077, 0.992, 0.091], [0.046, 0.978, 0.202]],
    },
}
CENTRES = {
    "left": {
        "index": [[45, -27, 4], [76, -33, 5]],
        "middle": [[47, -9, 9], [82, -15, 18]],
        "ring": [[48, 7, 9], [81, 6, 17]],
        "little": [[45, 27, 4], [76, 29, 13]],
    },
    "right": {
        "index": [[47, 24, 5], [75, 27, 11]],
        "middle": [[49, 8, 10], [85, 9, 21]],
        "ring": [[48, -7, 9], [82, -11, 17]],
        "little": [[43, -26, 5], [73, -32, 10]],
    },
}
FULL_ANGLES = {"index": (1.35, 1.2), "middle": (1.40, 1.25), "ring": (1.38, 1.22), "little": (1.30, 1.15)}  # [rad]
COUNTS = {"index": (12100, 17900), "middle": (12050, 18050), "ring": (12200, 17800), "little": (12150, 17600)}
TAGS = {"index": "INx", "middle": "MIe", "ring": "RIg", "little": "LIe"}  # of markers' labels
PALM_LABELS = ("PO", "PM", "PL")
GRAVITIES = ([0, -9.81, 0], [0, 0, -9.81], [0, 9.81, 0])  # [m/s^2] where the cameras' axes lie anyhow


@dataclass(frozen=True)
class Finger:
    """axes, centres [mm], markers [mm from the joint's centre, hand open] of both segments, in the landmark frame;
    full_angles [rad]; curve: coefficients of the joints' angles (`kinematics`); counts: encoder open and closed."""

    name: str
    axes: tuple[Array, Array]
    centres: tuple[Array, Array]
    markers: tuple[Array, Array]
    full_angles: tuple[float, float]
    curve: tuple[float, float, float, float]
    motor: Motor

    @property
    def counts(self) -> tuple[int, int]:
        """The encoder's at 0 and 100 %."""
        return COUNTS[self.name]

    @property
    def labels(self) -> list[str]:
        """Of the markers, proximal segment first."""
        return [f"{TAGS[self.name]}_{segment}{i}" for segment in "PD" for i in (1, 2, 3)]


@dataclass(frozen=True)
class Hand:
    """palm and landmarks [mm] in the landmark frame; turned, place [mm]: landmark frame among the cameras; gravity
    [m/s^2] in the cameras' frame."""

    side: str
    fingers: dict[str, Finger]
    palm: Array
    landmarks: dict[str, Array]
    turned: Array
    place: Array
    gravity: tuple[float, float, float]


def draw_markers(rng: np.random.Generator, axis: Array, segment: int, spread: float) -> Array:
    """Three markers (3, 3) [mm] of a segment from its joint's centre."""
    along = unit(np.cross(np.array([1.0, 0, 0]), axis))
    frame = np.c_[np.cross(axis, along), axis, along]
    places = np.array([[31, -1.5, 24.0], [36, 15, 22.0], [44, -14.5, 27.0]])
    places = places + rng.normal(0, 1.9 * spread, (3, 3)) + (np.array([-2, 0, 0]) if segment else 0)
    return places @ frame.T


def draw_motor(rng: np.random.Generator, spread: float) -> Motor:
    """A healthy motor."""

    def near(value: float) -> float:
        """By about 10 % off."""
        return float(value * np.clip(rng.normal(1, 0.10 * spread), 0.6, 1.5))

    mass, viscous, coulomb, stiffness, preload = (near(value) for value in (0.0122, 0.145, 34, 0.228, 9.4))
    return Motor(mass, viscous, coulomb, stiffness, preload, static_friction=coulomb)


def draw_finger(rng: np.random.Generator, side: str, name: str, laboratory: Laboratory) -> Finger:
    """A finger near the usual one of its name."""
    axes = tuple(unit(np.array(AXES[side][name][j]) + rng.normal(0, 0.022, 3) * [1, 0.3, 1]) for j in (0, 1))
    centres = tuple(np.array(CENTRES[side][name][j], float) + rng.normal(0, 1.0, 3) for j in (0, 1))
    markers = tuple(draw_markers(rng, axes[j], j, laboratory.layout_spread) for j in (0, 1))
    curve = (
        1.02 + rng.normal(0, 0.044),
        rng.normal(0, 0.06),
        0.56 + rng.normal(0, 0.037),
        0.45 + rng.normal(0, 0.06),
    )
    motor = draw_motor(rng, laboratory.motor_spread)
    return Finger(name, axes, centres, markers, FULL_ANGLES[name], curve, motor)


def draw_hand(rng: np.random.Generator, laboratory: Laboratory) -> Hand:
    """A hand with an index finger and one other."""
    side = "left" if rng.random() < 0.5 else "right"
    across = -1.0 if side == "left" else 1.0
    names = ["index", str(rng.choice(["middle", "ring", "little"]))]
    if rng.random() < 0.4:
        names = names[::-1]
    fingers = {name: draw_finger(rng, side, name, laboratory) for name in names}
    palm = np.array([[-34.5, -1.9 * across, 17.3], [28.6, 20.9 * across, 24.8], [25.7, -20.5 * across, 23.0]])
    palm = palm + rng.normal(0, 0.9 * laboratory.layout_spread, (3, 3))
    landmarks = {
        "origin": np.zeros(3),
        "medial": np.array([40.0, 22.0 * across, 0]),
        "lateral": np.array([40.0, -22.0 * across, 0]),
    }
    tilt = rng.normal(0, 25, 3)
    if laboratory.turned:
        tilt = tilt + rng.uniform(-180, 180, 3)
    turned = rotation([1, 0, 0], np.radians(tilt[0]))[0]
    turned = rotation([0, 1, 0], np.radians(tilt[1]))[0] @ turned
    turned = rotation([0, 0, 1], np.radians(tilt[2]))[0] @ turned
    place = np.array([390.0, -210.0, 1065.0]) + rng.normal(0, 40, 3)
    gravity = GRAVITIES[rng.integers(3)] if laboratory.turned else [0.0, 0.0, -9.81]
    x, y, z = (float(value) for value in gravity)
    return Hand(side, fingers, palm, landmarks, turned, place, (x, y, z))
