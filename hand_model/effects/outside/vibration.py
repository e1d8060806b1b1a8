"""A rhythm in time, whatever the drive does: somebody shakes the bench, something hums into the channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure, sample_interval
from .outsider import Outsider, of_its_record

RECORDS = 8  # that may be looked at; each has its own phase
SLOWEST_HZ, CYCLES = 0.3, 6  # slower, or fewer cycles in a recording, it is a wandering zero
PEAKS, FINER = 4, 4  # frequencies that are tried, and how much finer than a recording's own they are read


class Vibration(Outsider):
    """F = A cos(2 pi f t) + B sin(2 pi f t), A and B of each recording."""

    name = "vibration"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The frequency, up to half of what the log can show."""
        longest = max(float(s.time_s[-1] - s.time_s[0]) for s in states)
        low = max(SLOWEST_HZ, CYCLES / longest)
        high = max(0.25 / sample_interval(states), 2 * low)
        return (Shape("frequency", "Hz", low, high, tuple(np.arange(low, high, 1 / longest).tolist())),)

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """The highest peaks of the periodogram of what the declared model leaves."""
        from scipy.signal import find_peaks

        shape = self.shapes(states)[0]
        step = sample_interval(states)
        count = FINER * max(int((s.time_s[-1] - s.time_s[0]) / step) for s in states)
        power = np.zeros(count // 2 + 1)
        for state in states:
            if "required" in state.extra:
                left = np.nan_to_num(state.effort - state.extra["required"])
                even = np.interp(np.arange(state.time_s[0], state.time_s[-1], step), state.time_s, left)
                power += np.abs(np.fft.rfft(even, count)) ** 2
        rate = np.fft.rfftfreq(count, step)
        power = np.where((rate >= shape.low) & (rate <= shape.high), power, 0.0)
        peaks = find_peaks(power)[0]
        return [{"frequency": float(rate[i])} for i in sorted(peaks, key=lambda i: -power[i])[:PEAKS]]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Two for every recording."""
        return tuple((f"{part}_{i}", "effort", -np.inf, np.inf) for i in range(RECORDS) for part in ("cosine", "sine"))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The wave in its recording, (n, 2 RECORDS)."""
        phase = 2 * np.pi * shape["frequency"] * state.time_s
        return of_its_record(state, np.stack([np.cos(phase), np.sin(phase)], axis=-1), RECORDS)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Its frequency."""
        return (
            f"something shakes the drive or its reading at {figure(parameters['frequency'])} Hz, "
            "whatever the drive does"
        )


EFFECT = Vibration()
