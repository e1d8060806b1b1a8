"""Position-dependent friction: a tight spot that opposes motion both ways in one part of the range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .law import Law, Moment
from .spot import spots

EDGE, APART = 0.05, 1.8  # of the range, at either end, where none begins to be looked for, and widths between them


class PositionDependentFriction(Effect):
    """F = sign(v) A exp(-((x - c) / w)^2 / 2)."""

    name = "position_dependent_friction"
    rubs = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Centre over the range, width from 1.5 % to 12.5 % of it: what takes more than half of the range (two widths on
        either side) is no spot."""
        low, high = position_range(states)
        span, unit = high - low, states[0].position_unit
        return (
            Shape(
                "centre", unit, low + 0.03 * span, high - 0.03 * span, tuple(low + span * np.linspace(0.05, 0.95, 19))
            ),
            Shape("width", unit, 0.015 * span, 0.125 * span, (0.03 * span, 0.06 * span, 0.12 * span)),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Side by side over the range."""
        return spots(*position_range(states), EDGE, APART)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Extra friction at the centre, never negative."""
        return (("extra_friction", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) times a bell over position, (n, 1)."""
        bell = np.exp(-0.5 * ((state.friction_position - shape["centre"]) / shape["width"]) ** 2)
        return (state.direction * bell)[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Bell and its height, also as a ratio to Coulomb friction."""
        return {**shape, **amplitude, "ratio": amplitude["extra_friction"] / (declared.get("coulomb") or np.nan)}

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """Two widths about the centre."""
        c, w = shape["centre"], shape["width"]
        return {"position": [c - 2 * w, c + 2 * w], "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Where, how large, and against the friction elsewhere."""
        at, width, extra = parameters["centre"], parameters["width"], parameters["extra_friction"]
        ratio = (
            f", {figure(parameters['ratio'])} times the Coulomb friction" if parameters.get("ratio", 0.0) > 0 else ""
        )
        return (
            f"a tight spot between {at - 2 * width:.1f} and {at + 2 * width:.1f} %: "
            f"up to {figure(extra)} raw more friction both ways{ratio}, most at {at:.1f} %"
        )

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Friction under a bell, read where the bristles are."""
        centre, width, extra = (parameters[k] for k in ("centre", "width", "extra_friction"))

        def load(now: Moment) -> float:
            u = (now.position - now.direction * now.give - centre) / width
            return extra * now.direction * math.exp(-0.5 * u * u)

        return load


EFFECT = PositionDependentFriction()
