"""Friction that grows with acceleration: speeding up and slowing down are no mirror images."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, figure
from .outsider import Outsider


class InertialFriction(Outsider):
    """F = A |a| sign(v)."""

    name = "inertial_friction"
    rubs = True

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Either sign."""
        return (("slope", "effort s2/position", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """|a| sign(v), (n, 1)."""
        return (np.abs(state.acceleration) * state.direction)[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """By how much."""
        return f"friction grows with acceleration, by {figure(parameters['slope'])} raw s2/%"


EFFECT = InertialFriction()
