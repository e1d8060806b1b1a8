"""Nonlinear spring: the return spring stiffens or softens (cubic term over the range)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect
from .mjcf import motor_joint


class NonlinearSpring(Effect):
    """F = k x + A (x / span)^3 beyond the declared line."""

    name = "nonlinear_spring"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Cubic stiffness, either sign."""
        return (("cubic_stiffness", "effort/position^3", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """x^3, (n, 1), x in the drive's unit."""
        return (state.position**3)[:, None]

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """`stiffness` and `springref`: k x + p + c x^3 around its root r, MuJoCo's force is -(a y + b y^2 + c y^3), y = x - r."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        cubic, linear = unit * parameters["cubic_stiffness"], float((joint.get("stiffness") or "0").split()[0])
        preload = -linear * float(joint.get("springref") or 0.0)
        roots = np.roots([cubic, 0.0, linear, preload])
        real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots))].real
        r = float(real[np.argmin(np.abs(real))])
        joint.set("stiffness", f"{linear + 3 * cubic * r * r!r} {3 * cubic * r!r} {cubic!r}")
        joint.set("springref", repr(r))
        return f"joint[@name='{joint.get('name')}']/@stiffness"


EFFECT = NonlinearSpring()
