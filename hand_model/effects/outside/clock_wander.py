"""Two clocks that part and meet: frames that the cameras lost, rows of a log that came in packets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState
from ..clock_drift import CRYSTALS
from .outsider import Outsider, of_its_record

RECORDS, WHILES = 4, 8  # recordings that may be looked at, and pieces of each


class ClockWander(Outsider):
    """angle(t) = map(encoder(t - lag)), another lag in each while of each recording."""

    name = "clock_wander"
    station = "encoder"
    signal = "log"
    recorded = True
    covers = ("clock_drift",)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """A lag for every while; those of recordings that are not there never act."""
        return tuple((f"lag_{i}_{k}", "s", -np.inf, np.inf) for i in range(RECORDS) for k in range(WHILES))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Speed of the segment in each while, (n, RECORDS * WHILES)."""
        share = (state.time_s - state.time_s[0]) / max(state.time_s[-1] - state.time_s[0], 1e-9)
        inside = np.minimum((WHILES * share).astype(int), WHILES - 1)[:, None] == np.arange(WHILES)
        return of_its_record(state, np.where(inside, (-state.slope * state.velocity)[:, None], 0.0), RECORDS)

    def possible(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> bool:
        """Whether the clocks of some recording part by more than those of two healthy crystals do over its length."""
        lags = np.array([[parameters.get(f"lag_{i}_{k}", 0.0) for k in range(WHILES)] for i in range(RECORDS)])
        lasting = max(float(s.time_s[-1] - s.time_s[0]) for s in states)
        return bool(np.ptp(lags, axis=1).max() > CRYSTALS * lasting)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How far they part."""
        lags = [v for name, v in parameters.items() if name.startswith("lag_") and v != 0.0]
        spread = 1e3 * (max(lags) - min(lags)) if lags else 0.0
        return f"the clocks of markers and log part and meet again, by up to {spread:.0f} ms: frames or rows are lost"


EFFECT = ClockWander()
