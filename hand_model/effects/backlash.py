"""Backlash: what follows is driven through a play, whichever pair of encoder and segments it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .driven import driven, path_behind, segment_gap, soft_play

HARD, SOFT, HARD_BEHIND, SOFT_BEHIND = 0.0, 1.0, 2.0, 3.0
SOFTNESS = 0.5


class Backlash(Effect):
    """follower = map(play(driver)), or play(map(driver)): the lag and the travel that crosses it are one gap."""

    replaces = "power_1"
    family = "lost motion"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Full width of the gap in the driver's unit; form 0: at the driver, hard ends; form 1: ends that give (half to
        one and a half gap); forms 2 and 3: the same at what follows, that wide where its map has its mean slope."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape(
                "gap",
                states[0].position_unit,
                1e-4 * span,
                0.15 * span,
                tuple(span * np.geomspace(0.002, 0.1, 8)),
                True,
            ),
            Shape("form", "1", HARD, SOFT_BEHIND, (HARD, SOFT, HARD_BEHIND, SOFT_BEHIND)),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude: the map is fitted anew behind the gap."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The map's columns of the position behind the gap."""
        softness = SOFTNESS if gives_way(shape) else 0.0
        if shape["form"] < HARD_BEHIND:
            return driven(state, lambda x: soft_play(x, shape["gap"], softness))
        path, rate = path_behind(state)
        return driven(state, lambda x: x + (soft_play(path, shape["gap"], softness) - path) / rate)

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """The gap as what follows shows it."""
        return {"segment_gap": segment_gap(states, parameters["gap"])}


def gives_way(parameters: Mapping[str, float]) -> bool:
    """Whether the ends of a gap give."""
    return parameters.get("form", HARD) in (SOFT, SOFT_BEHIND)
