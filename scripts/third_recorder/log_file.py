"""What the drive logs of a trial: uneven steps, noise, rounding, lost rows, and whatever is hidden in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .geometry import Array
from .hand import Session
from .hidden import Bursts
from .motor import ROW_S
from .moves import Protocol
from .trial import Trial


def write_log(rng: np.random.Generator, session: Session, protocol: Protocol, path: Path, trial: Trial) -> None:
    """Record the log of a trial as CSV."""
    laboratory, finger = session.laboratory, trial.finger
    begin, end = rng.uniform(0, 0.5), trial.duration_s - rng.uniform(0, 0.4)
    time = draw_times(rng, session, begin, end)
    rows = len(time)
    current = np.interp(time - finger.faults.current_delay_s, trial.time, trial.current)
    current = current + rng.normal(size=rows) * laboratory.current_noise * laboratory.noise_factor
    bursts = session.faults.bursts
    if bursts and bursts.finger == finger.name:
        disturb(rng, bursts, time, current, begin, end)
    seen = np.interp(time, trial.time, trial.trace.seen)
    noise = laboratory.encoder_noise * rng.normal(size=rows) * 100 / finger.encoder_range
    row = np.clip(np.searchsorted(trial.time, time) - 1, 0, len(trial.time) - 1)
    target, share = trial.target[row], trial.speed_share[row]
    position, current = fake(session, protocol, trial, time, finger.counts(seen + noise), current, target - seen, share)
    clipping = finger.faults.clipping
    if clipping and clipping.where == "reading":
        current = np.clip(current, -clipping.level, clipping.level)
    columns = {
        "time": [f"{x:.5f}" for x in stamps(rng, session, trial, time)],
        "position": [f"{x:.0f}" for x in position],
        "current": [f"{x:.0f}" for x in np.round(current)],
    }
    if laboratory.setpoint_column:
        columns["setpoint"] = [f"{x:.0f}" for x in finger.counts(target)]
    if laboratory.speed_columns:
        columns["speed"] = [f"{255 * x:.0f}" for x in share]
        columns["current_limit"] = ["255"] * rows
    if laboratory.temperature_column:
        start, rise, time_s = protocol.temperature
        temperature = start + rise * (1 - np.exp(-(trial.since_s + time) / time_s)) + 0.15 * rng.normal(size=rows)
        columns["temperature"] = [f"{x:.1f}" for x in temperature]
    lost = rng.uniform(size=rows) < laboratory.loss_share
    lines = [",".join(columns), *kept_rows(rng, columns, lost, laboratory.loss_form)]
    path.write_text("\n".join(lines) + "\n")


def draw_times(rng: np.random.Generator, session: Session, begin: float, end: float) -> Array:
    """Uneven trial times [s] of the rows."""
    hz = session.laboratory.log_hz
    count = int((end - begin) * hz * 1.3)
    steps = np.clip(1 + session.laboratory.step_jitter * rng.normal(size=count), 0.35, 3) / hz
    time = begin + np.cumsum(steps)
    return time[time < end]


def disturb(rng: np.random.Generator, bursts: Bursts, time: Array, current: Array, begin: float, end: float) -> None:
    """Add bursts of noise to a current."""
    moment = begin
    while moment < end:
        moment += rng.exponential(bursts.pause_s) + bursts.length_s
        inside = (time > moment) & (time < moment + bursts.length_s)
        current[inside] += bursts.spread * rng.normal(size=inside.sum())


def fake(
    session: Session,
    protocol: Protocol,
    trial: Trial,
    time: Array,
    position: Array,
    current: Array,
    left: Array,
    share: Array,
) -> tuple[Array, Array]:
    """Position [counts] and current [raw] columns where one of them is not what it says; left: way to the target
    [%]."""
    faked = trial.finger.faults.faked
    if faked == "position_is_reference":
        position = trial.finger.counts(np.interp(time, trial.time, reference(session, trial)))
    elif faked == "current_dead":
        current = np.full(len(time), protocol.dead_level)
    elif faked == "current_is_command":
        current = np.where(np.abs(left) > 1.5, np.sign(left) * share * protocol.command_level, 0)
    return position, current


def reference(session: Session, trial: Trial) -> Array:
    """Targets behind a bound of the commanded speed [%], at the rows of the trace."""
    top_speed = session.laboratory.top_speed
    out = np.empty(len(trial.time))
    at = trial.target[0]
    for i, (target, share) in enumerate(zip(trial.target.tolist(), trial.speed_share.tolist(), strict=True)):
        step = share * top_speed * ROW_S
        at += min(max(target - at, -step), step)
        out[i] = at
    return out


def stamps(rng: np.random.Generator, session: Session, trial: Trial, time: Array) -> Array:
    """What the log's clock says at trial times [s]."""
    laboratory, jump_s = session.laboratory, session.faults.clock_jump_s
    out = laboratory.clock_start_s + laboratory.log_rate * (trial.start_s + time)
    if jump_s and trial.planned.kind == "flexion":
        out = out + jump_s * (time > rng.uniform(0.3, 0.7) * trial.duration_s)
        out = np.maximum.accumulate(out + np.arange(len(time)) * 1e-5)  # a logger never steps back
    return out


def kept_rows(rng: np.random.Generator, columns: dict[str, list[str]], lost: Array, loss_form: str) -> list[str]:
    """Lines of a log of which rows, or single cells, are lost."""
    lines = []
    for i, row in enumerate(zip(*columns.values(), strict=True)):
        if lost[i]:
            if loss_form == "row":
                continue
            cell = 1 + int(rng.integers(2))  # position or current
            row = (*row[:cell], "", *row[cell + 1 :])
        lines.append(",".join(row))
    return lines
