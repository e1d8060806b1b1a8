"""Draw a healthy hand: geometry, motors, noise and how the laboratory records it."""

from dataclasses import dataclass, field

import numpy as np
from published_hand import AXES, CENTRES

from eighth_recorder.simulate import DEFAULTS

FULL = {
    "index": (1.35, 1.2),
    "middle": (1.4, 1.25),
    "ring": (1.38, 1.22),
    "little": (1.3, 1.15),
    "thumb_0": (0.95, 1.0),
    "thumb_1": (0.9, 0.95),
}
SHORT = {"index": "INx", "middle": "MId", "ring": "RIg", "little": "LIe", "thumb_0": "THo", "thumb_1": "THs"}


@dataclass
class Finger:
    name: str
    actuator: str
    axes: np.ndarray  # (2, 3), palm frame
    centres: np.ndarray  # (2, 3), mm, palm frame, hand open
    full: tuple[float, float]  # rad
    curve: np.ndarray  # proximal angle / full over encoder fraction, rising powers from 1
    coupling: np.ndarray  # distal angle / full over proximal fraction
    markers: np.ndarray  # (2, 3, 3), mm from the segment's own centre, hand open
    labels: list[str]
    counts: tuple[float, float]
    motor: dict
    position_noise: float
    current_noise: float
    hidden: list = field(default_factory=list)  # (effect, parameters)


@dataclass
class Hand:
    side: str
    fingers: list[Finger]
    landmarks: np.ndarray  # origin, medial, lateral; mm
    palm_markers: np.ndarray
    mocap_rate: float
    log_rate: float
    jitter: float
    lost_rows: float
    marker_noise: float
    full_speed: float  # %/s at speed 255
    suffix: str
    short: bool
    pose_matters: bool = False


def _unit(v):
    return v / np.linalg.norm(v)


def draw_finger(rng, side: str, name: str, noisier: float) -> Finger:
    axes = np.array([_unit(np.array(a) + rng.normal(0, 0.02, 3)) for a in AXES[side][name]])
    centres = np.array(CENTRES[side][name]) * 1000 + rng.normal(0, 0.9, (2, 3))
    full = tuple(np.array(FULL[name]) * rng.uniform(0.95, 1.05))
    medial = 1 if side == "right" else -1
    shape = np.array([[31.0, 3 * medial, 25.0], [35.0, 19 * medial, 22.0], [45.0, -8 * medial, 29.0]])
    markers = np.array([shape * [s, 1, s] + rng.normal(0, 2.0, (3, 3)) for s in (1.0, 0.95)])
    low, span = (
        rng.uniform(11900, 12400) // 50 * 50,
        rng.choice([5450, 5600, 5800, 6000, 7200, 4800], p=[0.22, 0.22, 0.22, 0.22, 0.06, 0.06]),
    )
    motor = dict(DEFAULTS)
    motor.update(
        m=rng.uniform(0.0095, 0.0148),
        b=rng.uniform(0.115, 0.175),
        Fc=rng.uniform(26, 41),
        k=rng.uniform(0.17, 0.28),
        tau0=rng.uniform(7, 12),
        kp=rng.uniform(20, 27),
        kd=rng.uniform(0.8, 1.6),
        soft=rng.uniform(0.012, 0.032),
        bristle_x=rng.uniform(0.4, 0.65) if rng.random() < 0.85 else rng.uniform(0.1, 0.3),
        restart=float(rng.random() < 0.7),
        angle=full[0],
    )
    curve = np.array([rng.uniform(0.94, 1.11), rng.uniform(-0.1, 0.12), rng.choice([0.0, rng.uniform(-0.05, 0.05)])])
    coupling = np.array([rng.uniform(0.46, 0.62), rng.uniform(0.34, 0.54)])
    labels = [f"{SHORT[name]}_{part}{j}" for part in "PD" for j in (1, 2, 3)]
    return Finger(
        name,
        "thumb" if name.startswith("thumb") else name,
        axes,
        centres,
        full,
        curve,
        coupling,
        markers,
        labels,
        (low, low + span),
        motor,
        rng.uniform(3.2, 4.8) * noisier,
        rng.uniform(4.3, 5.7) * noisier,
    )


def draw_hand(rng, weak: bool) -> Hand:
    """One hand of two fingers (at times one or three) in the palm frame of its landmarks."""
    side = str(rng.choice(["left", "right"]))
    names = [
        str(n)
        for n in rng.permutation(["index", "middle", "ring", "little"])[: rng.choice([1, 2, 3], p=[0.08, 0.84, 0.08])]
    ]
    if rng.random() < 0.08:
        names[-1] = str(rng.choice(["thumb_0", "thumb_1"]))
    medial = 1 if side == "right" else -1
    landmarks = np.array([[0, 0, 0], [40.0, 22.0 * medial, 0], [40.0, -22.0 * medial, 0]])
    palm = np.array([[-34.0, 0, 18], [29.5, 22.0 * medial, 25.5], [25.5, -20.5 * medial, 23.5]]) + rng.normal(
        0, 1.6, (3, 3)
    )
    noisier = 1.4 if weak else 1.0
    return Hand(
        side,
        [draw_finger(rng, side, name, noisier) for name in names],
        landmarks,
        palm,
        mocap_rate=float(rng.choice([100, 100, 100, 120, 150, 200])),
        log_rate=float(rng.choice([55, 55, 55, 50, 60, 75, 90])),
        jitter=rng.uniform(0.25, 0.38),
        lost_rows=rng.uniform(0.001, 0.008),
        marker_noise=rng.uniform(0.12, 0.18) * noisier,
        full_speed=rng.uniform(106, 120),
        suffix=str(rng.choice(["c3d", "c3d", "c3d", "tsv"])),
        short=weak,
    )
