"""Stribeck friction: friction rises as speed falls towards zero (Tustin 1947; Bo & Pavelescu 1982, exponents 1 and
2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, speed_range
from .mjcf import add_damping, lugre_friction, motor_joint

SPEEDS = np.linspace(0.25, 9.0, 400)  # over the Stribeck speed, between which the nearest law is sought
WIDTHS = np.linspace(0.7, 2.0, 66)


class StribeckFriction(Effect):
    """F(v) = sign(v) (Fc + (Fs - Fc) exp(-(|v| / vs)^n)), n = 1 (form 0) or 2 (form 1)."""

    name = "stribeck_friction"
    rubs = True
    needs = "coulomb"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Stribeck speed, from below the slowest to the fastest recorded motion."""
        low, high = speed_range(states)
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape(
                "stribeck_speed",
                f"{states[0].position_unit}/s",
                0.15 * low,
                0.6 * high,
                tuple(np.geomspace(0.4 * low, 0.5 * high, 7)),
            ),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Static minus Coulomb friction, never negative."""
        return (("static_excess", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) exp(-(|v| / vs)^n), (n, 1)."""
        power = 1.0 if shape.get("form", 0.0) < 0.5 else 2.0
        return (state.direction * np.exp(-((np.abs(state.velocity) / shape["stribeck_speed"]) ** power)))[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Static friction as a ratio to Coulomb friction, and the Stribeck speed."""
        coulomb = declared.get("coulomb") or np.nan  # without Coulomb friction there is no ratio
        return {
            "static_ratio": 1 + amplitude["static_excess"] / coulomb,
            "stribeck_speed": shape["stribeck_speed"],
            "exponent": 1.0 if shape.get("form", 0.0) < 0.5 else 2.0,
            "static_excess": amplitude["static_excess"],
        }

    def possible(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> bool:
        """Whether the drive could break loose: with no more than the most that was ever asked of it."""
        largest = max((float(np.nanmax(np.abs(s.effort), initial=0.0)) for s in states if len(s.effort)), default=0.0)
        return parameters["static_excess"] <= largest

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Static friction is seldom more than three times the Coulomb friction; an exponent of 1 is more common than
        2."""
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
        return (
            f"below {below} %/s the motor needs up to {excess} raw more current than simulated: "
            f"friction rises as speed falls (Stribeck{exponent}){to}"
        )

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A passive DC motor's LuGre friction, whose rise is exp(-(v / vs)^2): exponent 2 as it is; with damping, the
        nearest to exp(-|v| / vs)."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        excess, speed = parameters["static_ratio"] - 1, parameters["stribeck_speed"]
        load = unit * parameters["static_excess"]
        room = float((joint.get("damping") or "0").split()[0]) * speed / load if load > 0 else 0.0
        c, e, w, linear, quadratic = (
            (0.0, 1.0, 1.0, 0.0, 0.0) if parameters.get("exponent", 1.0) > 1.5 else _nearest(room)
        )
        add_damping(joint, linear * load / speed, quadratic * load / speed**2)
        return lugre_friction(
            root,
            where,
            {"coulomb_ratio": 1 + c * excess, "static_ratio": 1 + (c + e) * excess, "stribeck_speed": w * speed},
        )


def _nearest(room: float) -> tuple[float, float, float, float, float]:
    """c, e, w, d, f of c + e exp(-(u / w)^2) + d u + f u^2 nearest to exp(-u) (root mean square: 1.2 to 2.4 %), with d
    at least -room: a joint's damping pays for it."""
    from scipy.optimize import lsq_linear

    def fit(width: float) -> tuple[float, Array]:
        columns = np.stack([np.ones_like(SPEEDS), np.exp(-((SPEEDS / width) ** 2)), SPEEDS, SPEEDS**2], 1)
        found = lsq_linear(columns, np.exp(-SPEEDS), ([0.0, 0.0, -(1 - 1e-9) * room, 0.0], np.inf), method="bvls")
        return float(found.cost), found.x

    width = min(WIDTHS, key=lambda w: fit(w)[0])
    c, e, d, f = (float(x) for x in fit(width)[1])
    return c, e, float(width), d, f


EFFECT = StribeckFriction()
