"""Nonlinear spring: the return spring stiffens or softens (cubic term over the range)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect


class NonlinearSpring(Effect):
    """F = k x + A (x / span)^3 beyond the declared line."""

    name = "nonlinear_spring"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Cubic stiffness, either sign."""
        return (("cubic_stiffness", "effort/position^3", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """x^3, (n, 1), x in the drive's unit."""
        return (state.position**3)[:, None]


EFFECT = NonlinearSpring()
