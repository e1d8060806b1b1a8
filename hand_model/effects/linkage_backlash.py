"""Linkage backlash: lost motion between proximal and distal segment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .backlash import Backlash, behind_map, crossed_gradually, ends
from .input import map_of, write_play


class LinkageBacklash(Backlash):
    """distal = coupling(play(proximal))."""

    name = "linkage_backlash"
    station = "linkage"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much motion is lost, on both sides."""
        seen = f", {parameters['segment_gap']:.2f} deg of the segment" if "segment_gap" in parameters else ""
        segment, gap = where.get("joint") or "distal", parameters["gap"]
        return f"the {segment} segment loses {gap:.2f} deg of the joint before it when the motion turns{seen}{ends(parameters)}"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """An input joint behind the driver, or behind its map, within the gap; none of one that is
        crossed gradually."""
        if crossed_gradually(parameters):
            return None
        equality, behind = map_of(root, where, self.station), behind_map(parameters)
        gap = parameters["segment_gap" if behind else "gap"]
        return None if equality is None else write_play(root, equality, math.radians(gap), behind)


EFFECT = LinkageBacklash()
