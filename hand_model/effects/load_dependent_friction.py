"""Load-dependent friction: friction grows with the transmitted load (gearbox or leadscrew efficiency)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, figure
from .law import Law


class LoadDependentFriction(Effect):
    """F = sign(v) mu |load|; the load is the logged one, or spring and preload, of which position is the measure."""

    name = "load_dependent_friction"
    rubs = True

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Friction per load (or per position, where the load is the declared spring's), never negative."""
        return (("per_load", "effort/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) |load|, (n, 1); without a load channel sign(v) position: the preload's part is Coulomb friction."""
        load = np.abs(state.extra["load"]) if "load" in state.extra else state.position
        return (state.direction * load)[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Friction per unit of load (coefficient), from friction per position and the spring's stiffness."""
        spring = declared.get("spring", np.nan)
        return {
            "load_coefficient": amplitude["per_load"] / spring if spring else np.nan,
            "per_load": amplitude["per_load"],
        }

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Friction over the whole range, and as a part of the spring's load."""
        part = parameters.get("load_coefficient", 0.0)
        rate = f"by {100 * part:.0f} % of it, " if part > 0 else ""
        return (
            f"friction grows with the load of the spring: {rate}{figure(100 * parameters['per_load'])} raw over "
            "the motor's whole range"
        )

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Friction in proportion to the position: the spring's load."""
        return lambda now: parameters["per_load"] * now.direction * now.position


EFFECT = LoadDependentFriction()
