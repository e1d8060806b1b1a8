"""Series elasticity: give between encoder and proximal segment that grows with load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import figure
from .compliance import Compliance, at_driver, besides


class SeriesElasticity(Compliance):
    """angle = map(encoder - compliance load), or map(encoder) - compliance load."""

    name = "series_elasticity"
    station = "encoder"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How far the segment stays back, at which end."""
        give, end = (
            figure(100 * parameters["compliance"]),
            "% of the encoder's range" if at_driver(parameters) else "deg",
        )
        segment = where.get("joint") or "proximal"
        return (
            f"the drive train gives: the {segment} segment stays back by {give} {end} for every 100 "
            f"raw of the motor's load{besides(parameters)}"
        )


EFFECT = SeriesElasticity()
