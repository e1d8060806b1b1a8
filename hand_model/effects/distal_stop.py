"""Distal stop: the distal segment stops before the proximal one does."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .driven import NEARER, driven, mean_slope
from .input import map_of, write_bound


class DistalStop(Effect):
    """distal = coupling(min(proximal, from)), with a share of the motion passing beyond where the stop gives."""

    name = "distal_stop"
    station = "linkage"
    replaces = "power_1"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Proximal angle at which the distal segment stops, and the share of the motion that passes beyond."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape(
                "from",
                states[0].position_unit,
                high - 0.5 * span,
                high - 0.01 * span,
                tuple(high - span * NEARER),
            ),
            Shape("passing", "1", 0.0, 0.5, (0.0, 0.2)),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude: the coupling is fitted anew before the stop."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The coupling's columns of the angle that passes."""
        return driven(
            state, lambda q: np.where(q > shape["from"], shape["from"] + shape["passing"] * (q - shape["from"]), q)
        )

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """The angle of the segment that stops, where it does: the median of what it shows once it is there."""
        x, y = (np.concatenate([getattr(s, name) for s in states]) for name in ("position", "effort"))
        seen, begin = np.isfinite(y), parameters["from"]
        beyond = np.sort(x[seen & (x >= begin["value"])])
        if not len(beyond):
            return {}
        # where motion passes beyond, the first tenth of it
        last = beyond[-1] if parameters["passing"]["value"] < 0.02 else beyond[len(beyond) // 10]
        value = float(np.median(y[seen & (x >= begin["value"]) & (x <= last)]))
        wide = mean_slope(states) * 0.5 * float(np.ptp(begin["ci95"])) if "ci95" in begin else None
        interval = {} if wide is None else {"ci95": [value - wide, value + wide]}
        return {"stops_at": {"value": value, "unit": "deg", **interval}}

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From where it stops to the end of the range."""
        _, high = position_range(states)
        return {"position": [shape["from"], high], "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """From which angle on, and what still passes."""
        passing = parameters.get("passing", 0.0)
        still = f", {100 * passing:.0f} % of the motion still passes beyond" if passing >= 0.005 else ""
        segment, at = where.get("joint") or "distal", parameters["from"]
        own = f" at {parameters['stops_at']:.1f} deg" if "stops_at" in parameters else ""
        return f"the {segment} segment stops{own} when the joint before it comes to {at:.1f} deg{still}"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """An input joint behind the driver that does not go beyond the stop, save for what passes."""
        equality = map_of(root, where, self.station)
        at = math.radians(parameters["from"])
        return None if equality is None else write_bound(root, equality, 1, at, parameters["passing"])


EFFECT = DistalStop()
