"""End-stop contact: an elastic stop within the range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .mjcf import joint_tendon, motor_joint

OUTER = 0.25  # of the range, at either end, in which a stop lies


class EndStopContact(Effect):
    """F = k max(0, x - x0) at the upper end, or -k max(0, x0 - x) at the lower.

    A stop lies in the outer quarter of the range; what bends further in is a spring.
    """

    name = "end_stop_contact"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Side (1 upper, -1 lower) and how far before the end of the range the stop begins."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape("side", "1", -1.0, 1.0, (-1.0, 1.0)),
            Shape(
                "inward", states[0].position_unit, 0.015 * span, OUTER * span, tuple(span * np.linspace(0.03, 0.24, 8))
            ),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Each shape with the end of the range on its side."""
        low, high = position_range(states)
        return [{**point, "end": high if point["side"] > 0 else low} for point in super().grid(states)]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Stiffness of the stop, never negative."""
        return (("stiffness", "effort/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Depth into the stop, signed as its load, (n, 1)."""
        side, begin = _side(shape), _begin(shape)
        return (side * np.maximum(side * (state.position - begin), 0.0))[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Side, where the stop begins, and its stiffness."""
        return {"side": shape["side"], "begin": _begin(shape), **amplitude}

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Where it begins, as a position."""
        return {"begin": "position"}

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """From where the stop begins to the end of the range."""
        ends = sorted((_begin(shape), shape["end"]))
        return {"position": ends, "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Where it begins and how stiff it is."""
        side, stiffness = "beyond" if parameters["side"] >= 0 else "below", figure(parameters["stiffness"])
        return (
            f"{side} {parameters['begin']:.1f} % the motor runs into an elastic stop, "
            f"{stiffness} raw for every further %"
        )

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A fixed tendon along the motor joint that is slack until the stop begins: the same line of force, exact in
        MuJoCo."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        ends = (-1e6, parameters["begin"]) if parameters["side"] >= 0 else (parameters["begin"], 1e6)
        return joint_tendon(
            root, joint, f"{where['actuator']}_stop", springlength=ends, stiffness=unit * parameters["stiffness"]
        )


def _side(shape: Mapping[str, float]) -> float:
    return 1.0 if shape["side"] >= 0 else -1.0


def _begin(shape: Mapping[str, float]) -> float:
    return shape["end"] - _side(shape) * shape["inward"]


EFFECT = EndStopContact()
