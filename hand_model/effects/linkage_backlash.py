"""Linkage backlash: lost motion between proximal and distal segment."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .path import jenkins


class LinkageBacklash(Effect):
    """The distal angle lags by half the gap in the direction of travel."""

    name = "linkage_backlash"
    station = "linkage"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Travel of the proximal angle within which the play is crossed."""
        low, high = position_range(states)
        span = high - low
        return (Shape("gap", states[0].position_unit, 0.003 * span, 0.12 * span, tuple(span * np.geomspace(0.006, 0.08, 6))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Half the lost motion of the distal angle, always a lag."""
        return (("half_play", "deg", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Minus the play's state in [-1, 1] along the path, (n, 1)."""
        return -jenkins(state.position, shape["gap"] / 2)[:, None]

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Whole lost motion of the distal angle, and the travel that crosses it."""
        return {"play": 2 * amplitude["half_play"], "gap": shape["gap"]}


EFFECT = LinkageBacklash()
