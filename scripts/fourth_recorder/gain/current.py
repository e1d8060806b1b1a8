"""The gain in the current: a linear healthy motor against it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry import Array
from ..log_file import channels
from ..motor import ROW_S
from ..session import Session
from ..trial import Trial
from .gain import Gain

BRISTLE_STIFFNESS = 60.0  # [raw per %] of a healthy motor
EVERY = 5  # rows of the trace


def friction_shape(positions: Array, coulomb: float) -> Array:
    """LuGre friction over its Coulomb force, from positions [%] at every ROW_S; coulomb: that force [raw]."""
    speeds = np.diff(positions, prepend=positions[0]) / ROW_S
    bristle, per_distance = 0.0, BRISTLE_STIFFNESS / coulomb
    out = []
    for speed in speeds.tolist():
        bristle = (bristle + ROW_S * speed) / (1 + ROW_S * abs(speed) * per_distance)
        out.append(bristle * per_distance)
    return np.array(out)


def best_healthy(trials: Sequence[Trial], least_speed: float = 0.0) -> tuple[Array, Array]:
    """Mass, viscous and Coulomb friction, stiffness, preload (raw units, %) and the residuals [raw], where the motor is at
    least so fast [%/s]."""
    columns, currents = [], []
    for trial in trials:
        position, current = channels(trial)
        speed = np.gradient(position, ROW_S)
        acceleration = np.gradient(speed, ROW_S)
        friction = friction_shape(position, trial.finger.motor.coulomb)
        during = trial.trace.time < trial.duration_s
        rows = np.c_[acceleration, speed, friction, position, np.ones_like(position)]
        use = np.flatnonzero(during)[::EVERY]
        use = use[np.abs(speed[use]) >= least_speed]
        columns.append(rows[use])
        currents.append(current[use])
    matrix, values = np.concatenate(columns), np.concatenate(currents)
    figures, *_ = np.linalg.lstsq(matrix, values, rcond=None)
    return figures, values - matrix @ figures


def current_gain(session: Session, trials: Sequence[Trial], least_speed: float = 0.0) -> Gain:
    """Of all trials of one finger, where its motor is at least so fast [%/s]."""
    _, residuals = best_healthy(trials, least_speed)
    laboratory = session.laboratory
    variance = laboratory.current_noise**2 + 1 / 12
    rows_per_value = ROW_S * EVERY / laboratory.row_s
    return Gain(
        float(0.5 * (residuals**2).sum() / variance * rows_per_value),
        float(np.sqrt(1 + (residuals**2).mean() / variance) - 1),
    )
