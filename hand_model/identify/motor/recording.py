"""Logs of one actuator in percent of its range, checked for what an identification of its motor needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError, did_you_mean
from ...session import Log, Session, Trial

Array = NDArray[np.float64]

KINDS = ("excitation", "flexion")
QUIET = 0.25  # of the noise elsewhere, below which a current at the top of its range is clipped


@dataclass(frozen=True)
class Scale:
    """Encoder counts at 0 % and 100 % of the range; raw full scale of the speed column."""

    counts_open: float
    counts_close: float
    speed_full: float

    @property
    def counts_per_percent(self) -> float:
        """Encoder counts per percent of range."""
        return (self.counts_close - self.counts_open) / 100

    def percent(self, counts: Array) -> Array:
        """Position [%] of encoder counts (n,)."""
        return (np.asarray(counts, float) - self.counts_open) / self.counts_per_percent


@dataclass(frozen=True)
class MotorTrial:
    """One log: time_s (n,) [s] from its first sample, position (n,) [%], current (n,) [raw] and, where the hand logs
    them, setpoint (n,) [%], speed (n,) [share of full], limit (n,) [raw]; None where it does not."""

    name: str
    time_s: Array
    position: Array
    current: Array
    setpoint: Array | None
    speed: Array | None
    limit: Array | None


def actuator_trials(
    session: Session, actuator: str, kinds: Sequence[str] = KINDS, validate: bool | None = False
) -> tuple[Trial, ...]:
    """Trials with a log of all fingers that the actuator drives; raises IdentificationError for an unknown actuator."""
    names = [a.name for a in session.actuators]
    if actuator not in names:
        raise IdentificationError(f'{session.path}: no actuator "{actuator}"; {did_you_mean(actuator, names)}')
    fingers = {f.name for f in session.fingers if f.actuator == actuator}
    found = [t for kind in kinds for t in session.select(kind, validate=validate) if t.finger in fingers and t.log_path]
    return tuple(found)


def trial_scale(logs: Sequence[tuple[str, Log]], speed_full: float | None = None) -> Scale:
    """Range of an actuator [counts]: the extreme setpoints, or the extremes of the recorded positions where none is
    logged.

    logs: (trial name, log). Raises IdentificationError where position never moves or a column is missing.
    """
    low, high, full = [], [], []
    for name, log in logs:
        for column in ("position", "current"):
            if column not in log.columns:
                raise IdentificationError(f'{name}: no column "{column}"; {did_you_mean(column, log.columns)}')
        signal = log.columns.get("setpoint", log.columns["position"])
        signal = signal[np.isfinite(signal)]
        if signal.size:
            low.append(signal.min())
            high.append(signal.max())
        if "speed" in log.columns:
            full.append(np.nanmax(log.columns["speed"]))
    moved = [
        np.ptp(q[np.isfinite(q)]) if np.isfinite(q).any() else 0.0 for q in (log.columns["position"] for _, log in logs)
    ]
    if not low or max(high) - min(low) < 1e-9 or max(moved) < 0.1 * (max(high) - min(low)):
        names = ", ".join(name for name, _ in logs)
        raise IdentificationError(
            f"{names}: the actuator does not move; excitation over most of its range, both ways, is needed"
        )
    scale = speed_full or (max(full) if full else 1.0)
    return Scale(float(min(low)), float(max(high)), float(scale) or 1.0)


def motor_trial(name: str, log: Log, scale: Scale) -> MotorTrial:
    """One log in percent, lost samples left out; raises IdentificationError with fewer than 50 usable samples."""
    c = log.columns
    good = np.isfinite(log.time_s) & np.isfinite(c["position"]) & np.isfinite(c["current"])
    good[1:] &= np.diff(np.maximum.accumulate(np.where(np.isfinite(log.time_s), log.time_s, -np.inf))) > 0
    if good.sum() < 50:
        raise IdentificationError(
            f"{name}: {int(good.sum())} samples hold position and current; at least 50 are needed"
        )

    def held(column: str) -> Array | None:
        if column not in c or not np.isfinite(c[column]).any():
            return None
        index = np.where(np.isfinite(c[column]), np.arange(len(c[column])), -1)
        index = np.maximum.accumulate(index)
        index[index < 0] = index[index >= 0][0]
        return c[column][index][good]

    setpoint, speed, limit = held("setpoint"), held("speed"), held("current_limit")
    return MotorTrial(
        name,
        log.time_s[good] - log.time_s[good][0],
        scale.percent(c["position"][good]),
        c["current"][good],
        None if setpoint is None else scale.percent(setpoint),
        None if speed is None else speed / scale.speed_full,
        limit,
    )


def check_trials(trials: Sequence[MotorTrial]) -> None:
    """Raise IdentificationError where the current is constant, saturated, a command or no drive's, or the motion goes
    one way only."""
    v = [_coarse_velocity(t) for t in trials]
    fastest = max(float(np.quantile(np.abs(x), 0.98)) for x in v)
    share = [sum(float(np.mean(sign * x > 0.25 * fastest)) for x in v) for sign in (1, -1)]
    if min(share) < 0.02 * len(trials):
        way = "extension" if share[1] < share[0] else "flexion"
        raise IdentificationError(
            f"{', '.join(t.name for t in trials)}: the log holds no {way}; "
            "motion in both directions separates friction from spring"
        )
    for t in trials:
        _check_current(t)
    flexing, extending = (
        np.concatenate([t.current[sign * x > 0.25 * fastest] for t, x in zip(trials, v, strict=True)])
        for sign in (1, -1)
    )
    friction = flexing.mean() - extending.mean()
    if friction < 5 * np.sqrt(flexing.var() / len(flexing) + extending.var() / len(extending)):
        raise IdentificationError(
            f'{", ".join(t.name for t in trials)}: column "current" is no higher in flexion than in extension '
            f"({friction:.3g} raw); a drive's current overcomes friction, positive towards flexion"
        )


def _coarse_velocity(t: MotorTrial) -> Array:
    """Velocity [%/s] by a local line over about nine samples: only to tell moving from resting."""
    k = 4
    i = np.arange(len(t.time_s))
    a, b = np.clip(i - k, 0, None), np.clip(i + k, None, len(i) - 1)
    return (t.position[b] - t.position[a]) / (t.time_s[b] - t.time_s[a])


def _check_current(t: MotorTrial) -> None:
    u = t.current
    if np.ptp(u) == 0:
        raise IdentificationError(
            f'{t.name}: column "current" is constant ({u[0]:g}); a measured current varies with the load'
        )
    moving = np.abs(_coarse_velocity(t)) > 5.0
    if moving.sum() > 20 and np.mean(np.diff(u)[moving[1:]] == 0) > 0.9:
        raise IdentificationError(
            f'{t.name}: column "current" holds its value while the finger moves; it is a command, not a measurement'
        )
    for side in (u.max(), u.min()):
        at = u == side
        run = at[1:] & at[:-1]
        if abs(side) > 0 and moving.sum() > 20 and run.sum() > 0.05 * len(u) and abs(side) > 0.5 * np.abs(u).max():
            command = _follows_command(t)
            if command:
                break
            raise IdentificationError(
                f'{t.name}: column "current" is saturated at {side:g} in {100 * at.mean():.0f} % of the samples; '
                "friction cannot be read from a clipped current"
            )
    command = _follows_command(t)
    if command:
        raise IdentificationError(
            f'{t.name}: column "current" {command}; it is a command, not a measurement, and is not fitted'
        )
    for side in (1, -1):
        share, ceiling = _quiet_ceiling(side * u[moving])
        if share > 0.05:
            raise IdentificationError(
                f'{t.name}: column "current" is saturated near {side * ceiling:.3g} in {100 * share:.0f} % of the samples in '
                "motion, where it hardly varies; friction cannot be read from a clipped current"
            )


def _quiet_ceiling(u: Array) -> tuple[float, float]:
    """Share of samples (n,) that lie at the top of their range with hardly any of the others' noise, and that top; 0
    where none do.

    A reading that clips loses its noise at the ceiling, whatever is added after it; noise within a band as wide as its
    own deviation keeps about half of it.
    """
    if len(u) < 50:
        return 0.0, 0.0
    ceiling, step = float(np.quantile(u, 0.99)), np.abs(np.diff(u))
    noise = 1.05 * float(np.median(step))  # deviation of a Gaussian, of whose differences this is the median
    near = np.abs(u - ceiling) < noise
    pairs, free = near[1:] & near[:-1], ~near[1:] & ~near[:-1]
    if pairs.sum() < 10 or free.sum() < 10 or ceiling < 0.5 * float(np.abs(u).max()):
        return 0.0, ceiling
    quiet = np.median(step[pairs]) < QUIET * np.median(step[free])
    return (float(pairs.mean()) if quiet else 0.0), ceiling


def _follows_command(t: MotorTrial) -> str | None:
    """What the current is an exact function of, or None: within 0.5 % of its variance, of setpoint, speed, limit and
    position."""
    named = {"setpoint": t.setpoint, "speed": t.speed, "current_limit": t.limit, "position": t.position}
    for name, column in named.items():
        if column is None or np.ptp(column) == 0:
            continue
        if len(np.unique(column)) <= 0.02 * len(column):  # a step signal: is the current a function of its level?
            _, level = np.unique(column, return_inverse=True)
            mean = np.bincount(level, t.current) / np.bincount(level)
            fitted = mean[level]
        else:
            # a reference runs ahead of the position that follows it, by its velocity times a delay
            x = np.c_[column, _coarse_velocity(t), np.ones(len(column))]
            fitted = x @ np.linalg.lstsq(x, t.current, rcond=None)[0]
        if np.var(t.current - fitted) < 0.005 * np.var(t.current):
            return (
                f'equals a function of column "{name}" to {100 * np.std(t.current - fitted) / np.std(t.current):.1f} %'
            )
    return None


def motor_trials(session: Session, actuator: str) -> tuple[list[MotorTrial], Scale]:
    """The trials from which a motor is identified, checked, and their scale (validation trials take no part).

    Raises IdentificationError where there are none, or where they hold no excitation, one direction only, or a current
    that is constant, clipped or a command.
    """
    found = actuator_trials(session, actuator)
    if not found:
        raise IdentificationError(
            f'{session.path}: actuator "{actuator}" has no excitation or flexion trial with a log; '
            "one with motion both ways is needed"
        )
    full = next(a.speed_full for a in session.actuators if a.name == actuator)
    logs = [(t.name, t.log()) for t in found]
    scale = trial_scale(logs, full)
    trials = [motor_trial(name, log, scale) for name, log in logs]
    check_trials(trials)
    return trials, scale
