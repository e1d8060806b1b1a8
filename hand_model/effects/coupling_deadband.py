"""Coupling deadband: the distal segment does not move at first."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range, rounded
from .driven import NEARER, driven
from .input import map_of, write_bound


class CouplingDeadband(Effect):
    """distal = coupling(max(proximal, until)), the corner rounded: s ln(1 + exp((q - until) / s)) of the motion
    passes."""

    name = "coupling_deadband"
    station = "linkage"
    replaces = "power_1"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Proximal angle at which the distal segment starts to move, and the width of the corner."""
        low, high = position_range(states)
        span, unit = high - low, states[0].position_unit
        return (
            Shape("until", unit, low + 0.01 * span, low + 0.5 * span, tuple(low + span * NEARER)),
            Shape("corner", unit, 1e-4 * span, 0.05 * span, (0.002 * span, 0.015 * span)),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude: the coupling is fitted anew beyond the deadband."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The coupling's columns of the angle that passes."""
        until, corner = shape["until"], shape["corner"]
        return driven(state, lambda q: until + rounded(q - until, corner))

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From the start of the range to where it moves."""
        low, _ = position_range(states)
        return {"position": [low, shape["until"]], "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Up to which angle."""
        segment, until = where.get("joint") or "distal", parameters["until"]
        return f"the {segment} segment does not move until the joint before it has come to {until:.1f} deg"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """An input joint behind the driver that does not go below where the motion begins, and springs that round its
        corner off."""
        equality = map_of(root, where, self.station)
        if equality is None:
            return None
        until, corner = (math.radians(parameters.get(name, 0.0)) for name in ("until", "corner"))
        return write_bound(root, equality, -1, until, corner=corner)


EFFECT = CouplingDeadband()
