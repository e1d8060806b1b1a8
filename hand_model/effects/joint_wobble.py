"""Joint wobble: a second, smaller rotation about another axis; seen in the markers by `diagnose.locate.markers`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .base import Amplitude, Effect
from .mjcf import extra_joint


class JointWobble(Effect):
    """The segment tilts across its axis as the angle grows."""

    name = "joint_wobble"
    station = "markers"
    unwritten = "over which course of the angle it tilts is not known, so no joint is written"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """None: no balance holds it."""
        return ()

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The largest tilt."""
        tilt_deg = math.degrees(parameters["amplitude"])
        joint = f"the {where['joint']} joint" if where.get("joint") else "a joint"
        return f"{joint} tilts by up to {tilt_deg:.2f} deg about a second axis as its angle grows"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Its joints are the segment's own, from the course in hand.json: where they are; None in a file without
        them."""
        return extra_joint(root, where, "wobble")


EFFECT = JointWobble()
