"""Encoder periodic error: an error periodic in counts (eccentric magnet, uneven poles)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import DriveState, Shape, position_range
from .sinusoid import Sinusoid


class EncoderPeriodicError(Sinusoid):
    """angle = map(encoder) + A sin(2 pi x / P + phase)."""

    name = "encoder_periodic_error"
    station = "encoder"
    recorded = True
    unwritten = (
        "the reading of the encoder is not what a simulation moves: kept in hand.json, the log is corrected in a copy"
    )

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Period, dense in wavenumber; what does not come three times in the range is no period."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape("period", states[0].position_unit, 0.015 * span, span / 3, tuple(span / np.arange(3.0, 60.01, 0.25))),
        )

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Error in degrees of the segment, and its period."""
        segment, error, period = where.get("joint") or "proximal", parameters["amplitude"], parameters["period"]
        return (
            f"against the {segment} segment the encoder errs by ±{error:.2f} deg, "
            f"repeating every {period:.2f} % of its range"
        )


EFFECT = EncoderPeriodicError()
