"""Drive backlash: lost motion between encoder and proximal segment."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .path import jenkins


class DriveBacklash(Effect):
    """The segment lags by half the gap in the direction of travel and crosses over within the gap after a reversal."""

    name = "drive_backlash"
    station = "encoder"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Width of the gap, [%] of the encoder's range."""
        low, high = position_range(states)
        span = high - low
        return (Shape("gap", states[0].position_unit, 0.002 * span, 0.12 * span, tuple(span * np.geomspace(0.004, 0.08, 6))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Half the lost motion as an angle, always a lag."""
        return (("half_play", "deg", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Minus the play's state in [-1, 1] along the path, (n, 1)."""
        return -jenkins(state.position, shape["gap"] / 2)[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Whole lost motion as an angle, and the gap on the encoder's side."""
        return {"play": 2 * amplitude["half_play"], "gap": shape["gap"]}


EFFECT = DriveBacklash()
