"""Linkage backlash: lost motion between proximal and distal segment."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .path import jenkins


class LinkageBacklash(Effect):
    """What follows lags by half the gap, taken on the proximal angle: map(x - gap/2 * play state)."""

    name = "linkage_backlash"
    station = "linkage"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Travel of the proximal angle that crosses the play."""
        low, high = position_range(states)
        span = high - low
        return (Shape("crossing", states[0].position_unit, 0.002 * span, 0.15 * span, tuple(span * np.geomspace(0.004, 0.1, 7))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Half the lost motion of the proximal angle, always a lag."""
        return (("half_play", "deg", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Minus the play's state in [-1, 1] along the path, times the slope of the map that follows it, (n, 1)."""
        return -(state.slope * jenkins(state.position, shape["crossing"] / 2))[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Whole lost motion (as seen: twice the lag), and the travel that crosses it."""
        return {"play": 2 * amplitude["half_play"], "crossing": shape["crossing"]}


EFFECT = LinkageBacklash()
