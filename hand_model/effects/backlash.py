"""Backlash: what follows is driven through a play, whichever pair of encoder and segments it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .driven import driven, segment_gap, soft_play


class Backlash(Effect):
    """follower = map(play(driver)): the lag and the travel that crosses it are one gap."""

    replaces = "power_1"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Full width of the gap on the driver's side; form 0: hard ends, form 1: ends that give (half to one and a half gap)."""
        low, high = position_range(states)
        span = high - low
        return (Shape("gap", states[0].position_unit, 1e-4 * span, 0.15 * span, tuple(span * np.geomspace(0.002, 0.1, 8))),
                Shape("form", "1", 0.0, 1.0, (0.0, 1.0)))

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude: the map is fitted anew behind the gap."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The map's columns of the position behind the gap."""
        return driven(state, lambda x: soft_play(x, shape["gap"], 0.5 * shape["form"]))

    def further(self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
        """The gap as what follows shows it."""
        return {"segment_gap": segment_gap(states, parameters["gap"])}
