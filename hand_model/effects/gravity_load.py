"""Gravity load: weight of finger or support, changing with the pose of the hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .law import Law, Moment


class GravityLoad(Effect):
    """Torque of a weight at a constant lever in the plane of the finger, turned by the joint angle."""

    name = "gravity_load"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Angle swept over the range of positions, [rad]; with a recorded pose only."""
        if not any("gravity_along" in s.extra for s in states):
            return ()
        return (Shape("sweep", "rad", 0.5, 2.5, (0.8, 1.4, 2.0)),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Weight times lever along the open finger and across it."""
        return (("along", "effort", -np.inf, np.inf), ("across", "effort", -np.inf, np.inf))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Torque of a unit weight on the finger's line and across it, (n, 2) in parts of 9.81 m/s^2; none without a pose."""
        if "gravity_along" not in state.extra or not shape:
            return np.zeros((len(state.time_s), 2))
        angle = shape["sweep"] * state.position / 100.0
        along, across = state.extra["gravity_along"] / 9.81, state.extra["gravity_across"] / 9.81
        return np.stack([across * np.cos(angle) - along * np.sin(angle), along * np.cos(angle) + across * np.sin(angle)], axis=-1)

    def told_by(self, state: DriveState) -> bool:
        """One in which the pose of the hand was recorded."""
        return "pose_seen" in state.extra

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The largest load that the weight can be."""
        load = figure(math.hypot(parameters["along"], parameters["across"]))
        return f"weight loads the motor with up to {load} raw, changing with the pose of the hand and the angle of the finger"

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Gravity in the finger's plane, turned with the finger."""
        along, across, sweep = (parameters[k] for k in ("along", "across", "sweep"))

        def load(now: Moment) -> float:
            angle = sweep * now.position / 100.0
            x, y = now.gravity_along / 9.81, now.gravity_across / 9.81
            return along * (y * math.cos(angle) - x * math.sin(angle)) + across * (x * math.cos(angle) + y * math.sin(angle))

        return load


EFFECT = GravityLoad()
