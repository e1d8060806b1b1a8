"""A reading whose scale changes: every load grows alike, friction and spring."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure
from .outsider import Outsider, moments


class GainChange(Outsider):
    """The declared effort times A h: h grows evenly over the session (form 0), or steps up at a moment (form 1)."""

    name = "gain_change"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The moment within the session, and the form."""
        return (Shape("form", "1", 0.0, 1.0, (0.0, 1.0)), moments(states))

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Nothing happens at a moment in form 0."""
        points = super().grid(states)
        return [p for p in points if p["form"] > 0.5 or p["moment"] == points[0]["moment"]]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Relative change, either sign."""
        return (("change", "1", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """What the declared model requires, times h, (n, 1)."""
        if "required" not in state.extra:
            return np.zeros((len(state.time_s), 0))
        total = state.extra.get("session_s", state.elapsed_s[-1:])[0]
        grown = state.elapsed_s / total if shape["form"] < 0.5 else (state.elapsed_s >= shape["moment"]).astype(float)
        return (grown * state.extra["required"])[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """By how much all readings grow."""
        how = "over the session" if parameters["form"] < 0.5 else f"at {figure(parameters['moment'])} s"
        return (
            f"all of the current changes by {100 * parameters['change']:+.0f} % {how}: its scale does, "
            "not the friction alone"
        )


EFFECT = GainChange()
