"""Clock drift: the log's clock runs at another rate than the motion capture's."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect


class ClockDrift(Effect):
    """angle(t) = map(encoder(t + drift (t - middle))): a column of velocity times time from the middle of the recording."""

    name = "clock_drift"
    station = "encoder"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Rate of the log's clock over the mocap clock, minus one."""
        return (("drift", "deg/%", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Velocity of the segment (70 deg over the range, refined by the amplitude) times time, (n, 1)."""
        middle = 0.5 * (state.time_s[0] + state.time_s[-1])
        return (state.velocity * (state.time_s - middle))[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Rate minus one: the amplitude over the slope of the encoder map [deg per %]."""
        slope = declared.get("power_1", np.nan) + declared.get("power_2", 0.0) + declared.get("power_3", 0.0)
        return {"rate_minus_one": -amplitude["drift"] / (slope / 100) if slope else np.nan}


EFFECT = ClockDrift()
