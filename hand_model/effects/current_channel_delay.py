"""Current channel delay: current and position are not sampled at the same instant."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape


class CurrentChannelDelay(Effect):
    """measured(t) = current(t - delay): every column is read at an earlier (or later) time."""

    name = "current_channel_delay"
    warps = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Delay of the effort behind the position, up to eight samples either way."""
        step = float(np.median(np.concatenate([np.diff(s.time_s) for s in states])))
        return (Shape("delay", "s", -8 * step, 8 * step, tuple(step * k for k in (-6, -4, -2.5, -1.5, -0.75, 0.75, 1.5, 2.5, 4, 6))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude."""
        return ()

    def warp(self, state: DriveState, columns: Array, shape: Mapping[str, float]) -> Array:
        """Columns read at t - delay, linearly interpolated."""
        if not columns.shape[1]:
            return columns
        then = state.time_s - shape["delay"]
        return np.stack([np.interp(then, state.time_s, column) for column in columns.T], axis=-1)


EFFECT = CurrentChannelDelay()
