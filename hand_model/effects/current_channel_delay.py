"""Current channel delay: current and position are not sampled at the same instant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape
from .mjcf import delay, motor_sensor


class CurrentChannelDelay(Effect):
    """measured(t) = current(t - delay) (form 0), or the current behind a first-order filter of that time constant (form 1)."""

    name = "current_channel_delay"
    warps = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Delay of the effort behind the position, up to eight samples either way."""
        step = float(np.median(np.concatenate([np.diff(s.time_s) for s in states])))
        return (Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
                Shape("delay", "s", -8 * step, 8 * step, tuple(step * k for k in (-6, -4, -2.5, -1.5, -0.75, 0.75, 1.5, 2.5, 4, 6))))

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """A filter only looks back."""
        return [p for p in super().grid(states) if p["form"] < 0.5 or p["delay"] > 0]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude."""
        return ()

    def warp(self, state: DriveState, columns: Array, shape: Mapping[str, float]) -> Array:
        """Columns read at t - delay, linearly interpolated, or filtered at the median sample interval."""
        if not columns.shape[1]:
            return columns
        if shape["form"] > 0.5 and shape["delay"] > 0:
            from scipy.signal import lfilter

            keep = np.exp(-np.median(np.diff(state.time_s)) / shape["delay"])
            return lfilter([1 - keep], [1.0, -keep], columns - columns[0], axis=0) + columns[0]
        then = state.time_s - shape["delay"]
        return np.stack([np.interp(then, state.time_s, column) for column in columns.T], axis=-1)

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """The delay of the sensor of the motor's current, or of its encoder where the current is read early."""
        found = motor_sensor(root, where, "current" if parameters["delay"] >= 0 else "encoder")
        return None if found is None else delay(root, found, abs(parameters["delay"]))


EFFECT = CurrentChannelDelay()
