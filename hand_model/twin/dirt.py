"""The laboratory's dirt on markers and log: noise, gaps, ghosts, swapped labels, jitter, lost samples, quantisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .motor import STEP_S, DriveTerms, Motion
from .program import commands
from .schedule import TrialPlan
from .streams import stream
from .truth import HandTruth, LogNoise, MocapNoise, MotorTruth

Array = NDArray[np.float64]


def dirty_markers(world: dict[str, Array], noise: MocapNoise, seed: int, trial: TrialPlan) -> dict[str, Array]:
    """Markers as the motion capture reports them: label -> (n, 3) [m], nan in gaps; unlabelled ghosts as U001, ..."""
    rng = stream(seed, "markers", trial.name)
    n = len(next(iter(world.values())))
    minutes = n / noise.rate_hz / 60.0
    labels = list(world)
    out = {label: world[label] + noise.noise_m * rng.normal(size=(n, 3)) for label in labels}
    rng = stream(seed, "gaps", trial.name)
    for label in labels:
        for span in _spans(rng, n, rng.poisson(noise.gaps_per_minute * minutes), noise.gap_s * noise.rate_hz):
            out[label][span] = np.nan
    rng = stream(seed, "swaps", trial.name)
    for span in _spans(rng, n, rng.poisson(noise.swaps_per_minute * minutes), 0.5 * noise.rate_hz):
        first, second = rng.choice(labels, 2, replace=False)
        out[first][span], out[second][span] = out[second][span].copy(), out[first][span].copy()
    rng = stream(seed, "ghosts", trial.name)
    for i, span in enumerate(_spans(rng, n, rng.poisson(noise.ghosts_per_minute * minutes), 0.6 * noise.rate_hz)):
        near = str(rng.choice(labels))
        ghost = (
            world[near][span]
            + rng.normal(0, 0.04, 3)
            + np.cumsum(rng.normal(0, 2e-4, (span.stop - span.start, 3)), axis=0)
        )
        if rng.uniform() < noise.ghost_label_share:
            out[near][span] = ghost
        else:
            out[f"U{i + 1:03d}"] = np.full((n, 3), np.nan)
            out[f"U{i + 1:03d}"][span] = ghost
    return out


def _spans(rng: np.random.Generator, n: int, count: int, mean: float) -> list[slice]:
    """Random spans of frames, about `mean` long; the first second is left alone where there is room."""
    spans = []
    for _ in range(count):
        length = 1 + int(rng.exponential(max(mean, 1.0)))
        start = int(rng.integers(min(100, n // 2), n))
        spans.append(slice(start, min(n, start + length)))
    return spans


def log_columns(
    truth: HandTruth,
    motor: MotorTruth,
    trial: TrialPlan,
    motion: Motion,
    percent: Array,
    current: Array,
    seed: int,
    rate: float,
) -> dict[str, Array]:
    """Columns of the log (k,): time on its own clock, then what the hand reports; nan where a sample was lost.

    percent, current: (n,) as the channels deliver them at the simulation's steps, before noise.
    """
    noise, rng = truth.log, stream(seed, "log", trial.name)
    time_s = sample_times(noise, trial, seed)
    counts = motor.counts(np.interp(time_s, motion.time_s, percent)) + noise.encoder_counts * rng.normal(
        size=len(time_s)
    )
    measured = np.interp(time_s, motion.time_s, current) + _coloured(noise, time_s, stream(seed, "current", trial.name))
    setpoint, speed, limit = commands(trial.program, time_s)
    columns = {
        "time": noise.clock_offset_s + noise.clock_rate * rate * (trial.start_s + time_s),
        "position": counts,
        "current": measured,
        "setpoint": motor.counts(setpoint),
        "speed": speed,
        "current_limit": limit,
    }
    if noise.quantised:
        columns = {name: values if name == "time" else np.round(values) for name, values in columns.items()}
    rng = stream(seed, "lost", trial.name)
    for name in ("position", "current"):
        columns[name] = np.where(rng.uniform(size=len(time_s)) < noise.empty_share, np.nan, columns[name])
    return columns


def unrest_terms(motor: MotorTruth, trial: TrialPlan, seed: int, memory_s: float = 0.15) -> DriveTerms:
    """A random load on the drive with a memory of `memory_s` [s] (Ornstein-Uhlenbeck), drawn per trial."""
    from scipy.signal import lfilter

    n = round(trial.duration_s / STEP_S) + 2
    keep = np.exp(-STEP_S / memory_s)
    fresh = motor.unrest * stream(seed, "unrest", trial.name).normal(size=n)
    fresh[1:] *= np.sqrt(1.0 - keep**2)
    values = lfilter([1.0], [1.0, -keep], fresh).tolist()
    return DriveTerms(load=(lambda now: values[round(now.time_s / STEP_S)],))


def sample_times(noise: LogNoise, trial: TrialPlan, seed: int) -> Array:
    """Times (k,) [s] of the trial at which the log holds a sample: jittering, some lost, the window not that of the
    mocap.
    """
    rng = stream(seed, "sampling", trial.name)
    begin, end = rng.uniform(0.0, 0.08, 2)
    count = int((trial.duration_s + 1.0) / max(noise.interval_s - noise.jitter_s, 1e-4)) + 2
    steps = noise.interval_s + noise.jitter_s * rng.uniform(-1, 1, count)
    time_s = begin + np.cumsum(steps)
    time_s = time_s[time_s < trial.duration_s - end]
    return time_s[rng.uniform(size=len(time_s)) >= noise.lost_share]


def _coloured(noise: LogNoise, time_s: Array, rng: np.random.Generator) -> Array:
    white = noise.current_raw * rng.normal(size=len(time_s))
    if noise.current_memory_s <= 0:
        return white
    keep = np.exp(-np.diff(time_s, prepend=time_s[0]) / noise.current_memory_s)
    out, fresh = white.copy(), np.sqrt(1 - keep**2)
    for i in range(1, len(out)):
        out[i] = keep[i] * out[i - 1] + fresh[i] * white[i]
    return out
