"""End-stop contact: an elastic stop within the range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .law import Law, Moment
from .mjcf import joint_tendon, motor_joint

DAMPED, BESIDE = 1.0, 2.0  # forms
OUTER = 0.25  # of the range, at either end, in which a stop lies


class EndStopContact(Effect):
    """F = k max(0, x - x0) at the upper end, or -k max(0, x0 - x) at the lower (form 0); k depth (1 + loss v), v the speed
    into it, where the stop damps (form 1; Hunt & Crossley 1975, eq. 7, with exponent 1); k (depth + lag v), never pulling,
    where a damper lies beside it (form 2; Kelvin-Voigt).

    A stop lies in the outer quarter of the range; what bends further in is a spring.
    """

    name = "end_stop_contact"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Side (1 upper, -1 lower), form, how far before the end of the range the stop begins, and what share more it
        bears for each unit of speed into it, or its damping over its stiffness."""
        low, high = position_range(states)
        span = high - low
        fastest = max(float(np.max(np.abs(s.velocity), initial=0.0)) for s in states) or 1.0
        return (
            Shape("side", "1", -1.0, 1.0, (-1.0, 1.0)),
            Shape("form", "1", 0.0, BESIDE, (0.0, DAMPED, BESIDE)),
            Shape(
                "loss",
                f"s/{states[0].position_unit}",
                0.05 / fastest,
                4 / fastest,
                (0.4 / fastest, 1.5 / fastest),
                forms=(DAMPED,),
            ),
            Shape("lag", "s", 2e-3, 0.4, (0.02, 0.08), forms=(BESIDE,)),
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
        """Depth into the stop, signed as its load and damped as its form says, (n, 1)."""
        side = _side(shape)
        depth = np.maximum(side * (state.position - _begin(shape)), 0.0)
        return (side * _borne(depth, side * state.velocity, shape))[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Side, where the stop begins, its stiffness, and how it damps."""
        damping = {DAMPED: "loss", BESIDE: "lag"}.get(shape.get("form", 0.0))
        damped = {} if damping is None else {"form": shape["form"], damping: shape[damping]}
        return {"side": shape["side"], **damped, "begin": _begin(shape), **amplitude}

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
        loss = f", and {figure(1e4 * parameters['loss'])} % more at 100 %/s into it" if "loss" in parameters else ""
        if "lag" in parameters:
            loss = f", with a damper of {figure(parameters['stiffness'] * parameters['lag'])} raw s/% beside it"
        return (
            f"{side} {parameters['begin']:.1f} % the motor runs into an elastic stop, "
            f"{stiffness} raw for every further %{loss}"
        )

    def law(self, parameters: Mapping[str, float]) -> Law | None:
        """The load of a stop that damps; one that does not is written as a tendon."""
        if "form" not in parameters:
            return None
        side, begin, stiffness = _side(parameters), parameters["begin"], parameters["stiffness"]

        def load(now: Moment) -> float:
            depth = max(side * (now.position - begin), 0.0)
            return side * stiffness * float(_borne(depth, side * now.velocity, parameters))

        return load

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A fixed tendon along the motor joint that is slack until the stop begins: the same line of force, exact in
        MuJoCo. None where it damps: a tendon does so when it is slack, too."""
        if "form" in parameters:
            return None
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


def _borne(depth: Any, speed: Any, shape: Mapping[str, float]) -> Any:
    """What a stop bears at a depth and a speed into it, over its stiffness; it never pulls."""
    form = shape.get("form", 0.0)
    if form == BESIDE:
        return np.where(depth > 0, np.maximum(depth + shape["lag"] * speed, 0.0), 0.0)
    return depth * np.maximum(1.0 + shape["loss"] * speed, 0.0) if form == DAMPED else depth


def _begin(shape: Mapping[str, float]) -> float:
    return shape["end"] - _side(shape) * shape["inward"]


EFFECT = EndStopContact()
