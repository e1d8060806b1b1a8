"""Thixotropy: grease that thins as it is sheared and stiffens at rest (Barnes 1997)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure, speed_range
from ..path import lowpass
from .outsider import Outsider


class Thixotropy(Outsider):
    """F = A v exp(-w / thinning_speed), w the speed's size averaged over the last while (first-order low pass)."""

    name = "thixotropy"
    rubs = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The mean speed that thins the grease, and the while."""
        _, high = speed_range(states)
        unit = f"{states[0].position_unit}/s"
        return (
            Shape("thinning_speed", unit, 0.02 * high, high, tuple(np.geomspace(0.05, 0.6, 4) * high)),
            Shape("while", "s", 0.2, 30.0, (0.6, 2.0, 6.0)),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Viscous friction of fresh grease beyond that of sheared grease."""
        return (("excess", "effort s/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """v exp(-w / thinning_speed), (n, 1)."""
        speed = np.abs(state.velocity)
        # before a recording it rested long
        sheared = lowpass(np.r_[state.time_s[0] - 1e-6, state.time_s], np.r_[0.0, speed], shape["while"])[1:]
        return (state.velocity * np.exp(-sheared / shape["thinning_speed"]))[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much and for how long."""
        return (
            f"viscous friction is {figure(parameters['excess'])} raw s/% higher after a rest, "
            f"and falls as the last {figure(parameters['while'])} s were fast"
        )


EFFECT = Thixotropy()
