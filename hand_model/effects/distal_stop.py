"""Distal stop: the distal segment stops before the proximal one does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class DistalStop(Effect):
    """Above a proximal angle the distal angle stays."""

    name = "distal_stop"
    station = "linkage"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Proximal angle at which the distal segment stops."""
        low, high = position_range(states)
        span = high - low
        return (Shape("from", states[0].position_unit, high - 0.5 * span, high - 0.01 * span,
                      tuple(high - span * np.linspace(0.03, 0.45, 12))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Slope that is missing above."""
        return (("slope", "1", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """-max(0, q - from), (n, 1)."""
        return -np.maximum(state.position - shape["from"], 0.0)[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From where it stops to the end of the range."""
        _, high = position_range(states)
        return {"position": [shape["from"], high], "unit": states[0].position_unit}


EFFECT = DistalStop()
