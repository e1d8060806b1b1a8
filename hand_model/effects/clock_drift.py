"""Clock drift: the log's clock runs at another rate than the motion capture's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect

CRYSTALS = 1e-4  # by which the rates of two healthy clocks may differ: 50 ppm each


class ClockDrift(Effect):
    """angle(t) = map(encoder(t + drift (t - middle))): a column of velocity times time from the middle of the
    recording."""

    name = "clock_drift"
    drifting = True
    station = "encoder"
    signal = "log"
    recorded = True
    joint = None
    correction = "log time mapped to the mocap clock with the estimated rate"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """What the log's times must be stretched by, minus one, with the other sign."""
        return (("drift", "1", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Velocity of the segment times time, (n, 1)."""
        middle = 0.5 * (state.time_s[0] + state.time_s[-1])
        return (state.slope * state.velocity * (state.time_s - middle))[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Rate of the log's clock over the mocap clock, minus one: a correction divides the log's times by the rate."""
        return {"rate_minus_one": 1 / (1 - amplitude["drift"]) - 1}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Time gained or lost in every second."""
        rate = parameters["rate_minus_one"]
        return (
            f"the log's clock {'gains' if rate > 0 else 'loses'} {1e3 * abs(rate):.2f} ms on the mocap "
            "clock in every second"
        )


EFFECT = ClockDrift()
