"""The supply of a drive, where a recording holds it: an extra channel to look at, noisy and coarse as servos read
it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .model import RigModel, RigTrial
from .states import fill_gaps

Array = NDArray[np.float64]
WORDS = ("supply", "bus_voltage", "input_volt", "battery", "vin")


def supply_channel(rig: RigModel) -> str | None:
    """The first extra channel that is named like a supply voltage, or None."""
    names = sorted({c for t in rig.trials for c in t.extra})
    return next((c for c in names if any(w in c.lower() for w in WORDS)), None)


def supply_deviation(rig: RigModel, trial: RigTrial) -> Array:
    """Supply at the trial's time stamps (n,), relative to its mean over the session; zero where none is recorded."""
    channel = supply_channel(rig)
    if channel is None or channel not in trial.extra:
        return np.zeros(len(trial.time_s))
    mean = np.mean([np.nanmean(t.extra[channel]) for t in rig.trials if channel in t.extra])
    if not mean > 0:
        return np.zeros(len(trial.time_s))
    return fill_gaps(trial.time_s, trial.extra[channel]) / mean - 1.0
