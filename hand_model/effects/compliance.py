"""Give that grows with load, between what drives and what follows."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape
from .law import Law


class Compliance(Effect):
    """The part behind stays back by compliance * load, at the driver's end (follower = map(driver - give)) or at its
    own.

    The load is what the motor's current passes on. What of it depends on position alone is in the map already: the
    compliance is known from what friction and speed add.
    """

    family = "lost motion"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """form 0: give at the driver's end, in its unit; form 1: at the end of what follows, in its unit."""
        loaded = all("load" in s.extra for s in states)
        return (Shape("form", "1", 0.0, 1.0, (0.0, 1.0) if loaded else ()),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Compliance, always yielding to the load."""
        return (("compliance", "position/raw", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Minus the load, (n, 1), times the map's slope where the give is at the driver's end."""
        return -(state.extra["load"] * (state.slope if shape["form"] == 0.0 else 1.0))[:, None]

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Of what yields: the driver's or the follower's position."""
        return {"compliance": "position/raw" if shape["form"] == 0.0 else "effort/raw"}

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Minus compliance times load, through the map's slope where the give is at the driver's end."""
        compliance, at_driver = parameters["compliance"], parameters.get("form", 1.0) == 0.0
        return lambda now: -compliance * now.load * (now.slope if at_driver else math.radians(1.0))
