"""The gain in the motion: a healthy motor, as the current shows it, under the same commands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..log_file import channels
from ..motor import NOISE, ROW_S, Motor, RunawayError, simulate
from ..session import Session
from ..trial import Trial
from .current import best_healthy
from .gain import Gain


def motion_gain(session: Session, trials: Sequence[Trial]) -> Gain:
    """Of all trials of one finger; a common delay is the healthy motor's too."""
    laboratory = session.laboratory
    figures, _ = best_healthy(trials)
    coulomb = max(figures[2], 5)
    healthy = Motor(
        mass=trials[0].finger.motor.mass,
        viscous=max(figures[1], 0.01),
        coulomb=coulomb,
        stiffness=figures[3],
        preload=figures[4],
        static_friction=coulomb,
        position_gain=laboratory.position_gain,
        speed_gain=laboratory.speed_gain,
        top_speed=laboratory.top_speed,
        acceleration=laboratory.acceleration,
    )
    total, count = 0.0, 0
    for trial in trials:
        try:
            trace = simulate(healthy, trial.planned.moves, trial.starts, trial.duration_s + 0.6, np.zeros(NOISE))
        except RunawayError:
            break
        low, high = trial.finger.counts
        position, _ = channels(trial)
        during = trial.trace.time < trial.duration_s
        errors = (position - trace.position)[during] / 100 * (high - low)
        speeds = trace.speed[during] / 100 * (high - low)
        errors = errors - speeds * (errors @ speeds) / (speeds @ speeds)
        mean = (errors**2).mean() / (laboratory.position_noise**2 + 1 / 12)
        total += mean * during.sum()
        count += during.sum()
    return Gain(float(0.5 * total * ROW_S / laboratory.row_s), float(np.sqrt(1 + total / max(count, 1)) - 1))
