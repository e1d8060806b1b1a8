"""Friction that jumps at a moment and stays: something broke, came loose or fell in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure
from .outsider import Outsider, moments


class FrictionJump(Outsider):
    """F = A sign(v) from a moment on."""

    name = "friction_jump"
    rubs = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The moment within the session."""
        return (moments(states),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """The change, either sign."""
        return (("change", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) from the moment on, (n, 1)."""
        return (state.direction * (state.elapsed_s >= shape["moment"]))[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When and by how much."""
        return (
            f"friction changes by {figure(parameters['change'])} raw at {figure(parameters['moment'])} s, "
            "at once, and stays"
        )


EFFECT = FrictionJump()
