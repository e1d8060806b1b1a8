"""What repeats with position: a sine and a cosine of one period."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect


class Sinusoid(Effect):
    """A sin(2 pi x / P + phase) of the position x, its period one of the shapes."""

    repeats = True  # further harmonics

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Sine and cosine parts."""
        return (("sine", "effort", -np.inf, np.inf), ("cosine", "effort", -np.inf, np.inf))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sin and cos of the position's phase, (n, 2)."""
        phase = 2 * np.pi * state.position / shape["period"]
        return np.stack([np.sin(phase), np.cos(phase)], axis=-1)

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Amplitude, period and phase [rad]."""
        return {
            "amplitude": float(np.hypot(amplitude["sine"], amplitude["cosine"])),
            "period": shape["period"],
            "phase": float(np.arctan2(amplitude["cosine"], amplitude["sine"])),
        }

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Amplitude as the effort, phase as an angle."""
        return {"amplitude": "effort", "phase": "rad"}
