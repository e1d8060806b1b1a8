"""Friction of some passes only, in a fixed rhythm: a tooth that not every turn meets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure, position_range
from ..path import strokes
from .outsider import Outsider

# Rhythms: period in passes, the first pass of each period, how many passes in a row. Every second one is a direction,
# no rhythm.
RHYTHMS = (*((3, k, 1) for k in range(3)), *((4, k, 2) for k in range(4)), *((6, k, 2) for k in (0, 2, 4)))


class CycleMemory(Outsider):
    """F = A sign(v) in the passes of a rhythm, everywhere or times exp(-((x - centre) / width)^2 / 2); counted from
    each recording's start."""

    name = "cycle_memory"
    rubs = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The rhythm, and where in the range: a width beyond it means everywhere."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape("form", "1", 0.0, float(len(RHYTHMS) - 1), tuple(float(i) for i in range(len(RHYTHMS)))),
            Shape("centre", states[0].position_unit, low, high, tuple(np.linspace(low, high, 11)[1:-1].tolist())),
            Shape("width", states[0].position_unit, 0.01 * span, 2 * span, (0.05 * span, 2 * span)),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """What is everywhere has no centre."""
        points = super().grid(states)
        wide = max(p["width"] for p in points)
        return [p for p in points if p["width"] < wide or p["centre"] == points[0]["centre"]]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Either sign."""
        return (("height", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) times its place, in its passes, (n, 1)."""
        period, first, length = RHYTHMS[int(shape["form"])]
        low, high = float(np.min(state.position)), float(np.max(state.position))
        everywhere = shape["width"] > 0.5 * (high - low)
        count = _passes(state.position, None if everywhere else shape["centre"])
        place = 1.0 if everywhere else np.exp(-0.5 * ((state.position - shape["centre"]) / shape["width"]) ** 2)
        return (state.direction * ((count - first) % period < length) * place)[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How often and how much."""
        period, _, length = RHYTHMS[int(parameters["form"])]
        return f"friction is {figure(parameters['height'])} raw higher in {length} of {period} passes"


def _passes(position: Array, centre: float | None) -> Array:
    """Number (n,) of the stroke since the recording began, or of those that pass a place."""
    out, count = np.zeros(len(position)), -1
    for a, b, way in strokes(position):
        passes = way != 0 if centre is None else position[a:b].min() < centre < position[a:b].max()
        count += bool(passes)
        out[a:b] = count
    return out


EFFECT = CycleMemory()
