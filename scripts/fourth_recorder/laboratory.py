"""Where a session is recorded: rates, noise, controller, speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPEEDS = (1.0, 0.45, 0.15, 0.7, 0.27, 1.0, 0.45, 0.15)  # shares of the top speed
OTHER_SPEEDS = (1.0, 0.45, 0.15, 0.7, 0.27, 0.85, 0.35, 0.55)
# Figures that differ from one laboratory to the next, and by which factors; the order is part of what a seed means.
VARIED = (
    ("row_s", 0.65, 1.4),
    ("lost_rows", 0.5, 4),
    ("position_noise", 0.6, 1.6),
    ("current_noise", 0.7, 1.5),
    ("marker_noise", 0.65, 1.6),
    ("gap_rate", 0.5, 2),
    ("top_speed", 0.75, 1.3),
    ("acceleration", 0.7, 1.4),
    ("dwell_s", 0.7, 1.6),
    ("position_gain", 0.7, 1.4),
    ("speed_gain", 0.8, 1.3),
    ("wander", 0.5, 1.5),
    ("layout_spread", 1, 1.6),
)


@dataclass(frozen=True)
class Laboratory:
    """Noise is white, given by its standard deviation; position in % of a finger's range, current in raw units."""

    row_s: float = 0.018  # mean time between rows of a log
    row_jitter: float = 0.35  # share of it
    lost_rows: float = 0.002  # share
    position_noise: float = 4.0  # [counts]
    current_noise: float = 5.0  # [raw]
    marker_noise: float = 0.15  # [mm]
    gap_rate: float = 0.027  # [1/s] per marker
    mocap_hz: float = 100.0
    top_speed: float = 115.0  # [%/s]
    acceleration: float = 900.0  # [%/s^2]
    dwell_s: float = 0.35  # after each move
    wait_s: float = 1.2  # before the first move
    position_gain: float = 22.0  # [raw per %]
    speed_gain: float = 3.0  # [raw per %/s]
    wander: float = 1.0  # of the palm, 1: 2 mm and half a degree
    layout_spread: float = 1.0  # of the markers' places
    motor_spread: float = 1.0  # of the motors' figures, 1: 10 %
    probe_error: float = 0.3  # [mm] per axis
    speeds: tuple[float, ...] = SPEEDS  # of the cycles of the first flexion trial
    repeated_cycles: int = 5  # of them in the second flexion trial
    excitations: int = 3  # trials per finger
    turned: bool = False  # the cameras' axes lie anyhow
    temperature: bool = False  # a column of the log
    empty_cells: bool = False  # lost rows stay, without values
    mocap_format: str = "c3d"  # or tsv, trc


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between low and high whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_laboratory(rng: np.random.Generator, kind: str) -> Laboratory:
    """Half of all laboratories are alike. A weak session is noisier and shorter."""
    usual = Laboratory()
    drawn: dict[str, object] = {}
    if rng.random() >= 0.5:
        drawn = draw_differences(rng, usual)
    if kind == "weak":
        for name in ("position_noise", "current_noise", "marker_noise"):
            drawn[name] = drawn.get(name, getattr(usual, name)) * float(rng.uniform(1.5, 2.0))
        drawn["speeds"] = drawn.get("speeds", usual.speeds)[:5]
        drawn["repeated_cycles"] = int(rng.integers(3, 5))
        drawn["excitations"] = 2
    return Laboratory(**drawn)


def draw_differences(rng: np.random.Generator, usual: Laboratory) -> dict[str, object]:
    """What a laboratory has other than usual, by field."""
    drawn: dict[str, object] = {name: getattr(usual, name) * log_uniform(rng, low, high) for name, low, high in VARIED}
    drawn["motor_spread"] = 1.8
    drawn["mocap_hz"] = float(rng.choice([100.0, 100.0, 100.0, 120.0, 150.0]))
    if rng.random() < 0.4:
        count = int(rng.integers(5, 11))
        drawn["speeds"] = tuple(OTHER_SPEEDS[i] if i < 5 else float(rng.choice(OTHER_SPEEDS)) for i in range(count))
        drawn["repeated_cycles"] = int(min(count, rng.integers(4, 7)))
    drawn["turned"] = bool(rng.random() < 0.3)
    drawn["temperature"] = bool(rng.random() < 0.15)
    if rng.random() < 0.12:
        drawn["mocap_format"] = str(rng.choice(["tsv", "trc"]))
    drawn["empty_cells"] = bool(rng.random() < 0.15)
    return drawn
