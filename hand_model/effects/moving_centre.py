"""Moving centre: the centre of rotation travels with the angle; seen in the markers by `diagnose.locate.markers`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Amplitude, Effect
from .mjcf import extra_joint


class MovingCentre(Effect):
    """The segment is shifted across its axis as the angle grows (a rolling or a cam joint, wear)."""

    name = "moving_centre"
    station = "markers"
    unwritten = "over which course of the angle it travels is not known, so no joint is written"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """None: no balance holds it."""
        return ()

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The longest way."""
        joint = f"the {where['joint']} joint" if where.get("joint") else "a joint"
        return (
            f"the centre of rotation of {joint} travels by up to {1e3 * parameters['travel']:.2f} mm as the angle grows"
        )

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Its joints are the segment's own, from the course in hand.json: where they are; None in a file without
        them."""
        return extra_joint(root, where, "travel")


EFFECT = MovingCentre()
