"""Drive backlash: lost motion between encoder and proximal segment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .backlash import Backlash, ends


class DriveBacklash(Backlash):
    """angle = map(play(encoder))."""

    name = "drive_backlash"
    station = "encoder"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much motion is lost, on both sides."""
        seen = f", {parameters['segment_gap']:.2f} deg of the segment" if "segment_gap" in parameters else ""
        segment, gap = where.get("joint") or "proximal", parameters["gap"]
        return f"the {segment} segment loses {gap:.2f} % of the encoder's range when the motion turns{seen}{ends(parameters)}"


EFFECT = DriveBacklash()
