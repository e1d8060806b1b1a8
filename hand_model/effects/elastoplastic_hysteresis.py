"""Elastoplastic hysteresis: load that builds up over a distance after each reversal (Jenkins; Iwan 1966)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .path import dahl, jenkins


class ElastoplasticHysteresis(Effect):
    """Adds A z to the friction: a stop operator z = clip(z + ds / s, -1, 1) (form 0), or an exponential build-up (form 1)."""

    name = "elastoplastic_hysteresis"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Reach of the elastic part, from 2.5 % of the range to all of it."""
        low, high = position_range(states)
        span = high - low
        return (Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
                Shape("reach", states[0].position_unit, 0.025 * span, 1.2 * span, tuple(span * np.geomspace(0.03, 0.9, 10))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Load at yield, never negative."""
        return (("yield_load", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """State along the recorded path, (n, 1), in [-1, 1]."""
        operator = jenkins if shape["form"] < 0.5 else dahl
        return operator(state.position, shape["reach"])[:, None]


EFFECT = ElastoplasticHysteresis()
