"""Elastoplastic hysteresis: load that builds up over a distance after each reversal (Jenkins; Iwan 1966)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .path import jenkins


class ElastoplasticHysteresis(Effect):
    """A stop operator of reach s: adds A clip(z + ds / s, -1, 1) to the friction."""

    name = "elastoplastic_hysteresis"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Reach of the elastic part, from 2.5 % of the range to all of it."""
        low, high = position_range(states)
        span = high - low
        return (Shape("reach", states[0].position_unit, 0.025 * span, 1.2 * span, tuple(span * np.geomspace(0.03, 0.9, 10))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Load at yield, never negative."""
        return (("yield_load", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Stop operator along the recorded path, (n, 1): half the reach from zero, the whole from one side to the other."""
        return jenkins(state.position, shape["reach"])[:, None]


EFFECT = ElastoplasticHysteresis()
