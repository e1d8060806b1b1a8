"""The laboratory of one session: rates, noise, controller, strokes, files. Half of them are like the shown one."""

from dataclasses import dataclass, field

import numpy as np

FINGERS = ("index", "middle", "ring", "little", "thumb_1", "thumb_0")
COUNTS = {
    "index": (12100, 17900),
    "middle": (12050, 18050),
    "ring": (12200, 17800),
    "little": (12150, 17600),
    "thumb_1": (12300, 17200),
    "thumb_0": (12300, 17200),
}
FULL = [
    (100, 1.0),
    (0, 1.0),
    (100, 0.45),
    (0, 0.45),
    (100, 0.15),
    (0, 0.15),
    (100, 0.7),
    (0, 0.7),
    (100, 0.27),
    (0, 0.27),
]
TWELVE = [
    (100, 1.0),
    (0, 1.0),
    (50, 1.0),
    (100, 1.0),
    (50, 1.0),
    (0, 1.0),
    (100, 0.5),
    (0, 0.5),
    (50, 0.5),
    (100, 0.5),
    (50, 0.5),
    (0, 0.5),
]


@dataclass
class Lab:
    """Everything about a recording that is nobody's secret. s, mm, raw units, %/s."""

    like_shown: bool = True
    side: str = "right"
    fingers: tuple[str, ...] = ("index", "ring")
    log_step: float = 0.018  # mean s between rows
    log_jitter: float = 0.35  # half width of the step, share
    lost_rows: float = 0.003
    packet: int = 1  # rows that arrive, and are stamped, together
    lost_cells: float = 0.0
    mocap_rate: float = 100.0
    marker_noise: float = 0.15  # mm per coordinate
    current_noise: float = 5.0  # raw
    count_noise: float = 4.2  # counts
    gap_rate: float = 0.027  # per marker and second
    ghosts: float = 0.0  # share of flexion trials with one
    file: str = "c3d"
    full_speed: float = 115.0  # %/s at speed 255
    accel: float = 900.0  # %/s^2
    speed_full: int = 255
    controller: str = "track"  # "track" | "track_pi" | "speed_loop"
    shape: str = "trapezoid"  # "trapezoid" | "ramp" | "scurve"
    gains: tuple[float, float, float] = (22.0, 2.5, 0.0)
    dwell: float = 0.35
    command_jitter: float = 0.008  # s
    flexion: list[tuple[float, float]] = field(default_factory=lambda: FULL + FULL[:6])
    flexion_b: list[tuple[float, float]] = field(default_factory=lambda: list(FULL))
    excitation: list[tuple[float, float]] = field(default_factory=lambda: list(TWELVE))
    flexions: int = 2
    excitations: int = 3
    counts: dict[str, tuple[int, int]] = field(default_factory=lambda: dict(COUNTS))
    motor_spread: float = 1.0  # ratio by which motors may differ beyond the shown spread
    noise_factor: float = 1.0


def _other(lab: Lab, rng: np.random.Generator) -> None:
    lab.like_shown = False
    lab.log_step = 1.0 / np.exp(rng.uniform(np.log(30), np.log(130)))
    lab.log_jitter = rng.uniform(0.03, 0.4)
    lab.packet = int(rng.choice([1, 1, 1, 2, 3]))
    lab.lost_cells = float(rng.choice([0.0, 0.0, 0.002]))
    lab.mocap_rate = float(rng.choice([60, 100, 120, 150, 200, 250]))
    noise = np.exp(rng.uniform(np.log(0.3), np.log(2.5), 3))
    lab.marker_noise, lab.current_noise, lab.count_noise = 0.15 * noise[0], 5.0 * noise[1], 4.2 * noise[2]
    lab.gap_rate *= rng.uniform(0.3, 2.5)
    lab.ghosts = float(rng.choice([0.0, 0.3]))
    lab.file = str(rng.choice(["c3d", "tsv", "trc", "csv"]))
    lab.full_speed = rng.uniform(70, 160)
    lab.accel = rng.uniform(500, 1500)
    lab.speed_full = int(rng.choice([255, 100, 1023]))
    lab.controller = str(rng.choice(["track", "track_pi", "speed_loop"]))
    lab.shape = str(rng.choice(["trapezoid", "ramp", "scurve"]))
    if lab.controller == "speed_loop":
        lab.gains = (rng.uniform(0.6, 1.1) * lab.accel / lab.full_speed, rng.uniform(2.0, 3.2), rng.uniform(25, 60))
    else:
        lab.gains = (
            rng.uniform(14, 32),
            rng.uniform(1.6, 3.2),
            rng.uniform(10, 40) if lab.controller == "track_pi" else 0.0,
        )
    lab.dwell = rng.uniform(0.3, 0.8) + (2.0 / lab.gains[0] if lab.controller == "speed_loop" else 0.0)
    speeds = [
        1.0,
        *np.sort(rng.choice([0.12, 0.2, 0.3, 0.4, 0.55, 0.75, 0.85], 3 + rng.integers(2), replace=False))[::-1],
    ]
    speeds = [float(s) for s in speeds]
    lab.flexion = [move for s in speeds + speeds[: int(rng.integers(1, 4))] for move in ((100.0, s), (0.0, s))]
    lab.flexion_b = [move for s in speeds for move in ((100.0, s), (0.0, s))]
    if rng.random() < 0.5:
        lab.excitation = [(t, s) for s in (1.0, 0.5, 0.25) for t in (100, 30, 70, 0)]
    lab.flexions = int(rng.choice([2, 2, 3]))
    lab.excitations = int(rng.choice([2, 3, 4, 5]))
    for name in lab.counts:
        low = int(rng.uniform(150, 4000)) if rng.random() < 0.6 else int(rng.uniform(8000, 20000))
        span = int(np.exp(rng.uniform(np.log(700), np.log(9000))))
        lab.counts[name] = (low, low + span) if rng.random() < 0.75 else (200, 1200)
    lab.count_noise *= np.mean([b - a for a, b in lab.counts.values()]) / 5700.0
    lab.motor_spread = rng.uniform(1.3, 2.5)


def draw_lab(rng: np.random.Generator, weak: bool) -> Lab:
    """One laboratory; `weak` makes it noisier and its trials shorter."""
    lab = Lab(side=str(rng.choice(["left", "right"])))
    other = rng.random() < 0.5
    if other:
        _other(lab, rng)
    second = str(rng.choice(FINGERS[1:] if other else FINGERS[1:4]))
    first = (
        "index" if not other or second.startswith("thumb") else str(rng.choice([f for f in FINGERS[:4] if f != second]))
    )
    lab.fingers = tuple(rng.permutation([first, second]).tolist())
    span = {f: lab.counts[f][1] - lab.counts[f][0] for f in lab.fingers}
    lab.count_noise = max(min(lab.count_noise, 0.0012 * min(span.values())), 0.05)
    if weak:
        lab.noise_factor = 1.5
        lab.marker_noise, lab.current_noise, lab.count_noise = (
            1.5 * q for q in (lab.marker_noise, lab.current_noise, lab.count_noise)
        )
        lab.flexion = lab.flexion[: max(4, 2 * round(0.3 * len(lab.flexion)))]
        lab.flexion_b = lab.flexion_b[: max(4, 2 * round(0.3 * len(lab.flexion_b)))]
        lab.excitations = max(2, round(0.6 * lab.excitations))
    return lab


def actuator_of(finger: str) -> str:
    """Name of the motor that moves a finger."""
    return "thumb" if finger.startswith("thumb") else finger
