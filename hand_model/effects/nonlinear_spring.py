"""Nonlinear spring: the return spring stiffens or softens."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .end_stop_contact import OUTER
from .law import Law
from .mjcf import joint_tendon, motor_joint


class NonlinearSpring(Effect):
    """Beyond the declared line: b x^2 + c x^3 (form 0), or another stiffness from a knee on, c max(0, x - knee) (form
    1).

    A knee lies in the inner part of the range; what bends in the outer quarter is an end stop.
    """

    name = "nonlinear_spring"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Smooth or with a knee, and where that lies."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape(
                "knee",
                states[0].position_unit,
                low + 0.15 * span,
                high - OUTER * span,
                tuple(low + span * np.linspace(0.2, 0.72, 8)),
                forms=(1.0,),
            ),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Quadratic and cubic stiffness, or, with a knee, none and the change of stiffness; either sign."""
        return (
            ("quadratic_stiffness", "effort/position^2", -np.inf, np.inf),
            ("cubic_stiffness", "effort/position^3", -np.inf, np.inf),
        )

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """x^2 and x^3, or nothing and the way beyond the knee, (n, 2), x in the drive's unit."""
        x = state.position
        if shape.get("form", 0.0) > 0.5:
            return np.stack([np.zeros(len(x)), np.maximum(x - shape["knee"], 0.0)], axis=-1)
        return np.stack([x**2, x**3], axis=-1)

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """The two stiffnesses of a smooth spring; the knee and the stiffness that begins there."""
        if shape.get("form", 0.0) > 0.5:
            return {"form": 1.0, "knee": shape["knee"], "stiffness_beyond": amplitude["cubic_stiffness"]}
        return {"form": 0.0, **amplitude}

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Of the stiffness beyond a knee, and of what it bends the load by."""
        return {"stiffness_beyond": "effort/position", "bend": "effort"}

    def derived(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> dict[str, float]:
        """Half of the band about a straight line in which the spring's load stays over the recorded range: what it is
        bent by."""
        x = np.linspace(*position_range(states), 101)
        if parameters["form"] > 0.5:
            load = parameters["stiffness_beyond"] * np.maximum(x - parameters["knee"], 0.0)
        else:
            load = parameters["quadratic_stiffness"] * x**2 + parameters["cubic_stiffness"] * x**3
        return {"bend": float(0.5 * np.ptp(load - np.polyval(np.polyfit(x, load, 1), x)))}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Where it is stiffer or softer, and by how much."""
        if parameters["form"] > 0.5:
            change = parameters["stiffness_beyond"]
            return (
                f"beyond {parameters['knee']:.1f} % the return spring is {figure(abs(change))} raw/% {_stiffer(change)}"
            )
        square, cubic = parameters["quadratic_stiffness"], parameters["cubic_stiffness"]
        turn = -square / (3 * cubic) if cubic else math.inf  # where the stiffness is largest or smallest
        if 0 < turn < 100:
            early, late = square * turn, cubic * (100 - turn) ** 2 * 3
            return (
                f"the return spring is {figure(abs(early))} raw/% {_stiffer(early)} at {turn:.1f} % than at 0 %, "
                f"and {figure(abs(late))} raw/% {_stiffer(late)} at 100 % than there"
            )
        change = 200 * square + 3e4 * cubic
        return f"the return spring is {figure(abs(change))} raw/% {_stiffer(change)} at 100 % than at 0 %"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """`stiffness` and `springref`: k x + p + b x^2 + c x^3 around its root r; MuJoCo's force is -(A y + B y^2 + C
        y^3), y = x - r.
        A knee: a fixed tendon that is slack until there."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        if parameters.get("form", 0.0) > 0.5:
            stiffness = unit * parameters["stiffness_beyond"]
            name = f"{where['actuator']}_spring"
            return (
                joint_tendon(root, joint, name, springlength=(-1e6, parameters["knee"]), stiffness=stiffness)
                if stiffness >= 0
                else None
            )
        square, cubic = unit * parameters.get("quadratic_stiffness", 0.0), unit * parameters["cubic_stiffness"]
        linear = float((joint.get("stiffness") or "0").split()[0])
        preload = -linear * float(joint.get("springref") or 0.0)
        roots = np.roots([cubic, square, linear, preload])
        real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots))].real
        r = float(real[np.argmin(np.abs(real))])
        joint.set("stiffness", f"{linear + 2 * square * r + 3 * cubic * r * r!r} {square + 3 * cubic * r!r} {cubic!r}")
        joint.set("springref", repr(r))
        return f"joint[@name='{joint.get('name')}']/@stiffness"

    def law(self, parameters: Mapping[str, float]) -> Law | None:
        """A knee from which the spring is softer: no tendon pushes where it should pull."""
        if parameters.get("form", 0.0) < 0.5 or parameters["stiffness_beyond"] >= 0:
            return None
        return lambda now: parameters["stiffness_beyond"] * max(now.position - parameters["knee"], 0.0)


def _stiffer(change: float) -> str:
    return "stiffer" if change > 0 else "softer"


EFFECT = NonlinearSpring()
