"""Viscoelastic spring: the spring relaxes or creeps (one Maxwell branch beside the declared spring)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, sample_interval
from .law import Law, Moment
from .path import lowpass

SOONEST = 15  # samples


class ViscoelasticSpring(Effect):
    """F = k1 (x - y), dy/dt = (x - y) / tau."""

    name = "viscoelastic_spring"
    drifting = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Relaxation time between fifteen samples, for which a motion is not known well after a start, and the length of
        the longest trial: a branch that relaxes sooner is viscous friction."""
        step = sample_interval(states)
        longest = max(float(s.time_s[-1] - s.time_s[0]) for s in states)
        low, high = SOONEST * step, max(longest, 4 * SOONEST * step)
        return (Shape("relaxation_time", "s", low, high, tuple(np.geomspace(1.5 * low, 0.7 * high, 9))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Stiffness of the branch, never negative."""
        return (("stiffness", "effort/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """x minus its low pass, (n, 1)."""
        return (state.position - lowpass(state.time_s, state.position, shape["relaxation_time"]))[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Stiffness that relaxes, and how fast."""
        stiffness, time_s = figure(parameters["stiffness"]), figure(parameters["relaxation_time"])
        return f"the spring relaxes: {stiffness} raw for every % of a move fade with a time constant of {time_s} s"

    def law(self, parameters: Mapping[str, float]) -> Law:
        """A Maxwell branch that starts relaxed: stiffness times the position beyond its low pass."""
        stiffness, tau = parameters["stiffness"], parameters["relaxation_time"]
        last: list[float] = []  # position and low pass of the last step

        def load(now: Moment) -> float:
            if not last:
                last[:] = [now.position, now.position]
            mean = 0.5 * (last[0] + now.position)
            last[:] = [now.position, mean + (last[1] - mean) * math.exp(-now.step_s / tau)] if now.step_s else last
            return stiffness * (now.position - last[1])

        return load


EFFECT = ViscoelasticSpring()
