"""Stribeck friction: friction rises as speed falls towards zero (Tustin 1947; Bo & Pavelescu 1982, exponents 1 and 2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, speed_range
from .mjcf import add_damping, lugre_friction, motor_joint

# exp(-u) is c + e exp(-(u / w)^2) + d u + f u^2 to 1.3 % (root mean square, 0.25 < u < 9); without damping c, e, w to 4 %.
DAMPED = (0.2158, 0.5383, 1.0763, -0.0663, 0.0049)
PLAIN = (0.049, 0.718, 1.142, 0.0, 0.0)


class StribeckFriction(Effect):
    """F(v) = sign(v) (Fc + (Fs - Fc) exp(-(|v| / vs)^n)), n = 1 (form 0) or 2 (form 1)."""

    name = "stribeck_friction"
    needs = "coulomb"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Stribeck speed, from below the slowest to the fastest recorded motion."""
        low, high = speed_range(states)
        return (Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
                Shape("stribeck_speed", f"{states[0].position_unit}/s", 0.15 * low, 0.6 * high,
                      tuple(np.geomspace(0.4 * low, 0.5 * high, 7))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Static minus Coulomb friction, never negative."""
        return (("static_excess", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) exp(-(|v| / vs)^n), (n, 1)."""
        power = 1.0 if shape.get("form", 0.0) < 0.5 else 2.0
        return (state.direction * np.exp(-((np.abs(state.velocity) / shape["stribeck_speed"]) ** power)))[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Static friction as a ratio to Coulomb friction, and the Stribeck speed."""
        coulomb = declared.get("coulomb") or np.nan  # without Coulomb friction there is no ratio
        return {"static_ratio": 1 + amplitude["static_excess"] / coulomb, "stribeck_speed": shape["stribeck_speed"],
                "exponent": 1.0 if shape.get("form", 0.0) < 0.5 else 2.0,
                "static_excess": amplitude["static_excess"]}

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Static friction is seldom more than three times the Coulomb friction; an exponent of 1 is more common than 2."""
        rare = 0.5 * max(0.0, min(parameters["static_ratio"], 8.0) - 3.0) ** 2
        return -rare - (4.0 if parameters["exponent"] > 1.5 else 0.0)

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """Speeds below two Stribeck speeds hold 86 % of it."""
        return {"speed": [0.0, 2.0 * shape["stribeck_speed"]], "unit": f"{states[0].position_unit}/s"}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Below which speed, by how much, and against the friction in motion."""
        below, excess = figure(2 * parameters["stribeck_speed"]), figure(parameters["static_excess"])
        ratio = parameters.get("static_ratio", 0.0)
        exponent = f", exponent {parameters['exponent']:.0f}" if "exponent" in parameters else ""
        to = f", up to {figure(ratio)} times the Coulomb friction" if ratio > 1 else ""
        return (f"below {below} %/s the motor needs up to {excess} raw more current than simulated: "
                f"friction rises as speed falls (Stribeck{exponent}){to}")

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A passive DC motor's LuGre friction, whose rise is exp(-(v / vs)^2), and damping: the nearest to exp(-|v| / vs)."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        excess, speed = parameters["static_ratio"] - 1, parameters["stribeck_speed"]
        load = unit * parameters["static_excess"]
        damped = add_damping(joint, DAMPED[3] * load / speed, DAMPED[4] * load / speed**2)
        c, e, w = (DAMPED if damped else PLAIN)[:3]
        return lugre_friction(root, where, {"coulomb_ratio": 1 + c * excess, "static_ratio": 1 + (c + e) * excess,
                                            "stribeck_speed": w * speed})


EFFECT = StribeckFriction()
