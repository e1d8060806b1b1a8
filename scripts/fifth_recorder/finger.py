"""One finger of the hand at hand: geometry, encoder map, healthy motor."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifth_recorder.dynamics import Dynamics
from fifth_recorder.lab import Lab, actuator_of

TABLES = Path("/work/shared/published_tables.toml")
ANGLES = {
    "index": (1.35, 1.2),
    "middle": (1.4, 1.25),
    "ring": (1.38, 1.22),
    "little": (1.3, 1.15),
    "thumb_0": (0.95, 0.9),
    "thumb_1": (0.95, 0.9),
}
PROXIMAL = np.array([[0.0300, 0.0040, 0.0225], [0.0350, 0.0205, 0.0205], [0.0430, -0.0110, 0.0250]])  # m from the joint
DISTAL = np.array([[0.0310, 0.0045, 0.0225], [0.0360, 0.0210, 0.0200], [0.0440, -0.0080, 0.0265]])
PALM = np.array([[-0.034, 0.0, 0.0185], [0.029, 0.0215, 0.0255], [0.0265, -0.0205, 0.0245]])  # right: medial is +y
LANDMARKS = np.array([[0.0, 0.0, 0.0], [0.040, 0.022, 0.0], [0.040, -0.022, 0.0]])
SCREW = 0.007  # m from the joint's centre to a screw head


@dataclass
class Finger:
    """Axes, centres and markers in the landmark frame of the palm, m and rad; motor in raw units."""

    name: str
    actuator: str
    labels: list[str]
    axes: np.ndarray  # (2, 3)
    centres: np.ndarray  # (2, 3)
    full: tuple[float, float]
    coef: np.ndarray  # (2, 2): first two of the three shares of the maps s -> proximal, proximal -> distal
    markers: np.ndarray  # (2, 3, 3) with the finger open
    counts: tuple[int, int]
    motor: Dynamics

    def proximal(self, s: np.ndarray) -> np.ndarray:
        """Angle (rad) of the proximal joint at share s of the encoder range."""
        return self.full[0] * cubic(s, self.coef[0])

    def distal(self, q: np.ndarray) -> np.ndarray:
        """Angle (rad) of the distal joint at the proximal angle q."""
        return self.full[1] * cubic(q / self.full[0], self.coef[1])


def cubic(s: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Cubic through (0, 0) and (1, 1) with the first two shares given."""
    return s * (c[0] + s * (c[1] + s * (1.0 - c[0] - c[1])))


def draw_finger(name: str, lab: Lab, rng: np.random.Generator) -> Finger:
    """A healthy finger near the published figures."""
    table = tomllib.loads(TABLES.read_text())[lab.side]
    axes = np.array(table["axis"][name]) + rng.normal(0, 0.02, (2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    centres = np.array(table["centre"][name]) + rng.normal(0, 0.0010, (2, 3))
    turn = np.eye(3)
    if name.startswith("thumb"):
        turn = _frame(axes[0], centres[1] - centres[0])
    markers = np.stack(
        [
            centres[0] + (PROXIMAL + rng.normal(0, 0.002, (3, 3))) @ turn.T,
            centres[1] + (DISTAL + rng.normal(0, 0.002, (3, 3))) @ turn.T,
        ]
    )
    low, high = lab.counts[name]
    motor = draw_motor(lab, rng)
    motor.angle_full = ANGLES[name][0]
    prefix = name[:2].upper() + name[-1]
    return Finger(
        name,
        actuator_of(name),
        [f"{prefix}_{s}{i}" for s in "PD" for i in (1, 2, 3)],
        axes,
        centres,
        ANGLES[name],
        np.array([[rng.normal(1.02, 0.04), rng.normal(0.0, 0.06)], [rng.uniform(0.47, 0.61), rng.uniform(0.35, 0.53)]]),
        markers,
        (low, high),
        motor,
    )


def _frame(axis: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Columns: along the finger, its axis, out of its back."""
    x = along - axis * (along @ axis)
    x /= np.linalg.norm(x)
    return np.stack([x, axis, np.cross(x, axis)], axis=1)


def draw_motor(lab: Lab, rng: np.random.Generator) -> Dynamics:
    """Declared figures of a motor and the laboratory's controller."""
    far = np.exp(rng.uniform(-1, 1, 5) * np.log(lab.motor_spread))
    motor = Dynamics(
        m=rng.uniform(0.0102, 0.0142) * far[0] ** 0.5,
        b=rng.uniform(0.125, 0.165) * far[1],
        Fc=rng.uniform(29, 39) * far[2],
        k=rng.uniform(0.187, 0.258) * far[3],
        tau0=rng.uniform(7.7, 10.7) * far[4],
    )
    if motor.tau0 > 0.8 * motor.Fc:
        motor.tau0 = 0.8 * motor.Fc
    motor.bristle = 60.0 * motor.Fc / 34.0
    motor.gain_p, motor.gain_d, motor.gain_i = lab.gains
    motor.mode = 1.0 if lab.controller == "speed_loop" else 0.0
    motor.accel = lab.accel
    return motor


def palm_points(lab: Lab, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Palm markers and the three landmarks (m) in the landmark frame."""
    mirror = np.array([1.0, 1.0 if lab.side == "right" else -1.0, 1.0])
    return PALM * mirror + rng.normal(0, 0.0012, (3, 3)), LANDMARKS * mirror
