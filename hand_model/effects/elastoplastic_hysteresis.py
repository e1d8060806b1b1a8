"""Elastoplastic hysteresis: load that builds up over a distance after each reversal (Jenkins; Iwan 1966)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .mjcf import bristle_friction, joint_tendon, motor_joint
from .path import dahl, jenkins

# log evidence for each time the yield load is the friction's, and the most times that count
PRESLIDING, MOST = 20.0, 10.0


class ElastoplasticHysteresis(Effect):
    """Adds A z to the friction: a stop operator z = clip(z + ds / s, -1, 1) (form 0), or an exponential build-up (form
    1)."""

    name = "elastoplastic_hysteresis"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Reach of the elastic part, from 2.5 % of the range to all of it."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape(
                "reach", states[0].position_unit, 0.025 * span, 1.2 * span, tuple(span * np.geomspace(0.03, 0.9, 10))
            ),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Load at yield, never negative."""
        return (("yield_load", "effort", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """State along the recorded path, (n, 1), in [-1, 1]."""
        operator = jenkins if shape["form"] < 0.5 else dahl
        return operator(state.position, shape["reach"])[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Reach and load at yield, also as a ratio to the friction that turns over at once."""
        return {**shape, **amplitude, "ratio": amplitude["yield_load"] / (declared.get("coulomb") or np.nan)}

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Where hardly any friction is left that turns over at once, it is the friction itself that gives: presliding,
        no further load."""
        ratio = parameters["ratio"] if np.isfinite(parameters["ratio"]) else MOST
        return -PRESLIDING * max(0.0, min(ratio, MOST) - 1.0)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """How large, and over which way it builds up."""
        load, reach = figure(parameters["yield_load"]), parameters["reach"]
        way = (
            f"evenly over {2 * reach:.1f} %"
            if parameters["form"] < 0.5
            else f"gradually, two thirds of it over {reach:.1f} %"
        )
        return f"after each reversal a load against the motion, up to {load} raw, builds up {way} of travel"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Form 0: a tendon along the motor joint that yields. Form 1: the bristle of a passive DC motor's LuGre
        friction."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        load, reach = unit * parameters["yield_load"], parameters["reach"]
        if parameters["form"] >= 0.5:
            return bristle_friction(
                root, joint, f"{where['actuator']}_hysteresis", (load / reach, 0.0, load, load, 1.0)
            )
        return joint_tendon(root, joint, f"{where['actuator']}_hysteresis", stiffness=load / reach, springyield=reach)


EFFECT = ElastoplasticHysteresis()
