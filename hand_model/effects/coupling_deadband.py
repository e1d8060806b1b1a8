"""Coupling deadband: the distal segment does not move at first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class CouplingDeadband(Effect):
    """Below a proximal angle the distal angle stays where the coupling has it there."""

    name = "coupling_deadband"
    station = "linkage"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Proximal angle at which the distal segment starts to move."""
        low, high = position_range(states)
        span = high - low
        return (Shape("until", states[0].position_unit, low + 0.01 * span, low + 0.5 * span,
                      tuple(low + span * np.linspace(0.03, 0.45, 12))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Slope that is missing below."""
        return (("slope", "1", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """max(0, until - q), (n, 1): what the polynomial would have gone further down."""
        return np.maximum(shape["until"] - state.position, 0.0)[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From the start of the range to where it moves."""
        low, _ = position_range(states)
        return {"position": [low, shape["until"]], "unit": states[0].position_unit}


EFFECT = CouplingDeadband()
