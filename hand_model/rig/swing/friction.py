"""Friction of a simulated joint, for many runs at once: what its bound and its damping are at a velocity and a load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dry_friction(
    p: Mapping[str, Array], has: Mapping[str, bool], v: Array, external: Array, motor: Array | None
) -> Array:
    """Dry friction's bound (L,)."""
    friction = p["coulomb"]
    shaft = 0.0 if motor is None else motor - p["emf"] * v
    if has["load_gear"]:
        friction = friction + p["load_gear"] * np.abs(external - shaft)
    if has["load_motor"] or has["load_external"]:
        friction = friction + np.abs(p["load_external"] * external - p["load_motor"] * shaft)
    carried = external - p["bodies"] * p["acceleration"] if has["carried"] else external
    if has["load_carried"]:
        friction = friction + p["load_carried"] * np.abs(carried)
    if has["low"]:
        ratio = v * p["inverse"]
        decay = np.exp(-(np.abs(ratio) ** p["stribeck_exponent"] if has["exponent"] else ratio * ratio))
        friction = friction + _low_speed(p, has, external, shaft, carried) * decay
    if has["asymmetry"]:
        friction = np.maximum(friction + p["asymmetry"] * np.sign(v), 0.0)
    return friction


def wet_friction(p: Mapping[str, Array], has: Mapping[str, bool], v: Array, external: Array) -> Array:
    """Viscous damping (L,), the motor's own included."""
    b = p["wet"]
    if has["load_speed"]:
        b = b + p["load_speed"] * np.abs(external)
    if has["drag"]:
        b = b + p["drag"] * np.abs(v)
    if has["damping_asymmetry"]:
        b = b + p["damping_asymmetry"] * np.sign(v)
    return b


def _low_speed(
    p: Mapping[str, Array], has: Mapping[str, bool], external: Array, shaft: Array | float, carried: Array
) -> Array:
    """Dry friction (L,) that standing still adds (Stribeck), by load."""
    level = p["static_excess"]
    if has["load_gear_low"]:
        level = level + p["load_gear_low"] * np.abs(external - shaft)
    if has["load_motor_low"] or has["load_external_low"]:
        level = level + np.abs(p["load_external_low"] * external - p["load_motor_low"] * shaft)
    if has["load_carried_low"]:
        level = level + p["load_carried_low"] * np.abs(carried)
    if has["motor_squared"] or has["external_squared"]:
        drives = np.abs(shaft) > np.abs(external)
        square = np.where(drives, p["external_squared"] * external**2, p["motor_squared"] * shaft**2)
        level = level + square * (external * shaft < 0)
    return level
