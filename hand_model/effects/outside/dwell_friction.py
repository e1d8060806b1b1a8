"""Friction that grows while the drive rests and is worn off as it moves (Rabinowicz 1958)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure, position_range
from ..path import from_rest
from .outsider import Outsider


class DwellFriction(Outsider):
    """F = A sign(v) r exp(-s / distance), s travelled since the last rest, r how far that rest restored what had been
    worn off: at rest it approaches 1 with the time constant of healing (Dieterich 1979)."""

    name = "dwell_friction"
    rubs = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The way on which it is worn off, up to a few strokes (what takes longer is a warm-up), and the time in which it
        heals."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape(
                "distance", states[0].position_unit, 0.01 * span, 2.5 * span, tuple(np.geomspace(0.015, 1.5, 9) * span)
            ),
            Shape("healing_time", "s", 0.02, 300.0, (0.05, 0.5, 2.0, 60.0)),  # longer than a session: it was cold
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Friction beyond the usual, just after a rest."""
        return (("excess", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) r exp(-s / distance), (n, 1)."""
        moving = state.extra.get("moving", np.ones(len(state.time_s))) > 0
        worn = np.exp(-from_rest(state.position, moving) / shape["distance"])
        edges = [0, *(np.flatnonzero(np.diff(moving)) + 1).tolist(), len(moving)]
        healed, left = np.zeros(len(moving)), 1.0  # before a recording it rested long
        for a, b in pairwise(edges):
            if moving[a]:
                healed[a:b] = left * worn[a:b]
                left = healed[b - 1]
            else:
                left = 1 - (1 - left) * np.exp(
                    -(state.time_s[min(b, len(moving) - 1)] - state.time_s[a]) / shape["healing_time"]
                )
        return (state.direction * healed)[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How much and for how long."""
        return (
            f"after a rest friction is {figure(parameters['excess'])} raw higher, "
            f"which {figure(parameters['distance'])} % of travel wear off"
        )


EFFECT = DwellFriction()
