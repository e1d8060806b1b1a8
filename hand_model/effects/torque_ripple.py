"""Torque ripple: load periodic in motor position (cogging, screw eccentricity)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Array, DriveState, Shape, figure, position_range
from .mjcf import free_name, motor_joint, section
from .sinusoid import Sinusoid


class TorqueRipple(Sinusoid):
    """F = A sin(2 pi x / P + phase)."""

    name = "torque_ripple"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Period from a fiftieth of the range to a third of it, dense in wavenumber: what does not come three times is
        seen to repeat by nobody. Where the position is that of a joint, to half of it: such a load is tied to the
        joint's own turn. unseen: time constant of what is too fast to be seen."""
        low, high = position_range(states)
        span = high - low
        fewest = 3.0 if states[0].position_unit == "%" else 1.8
        periods = span / np.arange(np.ceil(fewest), 40.01, 0.25)
        period = Shape("period", states[0].position_unit, 0.02 * span, span / fewest, tuple(periods))
        unseen = min(
            (float(s.extra["bandwidth_s"][0]) if "bandwidth_s" in s.extra else 0.0 for s in states), default=0.0
        )
        return (period, Shape("unseen", "s", 0.0, 1.2 * unseen, (unseen,))) if unseen > 0 else (period,)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sin and cos of the position's phase, (n, 2), where they can be seen."""
        # The faster it comes, the more of the ripple inertia takes up and the state estimate misses; from when on is
        # for the recording to say.
        blur = 2 * np.pi * np.abs(state.velocity) / shape["period"] * shape.get("unseen", 0.0)
        # Where motion starts or stops a slow phase resembles anything that friction does while it turns over.
        seen = np.exp(-0.5 * blur**2) * state.extra.get("steady", np.ones(len(blur)))
        return super().columns(state, shape) * seen[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Swing and period."""
        swing = figure(parameters["amplitude"])
        return f"the motor's load swings by ±{swing} raw, repeating every {parameters['period']:.2f} % of its range"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A passive DC motor with cogging: its torque is -A sin(2 pi x / P + phase), what the drive must overcome."""
        from lxml import etree

        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        name = free_name(root, f"{where['actuator']}_ripple")
        values = (unit * parameters["amplitude"], 2 * np.pi / parameters["period"], parameters["phase"] + np.pi)
        etree.SubElement(
            section(root, "actuator"),
            "dcmotor",
            name=name,
            joint=joint.get("name"),
            input="none",
            motorconst="0 0",
            resistance="1",
            cogging=" ".join(repr(float(v)) for v in values),
        )
        return f"actuator/dcmotor[@name='{name}']"


EFFECT = TorqueRipple()
