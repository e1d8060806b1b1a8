"""What a laboratory records with: rates, noise, gaps, columns, formats, clocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .geometry import log_uniform


@dataclass
class Laboratory:
    """Noise as standard deviations: current [raw], markers [mm], both before `noise_factor`."""

    noise_factor: float
    short: bool  # shorter recordings
    current_noise: float
    marker_noise: float
    top_speed: float  # [%/s]
    tilt_deg: float  # of the palm while a finger moves
    gravity_given: bool
    log_hz: float
    mocap_hz: float
    mocap_format: str
    tsv_time: bool  # columns Frame and Time in TSV files
    trc_metres: bool
    setpoint_column: bool
    speed_columns: bool
    temperature_column: bool
    gap_share: float  # of the frames of a marker
    ghosts: bool  # a marker jumps for a frame or three
    loss_share: float  # of the log's rows
    step_jitter: float  # of the log's steps, relative
    loss_form: str  # "row" or "cell"
    controller: int
    clock_start_s: float
    encoder_noise: float = 0.0  # [counts]
    log_rate: float = 1.0  # seconds of the log's clock per second


def draw_laboratory(rng: np.random.Generator, noise_factor: float, short: bool) -> Laboratory:
    """A laboratory; one whose recordings are short and noisy for other reasons has no coarse cameras as well."""
    current_noise = log_uniform(rng, 2.2, 5.5)
    marker_noise = log_uniform(rng, 0.05, 0.3 if noise_factor == 1 else 0.2)
    top_speed = log_uniform(rng, 75, 160)
    tilt = float(rng.choice([rng.uniform(1, 4), rng.uniform(1, 4), rng.uniform(10, 30)]))
    return Laboratory(
        noise_factor=noise_factor,
        short=short,
        current_noise=current_noise,
        marker_noise=marker_noise,
        top_speed=top_speed,
        tilt_deg=tilt,
        gravity_given=tilt > 8 or bool(rng.uniform() < 0.5),
        log_hz=log_uniform(rng, 42, 115),
        mocap_hz=float(rng.choice([60, 100, 120, 150, 200], p=[0.15, 0.4, 0.2, 0.15, 0.1])),
        mocap_format=str(rng.choice(["c3d", "tsv", "trc"], p=[0.4, 0.3, 0.3])),
        tsv_time=bool(rng.integers(2)),
        trc_metres=bool(rng.uniform() < 0.3),
        setpoint_column=bool(rng.uniform() < 0.75),
        speed_columns=bool(rng.uniform() < 0.6),
        temperature_column=bool(rng.uniform() < 0.25),
        gap_share=log_uniform(rng, 0.002, 0.012),
        ghosts=bool(rng.uniform() < 0.3),
        loss_share=log_uniform(rng, 0.001, 0.006),
        step_jitter=rng.uniform(0.08, 0.25),
        loss_form=str(rng.choice(["row", "cell"])),
        controller=int(rng.integers(4)),
        clock_start_s=float(rng.choice([rng.uniform(10, 5000), 1.7e9 + rng.uniform(0, 1e6)])),
        encoder_noise=rng.uniform(0, 1.2),
    )
