"""Series elasticity: give between encoder and proximal segment that grows with load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect


class SeriesElasticity(Effect):
    """q = map(encoder) - compliance * load; the load is the smoothed motor current."""

    name = "series_elasticity"
    station = "encoder"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Compliance, always yielding to the load."""
        return (("compliance", "deg/effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Minus the load, (n, 1); none where no load is logged."""
        return -state.extra["load"][:, None] if "load" in state.extra else np.zeros((len(state.time_s), 1))


EFFECT = SeriesElasticity()
