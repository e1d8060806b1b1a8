"""The log of a trial: what the drive says, with clocks, noise and faults."""

from __future__ import annotations

import numpy as np

from .geometry import Array
from .laboratory import Laboratory
from .motor import ROW_S
from .moves import commands
from .session import Session
from .trial import Trial

COLUMNS = "time,position,current,setpoint,speed,current_limit"


def channels(trial: Trial) -> tuple[Array, Array]:
    """Position [%] and current [raw] at every row of the trace as the log would have them without noise."""
    trace, log, begun_s = trial.trace, trial.log, trial.planned.begun_s
    time, position, current = trace.time, trace.seen.copy(), trace.current.copy()
    if log.current_delay:
        current = np.interp(time - log.current_delay, time, current)
    if log.gain_step:
        current = current * np.where(time > log.gain_step[0] * trial.duration_s, log.gain_step[1], 1)
    if log.offset_swing:
        amplitude, period, phase = log.offset_swing
        current = current + amplitude * np.sin(2 * np.pi * (time + begun_s) / period + phase)
    if log.crosstalk:
        amplitude, period = log.crosstalk
        current = current + amplitude * (np.sin(2 * np.pi * (time + begun_s * 0.73) / period) > 0.5)
    if log.missed_counts:
        missed = np.zeros_like(time)
        for move, start in zip(trial.planned.moves, trial.starts, strict=True):
            if move.share > 0.6:
                missed += time > start + 0.3
        low, high = trial.finger.counts
        position = position - log.missed_counts / (high - low) * 100 * missed
    if log.reading_limit:
        current = np.clip(current, -log.reading_limit, log.reading_limit)
    return position, current


def row_times(rng: np.random.Generator, laboratory: Laboratory, duration_s: float) -> tuple[Array, Array]:
    """Times [s] of the rows, and which of them have lost their values."""
    count = int(duration_s / laboratory.row_s * 1.3) + 50
    spread = laboratory.row_jitter
    times = np.cumsum(laboratory.row_s * rng.uniform(1 - spread, 1 + spread, count))
    times = times[times < duration_s]
    lost = rng.random(len(times)) < laboratory.lost_rows
    if laboratory.empty_cells:
        return times, lost
    times = times[~lost]
    return times, np.zeros(len(times), bool)


def in_bursts(rng: np.random.Generator, trial: Trial, times: Array, noise: float) -> Array:
    """Noise [raw] that comes in bursts."""
    factor, length, share = trial.log.bursts
    count = max(1, int(trial.duration_s * share / length))
    inside = np.zeros(len(times), bool)
    for begin in rng.uniform(0, trial.duration_s, count):
        inside |= (times > begin) & (times < begin + length)
    return inside * rng.normal(0, noise * (factor**2 - 1) ** 0.5, len(times))


def measured(rng: np.random.Generator, session: Session, trial: Trial, times: Array) -> tuple[Array, Array]:
    """Position [counts] and current [raw] in the rows, of the drive's last tick of 1 ms."""
    laboratory, trace = session.laboratory, trial.trace
    low, high = trial.finger.counts
    ticks = np.floor(times * 1000) / 1000
    clean_position, clean_current = channels(trial)
    position = low + np.interp(ticks, trace.time, clean_position) / 100 * (high - low)
    position = position + rng.normal(0, laboratory.position_noise, len(times))
    current = np.interp(ticks, trace.time, clean_current) + rng.normal(0, laboratory.current_noise, len(times))
    if trial.log.bursts:
        current += in_bursts(rng, trial, times, laboratory.current_noise)
    if trial.log.reading_limit:
        current = np.clip(current, -trial.log.reading_limit, trial.log.reading_limit)
    dead = trial.log.dead
    target, share = commands(trial.planned.moves, trial.starts, times)
    if dead == "position_reference":
        position = low + np.interp(times, trace.time, trace.reference) / 100 * (high - low)
    elif dead == "position_setpoint":
        position = low + target / 100 * (high - low)
    elif dead == "current_dead":
        current = np.full(len(times), session.dead_current)
    elif dead == "current_command":
        direction = np.sign(np.interp(times, trace.time, np.gradient(trace.reference, ROW_S)))
        current = direction * np.round(share * 255 * 0.35)
    return position, current


def log_text(rng: np.random.Generator, session: Session, trial: Trial) -> str:
    """The file."""
    low, high = trial.finger.counts
    begun_s = trial.planned.begun_s
    times, lost = row_times(rng, session.laboratory, trial.duration_s)
    position, current = measured(rng, session, trial, times)
    target, share = commands(trial.planned.moves, trial.starts, times)
    temperature = None
    if session.laboratory.temperature:
        temperature = 24 + 6 * (1 - np.exp(-(begun_s + times) / 90)) + rng.normal(0, 0.15, len(times))
    clock = 1000 + begun_s + rng.uniform(-3, 3) + times * (trial.log.skew + rng.normal(0, 2e-5))
    values = [np.rint(each).astype(int) for each in (position, current)]
    setpoint, speed = (np.rint(each).astype(int) for each in (low + target / 100 * (high - low), share * 255))
    rows = [COLUMNS + ("" if temperature is None else ",temperature")]
    for i in range(len(times)):
        reading = "," if lost[i] else f"{values[0][i]},{values[1][i]}"
        end = "" if temperature is None else f",{temperature[i]:.2f}"
        rows.append(f"{clock[i]:.5f},{reading},{setpoint[i]},{speed[i]},255{end}")
    return "\n".join(rows) + "\n"
