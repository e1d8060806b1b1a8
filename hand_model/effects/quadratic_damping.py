"""Quadratic damping: drag growing with speed squared."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect


class QuadraticDamping(Effect):
    """F = b2 v |v|."""

    name = "quadratic_damping"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Drag coefficient, never negative."""
        return (("drag", "effort s^2/position^2", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """v |v|, (n, 1)."""
        return (state.velocity * np.abs(state.velocity))[:, None]


EFFECT = QuadraticDamping()
