"""A healthy hand drawn at random: motors, joints, markers, landmarks."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Axes and centres [m] of the fingers of a right and a left hand, in the landmark frame, [proximal, distal].
TABLE: dict[str, dict[str, tuple[list[list[float]], list[list[float]]]]] = {
    "right": {
        "index": ([[-0.088, 0.986, -0.139], [-0.098, 0.985, -0.141]], [[0.047, 0.024, 0.005], [0.075, 0.027, 0.011]]),
        "middle": ([[0.009, 0.997, -0.080], [-0.038, 0.999, 0.015]], [[0.049, 0.008, 0.010], [0.085, 0.009, 0.021]]),
        "ring": ([[0.030, 0.999, 0.026], [-0.037, 0.993, 0.115]], [[0.048, -0.007, 0.009], [0.082, -0.011, 0.017]]),
        "little": ([[0.077, 0.992, 0.091], [0.046, 0.978, 0.202]], [[0.043, -0.026, 0.005], [0.073, -0.032, 0.010]]),
    },
    "left": {
        "index": ([[0.092, 0.986, 0.141], [0.113, 0.988, 0.102]], [[0.045, -0.027, 0.004], [0.076, -0.033, 0.005]]),
        "middle": ([[0.059, 0.998, 0.038], [0.065, 0.997, 0.045]], [[0.047, -0.009, 0.009], [0.082, -0.015, 0.018]]),
        "ring": ([[0.026, 0.993, -0.112], [0.054, 0.996, -0.076]], [[0.048, 0.007, 0.009], [0.081, 0.006, 0.017]]),
        "little": ([[-0.048, 0.989, -0.133], [0.020, 0.985, -0.170]], [[0.045, 0.027, 0.004], [0.076, 0.029, 0.013]]),
    },
}
ANGLE_FULL = {"index": (1.35, 1.2), "middle": (1.4, 1.25), "ring": (1.38, 1.22), "little": (1.3, 1.15)}
COUNTS = {"index": (12100, 17900), "middle": (12050, 18050), "ring": (12200, 17800), "little": (12150, 17600)}
PROBE = {"T1": (0.0, 0.0, 0.085), "T2": (0.0, 0.0, 0.125), "T3": (0.034, 0.0, 0.11), "T4": (-0.026, 0.008, 0.118)}
SEGMENT_MARKERS = {  # local [m]: x along the finger, y along the axis, z dorsal
    0: [[0.032, 0.0, 0.0235], [0.036, 0.016, 0.0230], [0.045, -0.0145, 0.027]],
    1: [[0.0295, 0.0, 0.0235], [0.034, 0.016, 0.0225], [0.0425, -0.0135, 0.027]],
}
SEGMENTS = ("proximal", "distal")


@dataclass(frozen=True)
class Motor:
    """Healthy drive; position in % of the range, force in raw current units."""

    m: float
    b: float
    Fc: float
    k: float
    tau0: float


@dataclass(frozen=True)
class Finger:
    """One finger; axes and centres in the landmark frame, markers relative to the centre of their joint, hand open."""

    name: str
    axes: Array
    centres: Array
    angle_full: tuple[float, float]
    coef: tuple[float, float, float, float]
    markers: Array
    motor: Motor

    @property
    def labels(self) -> list[str]:
        """Marker labels, proximal then distal."""
        tag = self.name[:2].upper() + self.name[-1]
        return [f"{tag}_{segment}{i}" for segment in "PD" for i in (1, 2, 3)]

    @property
    def counts(self) -> tuple[int, int]:
        """Encoder counts, open and full."""
        return COUNTS[self.name]


@dataclass(frozen=True)
class Hand:
    """Two fingers on a palm."""

    side: str
    palm_markers: Array
    landmarks: dict[str, Array]
    fingers: tuple[Finger, Finger]


def unit(vector: Array) -> Array:
    """Vector of length one."""
    return vector / np.linalg.norm(vector)


def finger_frame(axis: Array) -> Array:
    """Rows x (along the finger), y (axis), z (dorsal)."""
    x = np.array([1.0, 0.0, 0.0])
    x = unit(x - (x @ axis) * axis)
    return np.array([x, axis, np.cross(x, axis)])


def draw_motor(rng: np.random.Generator) -> Motor:
    """Drive of the healthy kind with its own parameters."""
    return Motor(
        m=float(0.012 * rng.uniform(0.85, 1.2)),
        b=float(0.145 * rng.uniform(0.85, 1.15)),
        Fc=float(34.0 * rng.uniform(0.84, 1.16)),
        k=float(0.225 * rng.uniform(0.83, 1.17)),
        tau0=float(9.3 * rng.uniform(0.82, 1.18)),
    )


def draw_finger(rng: np.random.Generator, side: str, name: str) -> Finger:
    """Finger near the published one."""
    axes, centres = TABLE[side][name]
    tilted = np.array([unit(np.array(axis) + rng.normal(0.0, 0.022, 3)) for axis in axes])
    moved = np.array(centres) + rng.normal(0.0, 0.001, (2, 3))
    markers = np.array(
        [(np.array(SEGMENT_MARKERS[j]) + rng.normal(0.0, 0.0018, (3, 3))) @ finger_frame(tilted[j]) for j in (0, 1)]
    )
    coef = (rng.normal(1.02, 0.04), rng.normal(0.0, 0.06), rng.normal(0.56, 0.04), rng.normal(0.45, 0.06))
    return Finger(name, tilted, moved, ANGLE_FULL[name], tuple(float(c) for c in coef), markers, draw_motor(rng))


def draw_hand(rng: np.random.Generator) -> Hand:
    """Left or right hand, the index and one other finger in either order."""
    side = "right" if rng.random() < 0.5 else "left"
    sign = 1.0 if side == "right" else -1.0
    names = ["index", str(rng.choice(["middle", "ring", "little"]))]
    if rng.random() < 0.3:
        names.reverse()
    palm = np.array([[-0.034, 0.0, 0.0175], [0.029, 0.0215 * sign, 0.0255], [0.0255, -0.0205 * sign, 0.0235]])
    landmarks = {
        "origin": np.zeros(3),
        "medial": np.array([0.040, 0.022 * sign, 0.0]),
        "lateral": np.array([0.040, -0.022 * sign, 0.0]),
    }
    first, second = (draw_finger(rng, side, name) for name in names)
    return Hand(side, palm + rng.normal(0.0, 0.0015, (3, 3)), landmarks, (first, second))


def describe(hand: Hand, settings: dict[str, dict[str, dict[str, Any]]]) -> dict[str, Any]:
    """Kinematics and motor entries of the answer; `settings` by finger name."""
    kinematics: dict[str, Any] = {}
    motors: dict[str, Any] = {}
    for finger in hand.fingers:
        kinematics[finger.name] = {
            "axes": finger.axes.tolist(),
            "centres": finger.centres.tolist(),
            "angle_full": list(finger.angle_full),
            "coef": list(finger.coef),
        }
        motor: dict[str, Any] = asdict(finger.motor)
        dyn = settings.get(finger.name, {}).get("dyn", {})
        motor["Fs"] = finger.motor.Fc * dyn.get("Fs_ratio", 1.0)
        motor.update(dyn)
        motors[finger.name] = motor
    return {"kinematics": kinematics, "motor": motors}
