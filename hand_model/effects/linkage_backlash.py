"""Linkage backlash: lost motion between proximal and distal segment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .backlash import Backlash, ends


class LinkageBacklash(Backlash):
    """distal = coupling(play(proximal))."""

    name = "linkage_backlash"
    station = "linkage"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much motion is lost, on both sides."""
        seen = f", {parameters['segment_gap']:.2f} deg of the segment" if "segment_gap" in parameters else ""
        segment, gap = where.get("joint") or "distal", parameters["gap"]
        return f"the {segment} segment loses {gap:.2f} deg of the joint before it when the motion turns{seen}{ends(parameters)}"


EFFECT = LinkageBacklash()
