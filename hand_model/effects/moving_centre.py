"""Moving centre: the centre of rotation travels with the angle; seen in the markers by `diagnose.markers`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Amplitude, Effect


class MovingCentre(Effect):
    """The segment is shifted across its axis as the angle grows (a rolling or a cam joint, wear)."""

    name = "moving_centre"
    station = "markers"
    unwritten = "its size is kept in hand.json; over which course of the angle it travels is not, so no joint is written"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """None: no balance holds it."""
        return ()

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The longest way."""
        joint = f"the {where['joint']} joint" if where.get("joint") else "a joint"
        return f"the centre of rotation of {joint} travels by up to {1e3 * parameters['travel']:.2f} mm as the angle grows"


EFFECT = MovingCentre()
