"""What differs from one laboratory to the next: its log, its cameras, how fast its drives are told to go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Laboratory:
    """log_step [s] with its jitter and lost share; position_noise [counts], current_noise [raw]; mocap_rate [Hz],
    marker_noise [m], gap_rate [per marker and second]; speed_max [%/s], acceleration [%/s^2]; rest before the first
    move and hold after each [s]."""

    log_step: float = 0.018
    log_jitter: float = 0.35
    log_loss: float = 0.003
    position_noise: float = 4.0
    current_noise: float = 5.0
    mocap_rate: float = 100.0
    marker_noise: float = 0.00015
    gap_rate: float = 0.027
    speed_max: float = 115.0
    acceleration: float = 900.0
    rest: float = 1.2
    hold: float = 0.35


def draw_laboratory(rng: np.random.Generator) -> Laboratory:
    """Another laboratory: 33 to 125 log rows and 60 to 200 frames a second, noise from a fifth to twice and more."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    return Laboratory(
        log_step=between(0.008, 0.03),
        log_jitter=float(rng.uniform(0.0, 0.6)),
        log_loss=float(rng.uniform(0.0, 0.02)),
        position_noise=between(0.5, 10.0),
        current_noise=between(2.0, 8.0),
        mocap_rate=float(rng.choice([60.0, 100.0, 120.0, 200.0])),
        marker_noise=between(0.00005, 0.00035),
        gap_rate=float(rng.uniform(0.0, 0.1)),
        speed_max=between(70.0, 150.0),
        acceleration=between(400.0, 1500.0),
        rest=float(rng.uniform(1.1, 2.0)),
        hold=float(rng.uniform(0.2, 0.8)),
    )
