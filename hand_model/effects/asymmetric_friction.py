"""Asymmetric friction: Coulomb friction differs between flexion and extension."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Effect


class AsymmetricFriction(Effect):
    """What lopsided friction adds to the current is constant, as a preload is: the declared preload takes it up, and
    only other motors tell that it is unlike them (`diagnose.locate.preload`)."""

    name = "asymmetric_friction"
    station = "motors"
    of_the_hand = False  # the declared preload holds it
    unwritten = "the spring's preload in the compiled file holds it: along a motion the two are the same"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much, which way, and what else it may be."""
        half = parameters["half_difference"]
        way = "flexing" if half > 0 else "extending"
        return (
            f"the motor needs some {abs(half):.0f} raw more {way}, and less the other way, than the hand's others: "
            "lopsided friction or another preload (from current alone the same)"
        )


EFFECT = AsymmetricFriction()
