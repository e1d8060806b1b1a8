"""Nonlinear spring: the return spring stiffens or softens over the range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect
from .mjcf import motor_joint


class NonlinearSpring(Effect):
    """F = b x^2 + c x^3 beyond the declared line."""

    name = "nonlinear_spring"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Quadratic and cubic stiffness, either sign."""
        return (("quadratic_stiffness", "effort/position^2", -np.inf, np.inf),
                ("cubic_stiffness", "effort/position^3", -np.inf, np.inf))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """x^2 and x^3, (n, 2), x in the drive's unit."""
        return np.stack([state.position**2, state.position**3], axis=-1)

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """`stiffness` and `springref`: k x + p + b x^2 + c x^3 around its root r; MuJoCo's force is -(A y + B y^2 + C y^3), y = x - r."""
        found = motor_joint(root, where)
        if found is None:
            return None
        joint, unit = found
        square, cubic = unit * parameters.get("quadratic_stiffness", 0.0), unit * parameters["cubic_stiffness"]
        linear = float((joint.get("stiffness") or "0").split()[0])
        preload = -linear * float(joint.get("springref") or 0.0)
        roots = np.roots([cubic, square, linear, preload])
        real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots))].real
        r = float(real[np.argmin(np.abs(real))])
        joint.set("stiffness", f"{linear + 2 * square * r + 3 * cubic * r * r!r} {square + 3 * cubic * r!r} {cubic!r}")
        joint.set("springref", repr(r))
        return f"joint[@name='{joint.get('name')}']/@stiffness"


EFFECT = NonlinearSpring()
