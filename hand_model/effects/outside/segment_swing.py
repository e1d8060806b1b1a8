"""A segment, or what its markers stand on, that swings with acceleration: soft tissue, a loose cap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState
from .outsider import Outsider


class SegmentSwing(Outsider):
    """angle = map(driver) - A slope a: it stays behind by what it takes to speed it up, A = 1 / (resonance
    [rad/s])^2."""

    name = "segment_swing"
    station = "linkage"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Inverse square of the resonance, of either sign."""
        return (("inverse_square", "s2", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Acceleration of what follows, by its map, (n, 1)."""
        return (-state.slope * state.acceleration)[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How slow the resonance is."""
        rate = 1 / (2 * np.pi * np.sqrt(abs(parameters["inverse_square"]) + 1e-12))
        return (
            f"the {where.get('joint') or 'distal'} segment swings with acceleration, "
            f"like markers on something soft of {rate:.1f} Hz"
        )


EFFECT = SegmentSwing()
