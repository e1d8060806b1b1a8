"""Drive backlash: lost motion between encoder and proximal segment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .backlash import Backlash, behind_map, crossed_gradually, ends
from .input import map_of, write_play


class DriveBacklash(Backlash):
    """angle = map(play(encoder))."""

    name = "drive_backlash"
    station = "encoder"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much motion is lost, on both sides."""
        seen = f", {parameters['segment_gap']:.2f} deg of the segment" if "segment_gap" in parameters else ""
        segment, gap = where.get("joint") or "proximal", parameters["gap"]
        return f"the {segment} segment loses {gap:.2f} % of the encoder's range when the motion turns{seen}{ends(parameters)}"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """An input joint behind the motor joint, or behind its map, within the gap; none of one that is
        crossed gradually."""
        if crossed_gradually(parameters):
            return None
        equality, behind = map_of(root, where, self.station), behind_map(parameters)
        gap = math.radians(parameters["segment_gap"]) if behind else parameters["gap"]
        return None if equality is None else write_play(root, equality, gap, behind)


EFFECT = DriveBacklash()
