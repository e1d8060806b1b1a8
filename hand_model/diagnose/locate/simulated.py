"""A drive as its commands explain it: how late its current is logged, and its motion without the noise of its encoder.

Where a controller explains the recorded motion but for what changes slowly, the simulated motion and that slow rest are
a better estimate of the state than any smoothing of the recorded motion: velocity and acceleration carry little noise,
starts and stops are not smeared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...effects.path import runs
from ...errors import HandModelError
from ...session import Log, Session, Trial
from .ceiling import Ceiling, Run, ceiling_of
from .motion import Motion, local_quadratic, since_rest

if TYPE_CHECKING:
    from ...identify.motor import MotorFit

Array = NDArray[np.float64]

# times the noise of the encoder: a simulated motion that is farther from the recorded one, beside what is slow, lacks
# something
TRUE_TO = 1.1
SLOW_S, SLOW_SAMPLES = 0.1, 4.0  # width of the kernel, at least, by which the rest is smoothed
FEWEST = 8  # samples in a row of which something slow can be told
COVERED = 0.9  # of the samples in motion that the simulated moves must hold
MOVES = 0.01  # of the fastest speed
IN_TIME = 3.0  # standard deviations by which a current may be late that is held against what is asked for
SAME_S = 1e-5  # times of one row of a log agree to this, whatever the clock counts from
DIFFERENCE_S = 2e-3  # half width of the differences that make velocity and acceleration of a simulated position


@dataclass(frozen=True)
class SimulatedDrive:
    """delay_s: by how much the current of `actuator` is late, negative where its position is; doubt_s: standard
    deviation, infinite where the current is not explained. motions: trial -> time (n,) [s], position, velocity and
    acceleration (n,) [% and per second], nan between moves; none where the simulation lacks something. ceiling: a limit
    of the current beyond which the controller asks for more, where it shows one."""

    actuator: str
    delay_s: float
    doubt_s: float
    motions: Mapping[str, tuple[Array, Array, Array, Array]] = field(default_factory=dict)
    ceiling: Ceiling | None = None


def simulated_drive(session: Session, actuator: str) -> SimulatedDrive | None:
    """One drive simulated from its commands; None where these are not known."""
    from ...identify.motor import identify_motor
    from ...identify.motor.channel import channel_delay
    from ...identify.motor.parameters import BOUNDS
    from .drive import drive_trials

    try:
        fit = identify_motor(session, actuator)
        if fit.output_error is None:
            return None
        delay_s, doubt_s = channel_delay(fit.output_error, BOUNDS) if fit.predictive else (0.0, np.inf)
        trials = drive_trials(session)[actuator]
        logs = {t.name: t.log() for t in trials}
        runs_ = {t.name: _along(fit, t, logs[t.name]) for t in trials}
        motions = {name: None if run is None else _motion(run) for name, run in runs_.items()}
        in_time = abs(delay_s) <= IN_TIME * doubt_s + DIFFERENCE_S and not any(log.uneven for log in logs.values())
        ceiling = _ceiling(fit, [run for run in runs_.values() if run is not None]) if in_time else None
    except (HandModelError, np.linalg.LinAlgError):  # a drive that cannot be simulated is judged by its recorded motion
        return None
    told = {name: m for name, m in motions.items() if m is not None}
    # one kind of state in one balance
    return SimulatedDrive(actuator, delay_s, doubt_s, told if len(told) == len(motions) else {}, ceiling)


def _along(fit: MotorFit, recorded: Trial, log: Log) -> Run | None:
    """A recording's moves simulated; None where none starts from rest."""
    from ...identify.motor.predict import aligned_moves
    from ...identify.motor.recording import motor_trial
    from ...identify.motor.residuals import simulate_states

    trial, found = motor_trial(recorded.name, log, fit.scale), fit.output_error
    data, own = aligned_moves(fit, trial)
    if not data or found is None:
        return None
    state = np.full((3, len(trial.time_s)), np.nan)
    for m, rows in zip(data, simulate_states(data, found.values, own, found.controller, DIFFERENCE_S), strict=True):
        state[:, m.index + 1 : m.index + 1 + len(m.time_s)] = rows.T
    first = log.time_s[
        np.isfinite(log.time_s) & np.isfinite(log.columns["position"]) & np.isfinite(log.columns["current"])
    ][0]
    return Run(
        trial, recorded.validate, float(first), tuple(data), own, state, _slow(trial.time_s, trial.position - state[0])
    )


def _motion(run: Run) -> tuple[Array, Array, Array, Array] | None:
    """Time, position, velocity and acceleration of a log's simulated moves; None where they are farther from the
    recorded ones than noise."""
    trial = run.trial
    away = trial.position - run.simulated[0] - run.slow[0]
    if np.sqrt(np.nanmean(away**2)) > TRUE_TO * _encoder_noise(run):
        return None
    return (trial.time_s + run.first_s, *(run.simulated + run.slow))


def _encoder_noise(run: Run) -> float:
    from ...identify.motor.noise import reading_noise

    return reading_noise([(run.trial.position, run.trial.time_s)])


def _ceiling(fit: MotorFit, runs_: list[Run]) -> Ceiling | None:
    """The limit of the current, where the controller's asking shows one."""
    from ...identify.motor.noise import white_noise

    found = fit.output_error
    if not runs_ or found is None or found.controller != "profile":  # else no reference is known beforehand
        return None
    sensed = float(np.mean([white_noise(run.trial.current, run.trial.time_s) for run in runs_]))
    asked = found.values["gain"] * float(np.mean([_encoder_noise(run) for run in runs_]))
    return ceiling_of(fit, runs_, float(np.hypot(sensed, asked)))


def _slow(time_s: Array, rest: Array) -> Array:
    """What is slow of the recorded less the simulated motion (n,), nan between moves, and its two derivatives, (3,
    n)."""
    width_s = max(SLOW_S, SLOW_SAMPLES * float(np.median(np.diff(time_s))))
    out, known = np.full((3, len(rest)), np.nan), np.isfinite(rest)
    for begin, end in runs(known):
        k = slice(begin, end)
        out[:, k] = local_quadratic(time_s[k], rest[k], width_s) if end - begin > FEWEST else 0.0
    return out


def with_simulated(motion: Motion, time_s: Array, simulated: tuple[Array, Array, Array, Array]) -> Motion | None:
    """The motion at times (n,) [s] with the simulated state, at rest between the moves; None where these hold too
    little of it."""
    at = np.searchsorted(simulated[0], time_s - SAME_S).clip(0, len(simulated[0]) - 1)
    x, v, a = (np.where(np.abs(simulated[0][at] - time_s) < SAME_S, y[at], np.nan) for y in simulated[1:])
    known = np.isfinite(x)
    if not known.any() or np.mean(known[motion.moving]) < COVERED:
        return None
    moving = known & (np.abs(v) > MOVES * np.nanpercentile(np.abs(v), 98))
    x, v, a = np.where(known, x, motion.position), np.where(known, v, 0.0), np.where(known, a, 0.0)
    return Motion(x, v, a, motion.noise, motion.bandwidth_s, moving, *since_rest(time_s, moving), smoothed=False)


def delays_apart(drives: Mapping[str, SimulatedDrive]) -> dict[str, SimulatedDrive]:
    """The drives with the delays of their currents beside the least one of the session: what all drives share is how
    the log is read."""
    told = [d.delay_s for d in drives.values() if np.isfinite(d.doubt_s)]
    common = min(told, key=abs) if len(told) > 1 else 0.0
    return {a: replace(d, delay_s=d.delay_s - common) for a, d in drives.items()}
