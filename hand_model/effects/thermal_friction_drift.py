"""Thermal friction drift: friction changes as the drive warms up."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape
from .law import Law


class ThermalFrictionDrift(Effect):
    """F = sign(v) A exp(-t / tau): the change still to come at time t since the session began."""

    name = "thermal_friction_drift"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Warm-up time between 5 s and four times the session."""
        total = max(max(float(s.elapsed_s[-1]) for s in states), 10.0)
        return (Shape("warm_up_time", "s", 5.0, 4 * total, tuple(np.geomspace(max(5.0, 0.04 * total), 2 * total, 7))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Friction above the final value when cold; lubricants thin out, yet either sign is allowed."""
        return (("cold_excess", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) exp(-t / tau), or sign(v) times temperature where that is logged, (n, 1)."""
        if "temperature" in state.extra:
            return (state.direction * state.extra["temperature"])[:, None]
        return (state.direction * np.exp(-state.elapsed_s / shape["warm_up_time"]))[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Cold excess as a ratio to the warm Coulomb friction, and the warm-up time."""
        return {**amplitude, **shape, "ratio": amplitude["cold_excess"] / declared.get("coulomb", np.nan)}

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Friction that fades with the time since the simulation began: the drive is cold then."""
        excess, tau = parameters["cold_excess"], parameters["warm_up_time"]
        return lambda now: excess * now.direction * math.exp(-now.time_s / tau)


EFFECT = ThermalFrictionDrift()
