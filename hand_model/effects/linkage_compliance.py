"""Linkage compliance: give in the linkage that grows with load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import figure
from .compliance import Compliance, at_driver, besides


class LinkageCompliance(Compliance):
    """distal = coupling(proximal - compliance load), or coupling(proximal) - compliance load."""

    name = "linkage_compliance"
    station = "linkage"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How far the segment stays back, at which end."""
        give, end = (
            figure(100 * parameters["compliance"]),
            "of the joint before it" if at_driver(parameters) else "of its own",
        )
        segment = where.get("joint") or "distal"
        return (
            f"the linkage gives: the {segment} segment stays back by {give} deg {end} for every 100 "
            f"raw of the motor's load{besides(parameters)}"
        )


EFFECT = LinkageCompliance()
