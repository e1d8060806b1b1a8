"""Forward replay: setpoints in, position and current out, in open loop; and what the compiled actuator must be told."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError
from ...session import Log
from . import output_error
from .balance import NAMES, balance
from .batch import Moves
from .creep import begins, continued, end_state
from .fit import MotorFit
from .moves import MoveData, levelled, moves_from_rest
from .profile import profile
from .recording import MotorTrial, motor_trial
from .residuals import simulate_moves

Array = NDArray[np.float64]

PHASES = ("onset", "cruise", "stop", "rest")
ONSET_S = 0.15


@dataclass(frozen=True)
class Prediction:
    """Open-loop prediction at the log's usable samples: time_s (n,) [s], position (n,) [%], current (n,) [raw], what
    was recorded, phase (n,) index into PHASES, predicted (n,) whether the sample lies in a move that starts from rest
    or the rest before one."""

    time_s: Array
    position: Array
    current: Array
    recorded_position: Array
    recorded_current: Array
    phase: NDArray[np.int64]
    predicted: NDArray[np.bool_]

    def rmse(self, phase: str | None = None) -> tuple[float, float]:
        """RMSE of position [%] and current [raw], of all samples or of one phase; nan where it has none."""
        k = self.predicted if phase is None else self.predicted & (self.phase == PHASES.index(phase))
        if not k.any():
            return float("nan"), float("nan")
        return (
            float(np.sqrt(np.mean((self.position - self.recorded_position)[k] ** 2))),
            float(np.sqrt(np.mean((self.current - self.recorded_current)[k] ** 2))),
        )


def predict(fit: MotorFit, log: Log, name: str = "log", align: bool = True) -> Prediction:
    """Simulate a log's moves from its commands alone.

    align: the instant at which each command took effect and the speed, which a log holds only to one sample and one raw
    unit, are found within these limits from the recorded position; nothing else is. Every move starts where the last
    one was predicted to end.
    Where no controller was identified or the log holds no setpoint, the motion is taken as recorded and the current
    predicted from it.
    Raises IdentificationError where a log with setpoints holds no move that starts from rest.
    """
    trial = motor_trial(name, log, fit.scale)
    if fit.simulated is None or trial.setpoint is None:
        return _from_motion(fit, trial)
    values = fit.simulated
    data = known_moves(fit, trial)
    if not data:
        raise IdentificationError(f"{name}: no move from rest with a logged setpoint; a prediction needs setpoints")
    own = _align(fit, data) if align else np.array([m.own for m in data])
    position, current = np.full(len(trial.time_s), np.nan), np.full(len(trial.time_s), np.nan)
    phase, predicted = np.full(len(trial.time_s), PHASES.index("rest")), np.zeros(len(trial.time_s), bool)
    controller, last = fit.output_error.controller, None
    for m, x in zip(data, own, strict=True):
        first = last is None or m.index != last[2]
        x = x.copy()
        if not first:
            x[1], x[3] = last[0], last[1]
            m = dataclasses.replace(m, velocity=last[3])
        else:  # the drive's state before its first move is no prediction: it is where the recording starts
            # the last sample before a command may be of the command already
            k = slice(0 if last is None else m.index, m.index)
            position[k], current[k] = x[1], (values["gain"] * (m.origin - x[1]) if controller == "profile" else x[3])
            predicted[k] = True
        y = simulate_moves([m], values, x[None], controller, 1e-3)[0]
        k = slice(m.index + 1, m.index + 1 + len(m.time_s))
        position[k], current[k], predicted[k] = y[:, 0], y[:, 1], True
        phase[k] = _phases(m, x, y[:, 0])
        position_end, current_end, creep = end_state(m.time_s, y)
        # a reference that ends lets nothing creep: what is left of a motion then is the end of its settling, held by
        # bristles that are not all bent
        last = (position_end, current_end, k.stop, creep if controller == "cascade" else 0.0)
    return Prediction(trial.time_s, position, current, trial.position, trial.current, phase, predicted)


def known_moves(fit: MotorFit, trial: MotorTrial) -> tuple[MoveData, ...]:
    """The moves of a trial that start from rest, their speeds as the fit knows those that are logged."""
    data = moves_from_rest(trial, (fit.sigma_position, fit.sigma_current), fit.scale.speed_full)
    return data if fit.output_error is None else levelled(data, fit.output_error.speeds)


def _align(fit: MotorFit, data: tuple[MoveData, ...]) -> Array:
    """Own unknowns of every move from its position alone (the current weighs nothing)."""
    blind = (fit.sigma_position, 1e3 * fit.sigma_current)
    controller = fit.output_error.controller
    found = output_error.fit(data, fit.simulated, (), blind, {}, controller, output_error.ALIGN)
    states = begins(data, fit.simulated, found.own, controller)
    if any(states):
        found = output_error.fit(
            continued(data, states), fit.simulated, (), blind, {}, controller, output_error.ALIGN[1:], found.own
        )
    return found.own


def _from_motion(fit: MotorFit, trial: MotorTrial) -> Prediction:
    """The current of the recorded motion, by the balance; the motion itself is not predicted."""
    current = balance(trial, np.array([fit.values[n] for n in NAMES]))
    moving = np.abs(np.gradient(trial.position, trial.time_s)) > 5.0
    phase = np.where(moving, PHASES.index("cruise"), PHASES.index("rest"))
    return Prediction(
        trial.time_s, trial.position, current, trial.position, trial.current, phase, np.ones(len(current), bool)
    )


def _phases(m: MoveData, own: Array, position: Array) -> NDArray[np.int64]:
    """Onset until ONSET_S after the command; stop from 10 % before the end until the motion ends; rest after; cruise
    between."""
    away = np.abs(position - position[-1])
    late = m.time_s - own[0]
    out = np.full(len(position), PHASES.index("cruise"))
    out[away < 0.1 * abs(m.target - m.origin)] = PHASES.index("stop")
    out[away < 0.2] = PHASES.index("rest")
    out[late < ONSET_S] = PHASES.index("onset")
    return out


def aligned_moves(fit: MotorFit, trial: MotorTrial) -> tuple[tuple[MoveData, ...], Array]:
    """The moves of a trial that start from rest, and for each when its command took effect, where the drive rested, its
    speed and hold."""
    data = known_moves(fit, trial)
    return data, (_align(fit, data) if data else np.empty((0, 4)))


def reference(fit: MotorFit, trial: MotorTrial, time_s: Array) -> Array:
    """Control of the compiled actuator, (n,) [%], at times (n,) [s] of the trial: r + (damping / gain) r' of the
    profile generator.

    Raises IdentificationError for a cascade controller, whose reference depends on the simulated position.
    """
    if not fit.predictive or fit.output_error.controller != "profile":
        raise IdentificationError(
            f'motor "{fit.motor.actuator}": its controller has no reference that is known before the motion'
        )
    data, own = aligned_moves(fit, trial)
    out = np.full(len(time_s), data[0].origin if data else 0.0)
    lead = fit.values["damping"] / fit.values["gain"]
    for m, x in zip(data, own, strict=True):
        begin = trial.time_s[m.index]
        k = time_s >= begin
        one = np.ones(1)
        moves = Moves(
            x[:1], m.origin * one, m.target * one, x[2:3], one * m.limit, one * m.own[1], one * 0.0, one * 1.0
        )
        r, w = profile(time_s[k] - begin, moves, {n: v * one for n, v in fit.values.items()})
        out[k] = r[:, 0] + lead * w[:, 0]
    return out


def replay_table(prediction: Prediction, sigma_current: float) -> Mapping[str, tuple[float, float, float]]:
    """Phase (and "all") -> RMSE of position [%], of current [raw], and of current over its noise."""
    rows = {}
    for phase in ("all", *PHASES):
        position, current = prediction.rmse(None if phase == "all" else phase)
        rows[phase] = (position, current, current / sigma_current)
    return rows
