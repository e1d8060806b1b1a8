"""Current saturation: the current reading, or the drive, clips."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .mjcf import motor_joint, motor_sensor
from .pile_up import piled_up

BOTH, ABOVE, BELOW = range(3)
NONE = (0.0, 0.0)
# log odds from which readings that pile up say that they clip (of some 3000 healthy motors the largest is 6), and as
# much of these as counts
PILED, MOST = 14.0, 40.0
# of the largest reading, at least, is a limit at which readings pile up: the mean of noise that clips lies below
THERE = 0.8
ONE_SIDED = 0.1  # probability of each of the two ways in which one end alone clips, as of an amplifier's offset


class CurrentSaturation(Effect):
    """measured = min(max(current, -limit), limit); of a reading that clips at one end only, one of the two. A reading that
    clips piles up at its end, which says so without any motion."""

    name = "current_saturation"
    clips = True

    def __init__(self, upper: tuple[float, float] = NONE, lower: tuple[float, float] = NONE) -> None:
        """upper, lower: the largest reading at each end, and the log odds that readings pile up there."""
        self.upper, self.lower = upper, lower

    def among(self, states: tuple[DriveState, ...]) -> CurrentSaturation:
        """With what these readings alone say of clipping."""
        return CurrentSaturation(
            *((_end(states, sign), piled_up([sign * s.effort for s in states])) for sign in (1.0, -1.0))
        )

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
        """Levels among the readings of the end that clips; where readings pile up, there."""
        every = [
            {"form": float(form), "limit": float(level)}
            for form, values in _levels(states).items()
            for level in values[1:]
        ]
        return [shape for shape in every if self._piles(shape)] or every

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude."""
        return ()

    def clip(self, prediction: Array, shape: Mapping[str, float]) -> Array:
        """The prediction within the limits."""
        return np.clip(prediction, *_ends(shape))

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Most that clips does so at both ends, and readings pile up there."""
        ends = math.log(3 * (1 - 2 * ONE_SIDED if parameters.get("form", BOTH) == BOTH else ONE_SIDED))
        return ends + min(max((odds for _, odds in self._piles(parameters)), default=0.0), MOST)

    def told_otherwise(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> bool:
        """Whether readings pile up at the limit."""
        return bool(self._piles(shape))

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Form and limit; the largest reading where readings pile up there, below which their mean lies."""
        return {**shape, "limit": min((end for end, _ in self._piles(shape)), default=shape["limit"])}

    def _piles(self, parameters: Mapping[str, float]) -> list[tuple[float, float]]:
        """The ends, each with its log odds, at which readings pile up at this limit."""
        form = parameters.get("form", BOTH)
        ends = [end for end, other in ((self.upper, BELOW), (self.lower, ABOVE)) if form != other]
        return [(end, odds) for end, odds in ends if odds > PILED and parameters["limit"] > THERE * end]

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


def _read(states: tuple[DriveState, ...]) -> Array:
    """All efforts (n,) that were read."""
    return np.concatenate([np.zeros(0), *(s.effort[np.isfinite(s.effort)] for s in states)])


def _end(states: tuple[DriveState, ...], sign: float) -> float:
    """The largest reading of an end, at least zero."""
    return float(np.max(sign * _read(states), initial=0.0))


def _levels(states: tuple[DriveState, ...]) -> dict[int, Array]:
    """Clipping levels of each form, from the least on."""
    effort = _read(states)
    either = np.abs(effort) if len(effort) else np.ones(1)
    levels = {BOTH: np.linspace(min(np.percentile(either, 60), either.max() / 2), either.max(), 16)}
    for form, sign in ((ABOVE, 1.0), (BELOW, -1.0)):
        end = _end(states, sign)
        if end > 0:
            levels[form] = np.linspace(end / 2, end, 9)
    return levels


def _ends(parameters: Mapping[str, float]) -> tuple[float, float]:
    """The lowest and the highest reading."""
    form, limit = parameters.get("form", BOTH), parameters["limit"]
    return -math.inf if form == ABOVE else -limit, math.inf if form == BELOW else limit


EFFECT = CurrentSaturation()
