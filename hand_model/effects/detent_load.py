"""Detent load: a load tied to one part of the range that does not change sign with direction."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .law import Law, Moment
from .spot import spots

EDGE = 0.08  # of the range, at either end, where no centre is
APART = {0.0: 1.8, 1.0: 1.2}  # form -> widths


class DetentLoad(Effect):
    """F = A exp(-u^2 / 2), u = (x - c) / w, either sign (form 0); or F = A u exp((1 - u^2) / 2), in and out of a notch
    (form 1)."""

    name = "detent_load"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Centre over the range, width from 1.5 % to 12.5 % of it: what takes more than half of the range (two widths on
        either side) is a spring."""
        low, high = position_range(states)
        span, unit = high - low, states[0].position_unit
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape(
                "centre",
                unit,
                low + EDGE * span,
                high - EDGE * span,
                tuple(low + span * np.linspace(EDGE, 1 - EDGE, 18)),
            ),
            Shape("width", unit, 0.015 * span, 0.125 * span, (0.03 * span, 0.06 * span, 0.12 * span)),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Both forms, side by side over the range: one that changes its sign within its width the closer."""
        low, high = position_range(states)
        return [{"form": form, **spot} for form, apart in APART.items() for spot in spots(low, high, EDGE, apart)]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Load at the centre, either sign."""
        return (("load", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """A bell over position, or its slope, of unit height, (n, 1)."""
        u = (state.position - shape["centre"]) / shape["width"]
        bell = np.exp(-0.5 * u**2)
        return (bell if shape["form"] < 0.5 else u * bell * np.exp(0.5))[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """Two widths about the centre."""
        c, w = shape["centre"], shape["width"]
        return {"position": [c - 2 * w, c + 2 * w], "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Where, how large, and whether it is a load, a notch or a hump."""
        at, width, load = parameters["centre"], parameters["width"], parameters["load"]
        if parameters["form"] < 0.5:
            side = "against" if load > 0 else "towards"
            return (
                f"between {at - 2 * width:.1f} and {at + 2 * width:.1f} % a load acts {side} flexion whichever way the "
                f"motor moves, up to {figure(abs(load))} raw at {at:.1f} %"
            )
        kind, way = ("notch", "towards") if load > 0 else ("hump", "away from")
        return (
            f"a {kind} at {at:.1f} %: a load of up to {figure(abs(load))} raw {way} it, "
            f"largest {width:.1f} % on either side"
        )

    def law(self, parameters: Mapping[str, float]) -> Law:
        """A bell over position, or its slope."""
        centre, width, height = (parameters[k] for k in ("centre", "width", "load"))

        def load(now: Moment) -> float:
            u = (now.position - centre) / width
            bell = math.exp(-0.5 * u * u)
            return height * (bell if parameters["form"] < 0.5 else u * bell * math.exp(0.5))

        return load


EFFECT = DetentLoad()
