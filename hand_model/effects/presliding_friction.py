"""Presliding friction: bristle-like give before sliding starts (Dahl 1968; Canudas de Wit 1995)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .mjcf import lugre_friction
from .path import dahl, jenkins

SOON = 20.0  # [% of the range, or deg, a second] of a drive once it has gone its bristles' length


class PreslidingFriction(Effect):
    """The declared Coulomb friction builds up over a distance instead of at once: dz/ds = (1 - z sign(ds)) / length,
    with z + time dz/dt in its place where the bristles are damped (form 0), or evenly, as a stiff bristle that then
    breaks away (form 1; Dupont 2002).
    """

    name = "presliding_friction"
    replaces = "coulomb"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Bristle length: from what is granted to any drive of the session (or 1.2 % of the range) to a third of it;
        their damping over their stiffness."""
        low, high = position_range(states)
        span = high - low
        granted = states[0].extra.get("granted")
        least = 0.012 * span if granted is None else float(np.max(granted))
        return (
            Shape(
                "bristle_length",
                states[0].position_unit,
                least,
                0.35 * span,
                tuple(np.geomspace(1.1 * least, 0.25 * span, 11)),
            ),
            Shape("bristle_time", "s", 0.0, 0.1, (0.0, 0.03), forms=(0.0,)),  # what breaks away is not damped
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude of its own: it is the Coulomb friction."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Declared columns with the bristles' state in place of the Coulomb column."""
        if "coulomb" not in state.declared_names:
            return state.declared
        out = np.array(state.declared)
        length, place = shape["bristle_length"], state.declared_names.index("coulomb")
        if shape.get("form", 0.0) > 0.5:
            out[:, place] = jenkins(state.position, length)
            return out
        z = dahl(state.position, length)
        rate = state.velocity * (1 - z * np.sign(state.velocity)) / length
        out[:, place] = z + _time(shape) * rate
        return out

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Length, and damping over stiffness as far as it counts."""
        return {**shape, "bristle_time": _time(shape)}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The way over which friction turns over."""
        length = parameters["bristle_length"]
        way = (
            f"it turns over within {2 * length:.1f} %"
            if parameters.get("form")
            else f"two thirds of it turn over within {length:.1f} %"
        )
        return f"the drive gives before it slides: after a reversal friction needs a way, {way} of travel"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A passive DC motor's LuGre friction in place of the joint's `frictionloss`."""
        return lugre_friction(root, where, parameters)


def _time(shape: Mapping[str, float]) -> float:
    """Damping over stiffness [s], at most what lets friction turn over at once as soon as the drive moves: beyond, bristles
    would give nothing, and it is the estimate of starts that is described."""
    damped = shape.get("form", 0.0) < 0.5  # what breaks away is not
    return min(shape.get("bristle_time", 0.0), shape["bristle_length"] / SOON) if damped else 0.0


EFFECT = PreslidingFriction()
