"""Current saturation: the current reading, or the drive, clips."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .mjcf import motor_joint, motor_sensor


class CurrentSaturation(Effect):
    """measured = min(max(current, -limit), limit)."""

    name = "current_saturation"
    clips = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Clipping level, among the highest recorded efforts; readings cut for nearly half of the time leave room below
        it."""
        effort = np.concatenate([np.abs(s.effort[np.isfinite(s.effort)]) for s in states])
        low, high = (min(np.percentile(effort, 60), effort.max() / 2), effort.max()) if len(effort) else (0.0, 1.0)
        return (Shape("limit", states[0].effort_unit, float(low), float(high), tuple(np.linspace(low, high, 16)[1:])),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude."""
        return ()

    def clip(self, prediction: Array, shape: Mapping[str, float]) -> Array:
        """The prediction within the limits."""
        return np.clip(prediction, -shape["limit"], shape["limit"])

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """Share of the readings whose motion requires more than the limit."""
        required = [np.abs(s.extra["required"][np.isfinite(s.effort)]) for s in states if "required" in s.extra]
        if not required:
            return {}
        return {
            "share_cut": {"value": float(np.mean(np.concatenate(required) > parameters["limit"]["value"])), "unit": "1"}
        }

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The limit."""
        return f"the current does not exceed {figure(parameters['limit'])} raw: its reading, or the drive, clips there"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """The cutoff of the sensor of the motor's current: the motion goes on, so what clips is the reading."""
        found, place = motor_sensor(root, where, "current"), motor_joint(root, where)
        if found is None or place is None:
            return None
        found.set("cutoff", repr(place[1] * parameters["limit"]))
        return f"sensor/actuatorfrc[@name='{found.get('name')}']/@cutoff"


EFFECT = CurrentSaturation()
