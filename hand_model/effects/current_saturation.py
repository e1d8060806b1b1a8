"""Current saturation: the current reading, or the drive, clips."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .mjcf import motor_joint, motor_sensor

BOTH, ABOVE, BELOW = range(3)
ONE_SIDED = 0.1  # probability of each of the two ways in which one end alone clips, as of an amplifier's offset


class CurrentSaturation(Effect):
    """measured = min(max(current, -limit), limit); of a reading that clips at one end only, one of the two."""

    name = "current_saturation"
    clips = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Clipping level, among the highest recorded efforts; readings cut for nearly half of the time leave room below
        it. form 0: at both ends; form 1: at the upper end only; form 2: at the lower."""
        levels = _levels(states)
        every = sorted({float(level) for values in levels.values() for level in values})
        return (
            Shape("form", "1", BOTH, BELOW, tuple(float(form) for form in levels)),
            Shape("limit", states[0].effort_unit, every[0], every[-1], tuple(every)),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Levels among the readings of the end that clips."""
        return [
            {"form": float(form), "limit": float(level)}
            for form, values in _levels(states).items()
            for level in values[1:]
        ]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude."""
        return ()

    def clip(self, prediction: Array, shape: Mapping[str, float]) -> Array:
        """The prediction within the limits."""
        return np.clip(prediction, *_ends(shape))

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Most that clips does so at both ends."""
        return math.log(3 * (1 - 2 * ONE_SIDED if parameters.get("form", BOTH) == BOTH else ONE_SIDED))

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """Share of the readings whose motion requires more than the limit."""
        required = [s.extra["required"][np.isfinite(s.effort)] for s in states if "required" in s.extra]
        if not required:
            return {}
        asked = np.concatenate(required)
        low, high = _ends({name: entry["value"] for name, entry in parameters.items()})
        return {"share_cut": {"value": float(np.mean((asked < low) | (asked > high))), "unit": "1"}}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The limit."""
        form, limit = parameters.get("form", BOTH), figure(parameters["limit"])
        if form == BOTH:
            return f"the current does not exceed {limit} raw: its reading, or the drive, clips there"
        return f"the current {'does not exceed ' if form == ABOVE else 'never falls below -'}{limit} raw: its reading clips"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """The cutoff of the sensor of the motor's current: the motion goes on, so what clips is the reading. None of one
        end alone, which such a cutoff cannot say."""
        if parameters.get("form", BOTH) != BOTH:
            return None
        found, place = motor_sensor(root, where, "current"), motor_joint(root, where)
        if found is None or place is None:
            return None
        found.set("cutoff", repr(place[1] * parameters["limit"]))
        return f"sensor/actuatorfrc[@name='{found.get('name')}']/@cutoff"

    def reading(self, effort: Array, time_s: Array, velocity: Array, parameters: Mapping[str, float]) -> Array:
        """The effort (n,) within the limit of the end that clips; a limit at both ends is the sensor's own."""
        return effort if parameters.get("form", BOTH) == BOTH else self.clip(effort, parameters)


def _levels(states: tuple[DriveState, ...]) -> dict[int, Array]:
    """Clipping levels of each form, from the least on."""
    effort = np.concatenate([s.effort[np.isfinite(s.effort)] for s in states])
    either = np.abs(effort) if len(effort) else np.ones(1)
    levels = {BOTH: np.linspace(min(np.percentile(either, 60), either.max() / 2), either.max(), 16)}
    for form, sign in ((ABOVE, 1.0), (BELOW, -1.0)):
        end = float(np.max(sign * effort, initial=0.0))
        if end > 0:
            levels[form] = np.linspace(end / 2, end, 9)
    return levels


def _ends(parameters: Mapping[str, float]) -> tuple[float, float]:
    """The lowest and the highest reading."""
    form, limit = parameters.get("form", BOTH), parameters["limit"]
    return -math.inf if form == ABOVE else -limit, math.inf if form == BELOW else limit


EFFECT = CurrentSaturation()
