"""Stribeck friction: friction rises as speed falls towards zero (Tustin 1947, exponent 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, speed_range
from .mjcf import lugre_friction, motor_joint

# exp(-u) is c + e exp(-(u / w)^2) to 4 % (root mean square, 0.2 < u < 6): what sliding friction, excess and speed become.
GAUSSIAN = (0.049, 0.718, 1.142)


class StribeckFriction(Effect):
    """F(v) = sign(v) (Fc + (Fs - Fc) exp(-|v| / vs))."""

    name = "stribeck_friction"
    needs = "coulomb"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Stribeck speed, from below the slowest to the fastest recorded motion."""
        low, high = speed_range(states)
        return (Shape("stribeck_speed", f"{states[0].position_unit}/s", 0.15 * low, 0.6 * high,
                      tuple(np.geomspace(0.4 * low, 0.5 * high, 7))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Static minus Coulomb friction, never negative."""
        return (("static_excess", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) exp(-|v| / vs), (n, 1)."""
        return (state.direction * np.exp(-np.abs(state.velocity) / shape["stribeck_speed"]))[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Static friction as a ratio to Coulomb friction, and the Stribeck speed."""
        coulomb = declared.get("coulomb") or np.nan  # without Coulomb friction there is no ratio
        return {"static_ratio": 1 + amplitude["static_excess"] / coulomb, "stribeck_speed": shape["stribeck_speed"]}

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """Speeds below two Stribeck speeds hold 86 % of it."""
        return {"speed": [0.0, 2.0 * shape["stribeck_speed"]], "unit": f"{states[0].position_unit}/s"}

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A passive DC motor's LuGre friction, whose rise is exp(-(v / vs)^2): the nearest to exp(-|v| / vs)."""
        if motor_joint(root, where) is None:
            return None
        excess = parameters["static_ratio"] - 1
        sliding = 1 + GAUSSIAN[0] * excess
        return lugre_friction(root, where, {"coulomb_ratio": sliding, "static_ratio": sliding + GAUSSIAN[1] * excess,
                                            "stribeck_speed": GAUSSIAN[2] * parameters["stribeck_speed"]})


EFFECT = StribeckFriction()
