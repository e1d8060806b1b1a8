"""Joint wobble: a second, smaller rotation about another axis; seen in the markers by `diagnose.markers`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .base import Amplitude, Effect


class JointWobble(Effect):
    """The segment tilts across its axis as the angle grows."""

    name = "joint_wobble"
    station = "markers"
    unwritten = "its size is kept in hand.json; over which course of the angle it tilts is not, so no joint is written"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """None: no balance holds it."""
        return ()

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The largest tilt."""
        tilt_deg = math.degrees(parameters["amplitude"])
        joint = f"the {where['joint']} joint" if where.get("joint") else "a joint"
        return f"{joint} tilts by up to {tilt_deg:.2f} deg about a second axis as its angle grows"


EFFECT = JointWobble()
