"""Backlash: what follows is driven through a play, whichever pair of encoder and segments it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import LOST_MOTION, Amplitude, Array, DriveState, Effect, Shape, position_range
from .driven import driven, path_behind, segment_gap, soft_play
from .input import map_of, write_play
from .law import Bristle, Law
from .path import dahl

HARD, SOFT, HARD_BEHIND, SOFT_BEHIND, GRADUAL = 0.0, 1.0, 2.0, 3.0, 4.0
SOFTNESS = 0.5
RARE = 4.0  # log evidence that a gap which is crossed gradually must bring beyond one with ends


class Backlash(Effect):
    """follower = map(play(driver)), or play(map(driver)): the lag and the travel that crosses it are one gap."""

    replaces = "power_1"
    family = LOST_MOTION

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Full width of the gap in the driver's unit; form 0: at the driver, hard ends; form 1: ends that give (half to
        one and a half gap); forms 2 and 3: the same at what follows, that wide where its map has its mean slope; form
        4: crossed gradually, two thirds of it within a reach of its own (Dahl 1968), as cables and soft teeth do."""
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
            Shape("form", "1", HARD, GRADUAL, (HARD, SOFT, HARD_BEHIND, SOFT_BEHIND, GRADUAL)),
            Shape(
                "reach",
                states[0].position_unit,
                0.015 * span,
                0.2 * span,
                (0.03 * span, 0.08 * span),
                forms=(GRADUAL,),
            ),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude: the map is fitted anew behind the gap."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The map's columns of the position behind the gap."""
        if shape["form"] == GRADUAL:
            return driven(state, lambda x: x - 0.5 * shape["gap"] * dahl(x, shape["reach"]))
        softness = SOFTNESS if gives_way(shape) else 0.0
        if shape["form"] < HARD_BEHIND:
            return driven(state, lambda x: soft_play(x, shape["gap"], softness))

        def lagging(x: Array) -> Array:
            path, rate = path_behind(state, x)
            return x + (soft_play(path, shape["gap"], softness) - path) / rate

        return driven(state, lagging)

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """The gap and its form; the reach of what is crossed gradually."""
        return {name: value for name, value in shape.items() if name != "reach" or shape["form"] == GRADUAL}

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Most gaps have ends."""
        return -RARE if parameters["form"] == GRADUAL else 0.0

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """An input joint behind the driver, or behind its map, within the gap; none of one that is crossed gradually."""
        if crossed_gradually(parameters):
            return None
        equality, behind = map_of(root, where, self.station), behind_map(parameters)
        gap = parameters["segment_gap" if behind else "gap"]
        turns = behind or self.station == "linkage"  # else the driver is the motor, in percent
        return None if equality is None else write_play(root, equality, math.radians(gap) if turns else gap, behind)

    def law(self, parameters: Mapping[str, float]) -> Law | None:
        """Of a gap that is crossed gradually, which no play of MJCF is, what follows lags by."""
        if not crossed_gradually(parameters):
            return None
        half, bristle = 0.5 * parameters["gap"], Bristle(parameters["reach"])
        return lambda now: -half * bristle(now.position) * now.slope

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """The gap as what follows shows it."""
        return {"segment_gap": segment_gap(states, parameters["gap"])}


def ends(parameters: Mapping[str, float]) -> str:
    """What a sentence says of how a gap ends; nothing of a hard one."""
    if crossed_gradually(parameters):
        return f", gradually, two thirds of it within {parameters['reach']:.1f}"
    return ", with ends that give" if gives_way(parameters) else ""


def crossed_gradually(parameters: Mapping[str, float]) -> bool:
    """Whether a gap has no ends."""
    return parameters.get("form", HARD) == GRADUAL


def gives_way(parameters: Mapping[str, float]) -> bool:
    """Whether the ends of a gap give."""
    return parameters.get("form", HARD) in (SOFT, SOFT_BEHIND)


def behind_map(parameters: Mapping[str, float]) -> bool:
    """Whether a gap lies behind the map, as wide everywhere in the unit of what follows."""
    return HARD_BEHIND <= parameters.get("form", HARD) < GRADUAL and "segment_gap" in parameters
