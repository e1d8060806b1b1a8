"""Encoder periodic error: an error periodic in counts (eccentric magnet, uneven poles)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class EncoderPeriodicError(Effect):
    """angle = map(encoder) + A sin(2 pi x / P + phase)."""

    name = "encoder_periodic_error"
    repeats = True  # further harmonics
    station = "encoder"
    unwritten = "the reading of the encoder is not what a simulation moves: kept in hand.json, the log is corrected in a copy"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Period, dense in wavenumber; what does not come three times in the range is no period."""
        low, high = position_range(states)
        span = high - low
        return (Shape("period", states[0].position_unit, 0.015 * span, span / 3, tuple(span / np.arange(3.0, 60.01, 0.25))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Sine and cosine parts."""
        return (("sine", "deg", -np.inf, np.inf), ("cosine", "deg", -np.inf, np.inf))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sin and cos of the encoder's phase, (n, 2)."""
        phase = 2 * np.pi * state.position / shape["period"]
        return np.stack([np.sin(phase), np.cos(phase)], axis=-1)

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Amplitude, period and phase [rad]."""
        return {"amplitude": float(np.hypot(amplitude["sine"], amplitude["cosine"])), "period": shape["period"],
                "phase": float(np.arctan2(amplitude["cosine"], amplitude["sine"]))}

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Amplitude as the effort, phase as an angle."""
        return {"amplitude": "effort", "phase": "rad"}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Error in degrees of the segment, and its period."""
        segment, error, period = where.get("joint") or "proximal", parameters["amplitude"], parameters["period"]
        return f"against the {segment} segment the encoder errs by ±{error:.2f} deg, repeating every {period:.2f} % of its range"


EFFECT = EncoderPeriodicError()
