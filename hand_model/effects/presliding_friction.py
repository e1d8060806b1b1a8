"""Presliding friction: bristle-like give before sliding starts (Dahl 1968; Canudas de Wit 1995)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range
from .mjcf import free_name, motor_joint, section
from .path import dahl


class PreslidingFriction(Effect):
    """The declared Coulomb friction builds up over a distance instead of at once: dz/ds = (1 - z sign(ds)) / length."""

    name = "presliding_friction"
    replaces = "coulomb"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Bristle length: from 1.6 times what the session's stiffest drive gives (or 1.2 % of the range) to a third of it."""
        low, high = position_range(states)
        span = high - low
        give = states[0].extra.get("give")
        least = 0.012 * span if give is None else 1.6 * float(np.max(give))
        return (Shape("bristle_length", states[0].position_unit, least, 0.35 * span,
                      tuple(np.geomspace(1.1 * least, 0.25 * span, 11))),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """No amplitude of its own: it is the Coulomb friction."""
        return ()

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Declared columns with the Dahl state in place of the Coulomb column."""
        if "coulomb" not in state.declared_names:
            return state.declared
        out = np.array(state.declared)
        out[:, state.declared_names.index("coulomb")] = dahl(state.position, shape["bristle_length"])
        return out
    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """A passive DC motor's LuGre friction in place of the joint's `frictionloss` (force per bristle length, see compile)."""
        from lxml import etree

        found = motor_joint(root, where)
        if found is None:
            return None
        joint, _ = found  # efforts are already the file's
        coulomb = float(joint.attrib.get("frictionloss", "0"))
        if coulomb <= 0:
            return None
        for key in ("frictionloss", "solreffriction", "solimpfriction"):
            joint.attrib.pop(key, None)
        name = free_name(root, f"{where['actuator']}_friction")
        values = (coulomb / parameters["bristle_length"], 0.0, coulomb, coulomb, 20.0)
        etree.SubElement(section(root, "actuator"), "dcmotor", name=name, joint=joint.get("name"), input="none",
                         motorconst="0 0", resistance="1", lugre=" ".join(repr(float(v)) for v in values))
        return f"actuator/dcmotor[@name='{name}']"


EFFECT = PreslidingFriction()
