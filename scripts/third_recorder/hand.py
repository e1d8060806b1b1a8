"""A healthy hand drawn at random: palm, probe, fingers with motor, linkage, encoder and markers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from published_hand import AXES, CENTRES

from .controllers import draw_motor
from .geometry import Array, log_uniform, rotation, unit
from .hidden import FingerFaults, SessionFaults
from .kinematics import Linkage
from .laboratory import Laboratory, draw_laboratory
from .motor import Motor

SEGMENTS = ("proximal", "distal")
FINGERS = ["index", "middle", "ring", "little", "thumb_0", "thumb_1"]
PALM_LABELS = ["PO", "PM", "PL"]
FULL_RAD = {"finger": (1.36, 1.22), "thumb": (0.85, 0.7)}
SUPPORT_MM = [[0, 0, 0], [4, 16, 4], [14, -12, 6]]  # markers of a segment: along, along the axis, dorsal


@dataclass
class Finger:
    """One finger with its motor. encoder: counts at 0 % and over the range. labels, markers: by segment, three each;
    positions [mm] in the landmark frame, hand open."""

    name: str
    motor: Motor
    linkage: Linkage
    encoder_zero: float
    encoder_range: float
    labels: list[list[str]]
    markers: list[Array]
    faults: FingerFaults = field(default_factory=FingerFaults)

    @property
    def actuator(self) -> str:
        """Both thumb joints hang on an actuator of the same name."""
        return "thumb" if self.name.startswith("thumb") else self.name

    def counts(self, percent: Array) -> Array:
        """Encoder counts of positions."""
        return np.round(self.encoder_zero + percent * self.encoder_range / 100)


@dataclass
class Session:
    """A hand in a laboratory. Lengths in mm in the landmark frame; probe: its markers in metres in its own frame;
    world: turn and origin [mm] of the landmark frame."""

    side: str
    laboratory: Laboratory
    size: float = 1.0
    palm: Array = field(default_factory=lambda: np.zeros((3, 3)))
    landmarks: dict[str, Array] = field(default_factory=dict)
    fingers: dict[str, Finger] = field(default_factory=dict)
    probe: dict[str, list[float]] = field(default_factory=dict)
    world: tuple[Array, Array] = field(default_factory=lambda: (np.eye(3), np.zeros(3)))
    faults: SessionFaults = field(default_factory=SessionFaults)
    name: str = ""

    @property
    def handed(self) -> int:
        """1 for a right hand, -1 for a left."""
        return 1 if self.side == "right" else -1


def draw_session(rng: np.random.Generator, noise_factor: float = 1.0, short: bool = False) -> Session:
    """A healthy hand of two fingers, seldom three, and the laboratory around it."""
    side = str(rng.choice(["left", "right"]))
    names = draw_fingers(rng, 3 if rng.uniform() < 0.12 else 2)
    session = Session(side, draw_laboratory(rng, noise_factor, short))
    session.size = size = log_uniform(rng, 0.65, 1.55)
    style = int(rng.integers(3))
    sign = session.handed
    palm = np.array([[-35, -3 * sign, 15], [28, 21 * sign, 24], [26, -20 * sign, 21]], float)
    session.palm = palm * (size * 0.5 + 0.5) + rng.normal(size=(3, 3)) * 3
    session.landmarks = {
        "origin": np.zeros(3),
        "medial": np.array([40.0, 22 * sign, 0]) * size,
        "lateral": np.array([40.0, -22 * sign, 0]) * size,
    }
    for name in names:
        session.fingers[name] = draw_finger(rng, session, name, style)
    session.probe = {
        "T1": [0, 0, rng.uniform(0.07, 0.1)],
        "T2": [0, 0, rng.uniform(0.115, 0.14)],
        "T3": [rng.uniform(0.025, 0.04), 0, 0.11],
        "T4": [-rng.uniform(0.02, 0.03), rng.uniform(0.005, 0.012), 0.118],
    }
    turned = rotation(unit(rng.normal(size=3)), np.array(rng.uniform(0.1, 0.7)))
    session.world = turned, rng.normal(size=3) * 200 + [300, -100, 1000]
    return session


def draw_fingers(rng: np.random.Generator, count: int) -> list[str]:
    """Names; a hand has one of the two thumbs."""
    while True:
        names = [str(name) for name in rng.choice(FINGERS, count, replace=False)]
        if not ("thumb_0" in names and "thumb_1" in names):
            return names


def draw_finger(rng: np.random.Generator, session: Session, name: str, style: int) -> Finger:
    """A finger near the published one, scaled to the hand; style: of the labels."""
    laboratory = session.laboratory
    motor = draw_motor(rng, laboratory.controller, laboratory.top_speed)
    linkage = draw_linkage(rng, session.side, name, session.size)
    motor.full_angle = linkage.full[0]
    counts = log_uniform(rng, 1500, 9500)
    zero = float(np.round(rng.uniform(200, 14000)))
    markers = [draw_markers(rng, linkage, joint, session.size) for joint in range(2)]
    return Finger(name, motor, linkage, zero, counts, labels(name, style), markers)


def draw_linkage(rng: np.random.Generator, side: str, name: str, size: float) -> Linkage:
    """Joints of a finger."""
    centres = np.array(CENTRES[side][name]) * 1e3
    axes = unit(np.array(AXES[side][name]) + rng.normal(size=(2, 3)) * 0.035)
    proximal = centres[0] * (0.6 + 0.4 * size) + rng.normal(size=3) * 1.5
    distal = proximal + (centres[1] - centres[0]) * size + rng.normal(size=3) * 0.8
    drive = np.array([1 + rng.uniform(-0.12, 0.12), rng.uniform(-0.12, 0.12), rng.uniform(-0.08, 0.08)])
    drive[0] += 1 - drive.sum()
    coupling = np.array(
        [rng.uniform(0.45, 0.8), rng.uniform(0.1, 0.5), rng.uniform(-0.15, 0.15), rng.uniform(-0.1, 0.1)]
    )
    coupling /= coupling.sum()
    full = np.array(FULL_RAD["thumb" if name.startswith("thumb") else "finger"]) * rng.uniform(0.85, 1.12, 2)
    return Linkage(axes, np.array([proximal, distal]), full, drive, coupling)


def draw_markers(rng: np.random.Generator, linkage: Linkage, joint: int, size: float) -> Array:
    """Three markers of a segment [mm], in the landmark frame, hand open."""
    along, dorsal = linkage.frame(joint)
    own = np.array(SUPPORT_MM) * rng.uniform(0.8, 1.25) + rng.normal(size=(3, 3)) * 1.5
    own = own + [rng.uniform(14, 28) * size**0.5, rng.uniform(-3, 5), rng.uniform(15, 28)]
    return linkage.centres[joint] + own[:, :1] * along + own[:, 1:2] * linkage.axes[joint] + own[:, 2:] * dorsal


def labels(finger: str, style: int) -> list[list[str]]:
    """Names of a finger's markers by segment, in one of three fashions."""
    tag = finger if "_" in finger else finger.capitalize()
    return [
        [
            (f"{tag[:2].upper()}{letter}{i}", f"{finger}_{word}_{i}", f"{tag[0]}{tag[-1]}{letter}x{i}")[style]
            for i in (1, 2, 3)
        ]
        for letter, word in (("P", "prox"), ("D", "dist"))
    ]
