"""A segment that follows late: damped, or filmed by another camera's clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState
from .outsider import Outsider


class LinkageLag(Outsider):
    """distal = coupling(proximal) - slope v A: where it would have been A ago."""

    name = "linkage_lag"
    station = "linkage"
    part_of = "linkage_compliance"  # what gives carries all that damps the segment, and little of the motor's friction

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """How late, or early where it is negative."""
        return (("lag", "s", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Speed of what follows, by its map, (n, 1)."""
        return (-state.slope * state.velocity)[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How late."""
        return f"the {where.get('joint') or 'distal'} segment follows {1e3 * parameters['lag']:.0f} ms late"


EFFECT = LinkageLag()
