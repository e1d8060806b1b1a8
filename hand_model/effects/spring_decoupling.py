"""Spring decoupling: the finger leaves its actuator against the spring (weight, external flexion)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class SpringDecoupling(Effect):
    """Near the open end the actuator opens further and the finger does not follow."""

    name = "spring_decoupling"
    station = "encoder"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Encoder position below which the finger stays behind."""
        low, high = position_range(states)
        span = high - low
        return (Shape("below", states[0].position_unit, low + 0.01 * span, low + 0.6 * span,
                      tuple(low + span * np.linspace(0.03, 0.5, 12))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Angle per position that the finger stays behind."""
        return (("slope", "deg/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """max(0, below - x), (n, 1)."""
        return np.maximum(shape["below"] - state.position, 0.0)[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From the open end to where it follows again."""
        low, _ = position_range(states)
        return {"position": [low, shape["below"]], "unit": states[0].position_unit}


EFFECT = SpringDecoupling()
