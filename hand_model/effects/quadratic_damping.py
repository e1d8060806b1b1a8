"""Quadratic damping: drag growing with speed squared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, figure
from .mjcf import add_damping, motor_joint


class QuadraticDamping(Effect):
    """F = b2 v |v|."""

    name = "quadratic_damping"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Drag coefficient, never negative."""
        return (("drag", "effort s^2/position^2", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """v |v|, (n, 1)."""
        return (state.velocity * np.abs(state.velocity))[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Drag at a speed that one can picture."""
        return (
            f"drag grows with the speed squared: {figure(1e4 * parameters['drag'])} raw at 100 %/s, "
            "a quarter of that at half the speed"
        )

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Second coefficient of the joint's `damping`: MuJoCo's force is -(a v + b v |v| + c v^3)."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        add_damping(joint, 0.0, unit * parameters["drag"])
        return f"joint[@name='{joint.get('name')}']/@damping"


EFFECT = QuadraticDamping()
