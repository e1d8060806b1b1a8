"""What the sensors' own noise leaves in a balance of effort: the floor that no model can go below.

Parametric bootstrap (Efron & Tibshirani 1993, ch. 6): some white noise, a share of what the recordings hold, is added
to them once more; what that changes of the residual tells the noise in it, states differentiated from noisy positions
included.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .declared import DeclaredFit
from .model import RigModel, RigTrial
from .states import fill_gaps, noise_std
from .trial_balance import trial_rows

Array = NDArray[np.float64]
MOST_TRIALS = 5
SMALL = 0.3  # share of the noise that is added, so that it acts linearly (on the direction of friction it would not)


def effort_noise(rig: RigModel, fit: DeclaredFit) -> dict[str, float]:
    """Root mean square of sensor noise in the residual of every joint's balance [N m or N], moving samples, over some
    of the recordings."""
    rows = {(r.trial, r.joint): r for r in fit.rows}
    trials = [t for t in rig.trials if any(t.name == name for name, _ in rows)]
    squares: dict[str, list[float]] = {}
    for k, trial in enumerate(trials[:: max(1, int(np.ceil(len(trials) / MOST_TRIALS)))]):
        known = {joint: r.weight for (name, joint), r in rows.items() if name == trial.name}
        for noisy in trial_rows(rig, _noisier(trial, k), fit.columns, fit.cutoff_hz, weights=known):
            row = rows.get((trial.name, noisy.joint))
            if row is None or len(row.effort) != len(noisy.effort):
                continue
            change = (fit.residual(noisy) - fit.residual(row))[row.moving] / SMALL
            squares.setdefault(row.joint, []).append(float(np.mean(change**2)) if len(change) else 0.0)
    return {joint: float(np.sqrt(np.mean(s))) for joint, s in squares.items()}


def _noisier(trial: RigTrial, seed: int) -> RigTrial:
    random = np.random.default_rng(seed)

    def more(channels: Mapping[str, Array]) -> dict[str, Array]:
        return {k: v + SMALL * _white(trial.time_s, v) * random.standard_normal(len(v)) for k, v in channels.items()}

    return replace(trial, position=more(trial.position), effort=more(trial.effort), voltage=more(trial.voltage))


def _white(time_s: Array, values: Array) -> float:
    """White noise of a channel with gaps; none where it never moves."""
    filled = fill_gaps(time_s, values)
    return noise_std(filled, time_s) if np.ptp(filled) > 0 else 0.0
