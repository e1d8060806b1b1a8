"""Asymmetric viscous friction: the viscous coefficient differs between flexion and extension."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, figure
from .law import Law


class AsymmetricViscousFriction(Effect):
    """b_flexion - b_extension acts on |v| (half of it each way)."""

    name = "asymmetric_viscous_friction"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Half the difference of the two coefficients, either sign."""
        return (("half_difference", "effort s/position", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """|v|, (n, 1)."""
        return np.abs(state.velocity)[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Coefficients of flexion and extension."""
        half, viscous = amplitude["half_difference"], declared.get("viscous", np.nan)
        return {
            "viscous_flexion": viscous + half,
            "viscous_extension": viscous - half,
            "ratio": (viscous + half) / (viscous - half) if viscous != half else np.inf,
        }

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Effort over velocity."""
        return dict.fromkeys(("viscous_flexion", "viscous_extension"), "effort s/position")

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much each way."""
        flexion, extension = figure(parameters["viscous_flexion"]), figure(parameters["viscous_extension"])
        return (
            f"viscous friction differs with direction: {flexion} raw s/% in flexion, {extension} raw s/% in extension"
        )

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Half the difference of the coefficients times |v|."""
        half = 0.5 * (parameters["viscous_flexion"] - parameters["viscous_extension"])
        return lambda now: half * abs(now.velocity)


EFFECT = AsymmetricViscousFriction()
