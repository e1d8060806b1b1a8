"""End-stop contact: an elastic stop within the range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class EndStopContact(Effect):
    """F = k max(0, x - x0) at the upper end, or -k max(0, x0 - x) at the lower."""

    name = "end_stop_contact"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Side (1 upper, -1 lower) and where the stop begins."""
        low, high = position_range(states)
        span, unit = high - low, states[0].position_unit
        return (Shape("side", "1", -1.0, 1.0, (-1.0, 1.0)),
                Shape("begin", unit, low + 0.015 * span, high - 0.015 * span, tuple(low + span * np.linspace(0.04, 0.96, 24))))

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Stiffness of the stop, never negative."""
        return (("stiffness", "effort/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Depth into the stop, signed as its load, (n, 1)."""
        side = 1.0 if shape["side"] >= 0 else -1.0
        return (side * np.maximum(side * (state.position - shape["begin"]), 0.0))[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From where the stop begins to the end of the range."""
        low, high = position_range(states)
        ends = [shape["begin"], high] if shape["side"] >= 0 else [low, shape["begin"]]
        return {"position": ends, "unit": states[0].position_unit}


EFFECT = EndStopContact()
