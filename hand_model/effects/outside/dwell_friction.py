"""Friction that grows while the drive rests and is worn off as it moves (Rabinowicz 1958)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure, position_range
from ..path import from_rest
from .outsider import Outsider


class DwellFriction(Outsider):
    """F = A sign(v) exp(-s / distance), s travelled since the last rest."""

    name = "dwell_friction"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The way on which it is worn off."""
        low, high = position_range(states)
        span = high - low
        return (Shape("distance", states[0].position_unit, 0.01 * span, 0.4 * span, tuple(np.geomspace(0.015, 0.25, 6) * span)),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Friction beyond the usual, just after a rest."""
        return (("excess", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) exp(-s / distance), (n, 1)."""
        moving = state.extra.get("moving", np.ones(len(state.time_s))) > 0
        return (state.direction * np.exp(-from_rest(state.position, moving) / shape["distance"]))[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much and for how long."""
        return f"after a rest friction is {figure(parameters['excess'])} raw higher, which {figure(parameters['distance'])} % of travel wear off"


EFFECT = DwellFriction()
