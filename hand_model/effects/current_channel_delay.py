"""Current channel delay: current and position are not sampled at the same instant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import SURE_DELAY, Amplitude, Array, DriveState, Effect, Shape, sample_interval
from .mjcf import delay, motor_sensor

ALIKE = 2.0  # standard deviations within which two delays are the same
SEVERAL = 2.0  # sample intervals: a current so late shows at any start, whatever controller is simulated
FIRST_SEEN = 0.1  # of a filter's time constant: a rise of ten times what is noticed


class CurrentChannelDelay(Effect):
    """measured(t) = current(t - delay) (form 0), or the current behind a first-order filter of that time constant (form
    1)."""

    name = "current_channel_delay"
    warps = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Delay of the effort behind the position, up to eight samples either way."""
        step = sample_interval(states)
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape(
                "delay",
                "s",
                -8 * step,
                8 * step,
                tuple(step * k for k in (-6, -4, -2.5, -1.5, -0.75, 0.75, 1.5, 2.5, 4, 6)),
            ),
        )

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
        if _filters(shape):
            return _filtered(columns, state.time_s, shape["delay"])
        then = np.clip(state.time_s - shape["delay"], state.time_s[0], state.time_s[-1])
        after = np.clip(np.searchsorted(state.time_s, then), 1, len(then) - 1)
        share = ((then - state.time_s[after - 1]) / (state.time_s[after] - state.time_s[after - 1]))[:, None]
        return (1 - share) * columns[after - 1] + share * columns[after]

    def lateness(self, shape: Mapping[str, float]) -> tuple[float, float]:
        """How late [s] a sudden rise of the current is seen, at least and at most: behind a filter that depends on its
        height over the noise; of a negative delay, on whether the current comes early or the position late."""
        delay_s = shape["delay"]
        return (FIRST_SEEN * delay_s, delay_s) if _filters(shape) else (delay_s, max(delay_s, 0.0))

    def told_otherwise(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> bool:
        """Whether answers to commands, or a simulation, surely say the current as late ("late" in `extra`), by several
        samples."""
        late_s, doubt_s = states[0].extra.get("late", (0.0, np.inf))
        earliest_s, latest_s = self.lateness(shape)
        apart_s = max(earliest_s - late_s, late_s - latest_s, 0.0)
        least_s = max(SURE_DELAY * doubt_s, SEVERAL * sample_interval(states))
        return bool(abs(late_s) > least_s and apart_s < ALIKE * doubt_s)

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """The delay by the answers to commands, where they tell it to a sample interval ("late" in `extra`): what a
        motion shows of it is its starts, whose estimate is smoothed."""
        late = states[0].extra.get("late")
        step = sample_interval(states)
        if late is None or late[1] > step or parameters["form"]["value"] > 0.5 or parameters["delay"]["value"] <= 0:
            return {}
        low, high = (float(late[0] + sign * 1.96 * late[1]) for sign in (-1, 1))
        return {"delay": {"value": float(late[0]), "unit": "s", "ci95": [low, high]}}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Which channel comes first and by how much, or the filter's time constant."""
        delay_ms = 1e3 * parameters["delay"]
        if _filters(parameters):
            return f"the current is read behind a low-pass filter with a time constant of {delay_ms:.1f} ms"
        when = "later" if delay_ms < 0 else "earlier"
        return f"the current was sampled {abs(delay_ms):.1f} ms {when} than the position beside it in the log"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """The delay of the sensor of the motor's current, or of its encoder where the current is read early; a sensor
        cannot filter."""
        if _filters(parameters):
            return None
        found = motor_sensor(root, where, "current" if parameters["delay"] >= 0 else "encoder")
        return None if found is None else delay(root, found, abs(parameters["delay"]))

    def reading(self, effort: Array, time_s: Array, velocity: Array, parameters: Mapping[str, float]) -> Array:
        """The effort (n,) behind the filter; a plain delay is the sensor's own."""
        return _filtered(effort, time_s, parameters["delay"]) if _filters(parameters) else effort


def _filters(shape: Mapping[str, float]) -> bool:
    return shape.get("form", 0.0) > 0.5 and shape["delay"] > 0


def _filtered(values: Array, time_s: Array, constant_s: float) -> Array:
    """Values (n,) or (n, k) behind a first-order filter that starts at rest, at the median sample interval."""
    from scipy.signal import lfilter

    keep = np.exp(-np.median(np.diff(time_s)) / constant_s)
    return lfilter([1 - keep], [1.0, -keep], values - values[0], axis=0) + values[0]


EFFECT = CurrentChannelDelay()
