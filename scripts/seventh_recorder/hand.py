"""Draws a hand: geometry round the published tables, motors, encoder ranges and marker layouts as measured."""

from dataclasses import dataclass, field

import numpy as np
from published_hand import AXES, CENTRES

FULL_ANGLES = {"index": (1.35, 1.2), "middle": (1.4, 1.25), "ring": (1.38, 1.22), "little": (1.3, 1.15)}
RANGES = {"index": (12100, 17900), "middle": (12050, 18050), "ring": (12200, 17800), "little": (12150, 17600)}
PREFIXES = {"index": "INx", "middle": "MIe", "ring": "RIg", "little": "LIe"}
LAYOUT_MM = np.array(
    [
        [[31.5, -0.3, 23.2], [36.3, 16.3, 23.0], [45.0, -14.0, 26.5]],
        [[29.5, 0.3, 24.0], [34.5, 16.5, 22.0], [42.5, -13.5, 27.5]],
    ]
)
PALM_MM = np.array([[-34.0, -1.0, 17.5], [29.0, 21.5, 25.5], [26.0, -20.5, 23.5]])
LANDMARK_MM = np.array([[0.0, 0.0, 0.0], [40.0, 22.0, 0.0], [40.0, -22.0, 0.0]])


@dataclass
class Finger:
    """One finger: lengths in mm, angles in rad, palm frame, open pose."""

    name: str
    axes: np.ndarray
    centres: np.ndarray
    angle_full: tuple[float, float]
    coef: np.ndarray
    markers: np.ndarray
    counts: tuple[int, int]
    motor: dict[str, float]

    @property
    def labels(self) -> list[str]:
        """The six marker labels, proximal first."""
        return [f"{PREFIXES[self.name]}_{s}{i}" for s in "PD" for i in (1, 2, 3)]


@dataclass
class Hand:
    """A hand of two recorded fingers; landmarks and palm markers in mm in the palm frame."""

    side: str
    fingers: list[Finger]
    landmarks: np.ndarray
    palm: np.ndarray = field(repr=False)


def _axis_frame(axis: np.ndarray) -> np.ndarray:
    """Columns x, y, z with y along a hinge axis and x as far forward as that allows."""
    x = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    x /= np.linalg.norm(x)
    return np.column_stack([x, axis, np.cross(x, axis)])


def draw_finger(name: str, side: str, rng: np.random.Generator) -> Finger:
    """One finger with the spread measured over the foreign sessions."""
    axes = np.array(AXES[side][name]) + rng.normal(0, 0.02, (2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    centres = 1000 * np.array(CENTRES[side][name]) + rng.normal(0, 0.8, (2, 3))
    coef = np.array([rng.normal(1.02, 0.045), rng.normal(0.0, 0.062), rng.normal(0.56, 0.038), rng.normal(0.45, 0.06)])
    layout = LAYOUT_MM + rng.normal(0, 1.8, (2, 3, 3))
    markers = np.stack([centres[j] + layout[j] @ _axis_frame(axes[j]).T for j in (0, 1)])
    base = {"m": 0.0122, "b": 0.1445, "Fc": 34.0, "k": 0.231, "tau0": 9.45}
    motor = {key: value * float(np.clip(rng.normal(1, 0.095), 0.75, 1.25)) for key, value in base.items()}
    motor |= {
        "kp": 22.0 * rng.normal(1, 0.01),
        "kd": 3.0 * rng.normal(1, 0.03),
        "sigma0": rng.uniform(55, 65),
        "sigma1": rng.uniform(0.2, 0.4),
    }
    low, high = (c + 50 * int(rng.choice([0, 0, 0, -1, 1])) for c in RANGES[name])
    return Finger(name, axes, centres, FULL_ANGLES[name], coef, markers, (low, high), motor)


def draw_hand(names: list[str], rng: np.random.Generator) -> Hand:
    """A left or right hand with these fingers."""
    side = str(rng.choice(["left", "right"]))
    mirror = np.array([1.0, 1.0 if side == "right" else -1.0, 1.0])
    fingers = [draw_finger(name, side, rng) for name in names]
    return Hand(side, fingers, LANDMARK_MM * mirror, (PALM_MM + rng.normal(0, 1.2, (3, 3))) * mirror)
