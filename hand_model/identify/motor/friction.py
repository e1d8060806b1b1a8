"""Friction of a simulated drive, many at once: Coulomb's that truly sticks, or bristles that give (LuGre; Canudas de Wit et al. 1995)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Stick:
    """Coulomb friction that truly sticks; set-valued at rest, solved implicitly (Moreau's sweeping process; Acary & Brogliato 2008)."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.rise = Rise(q)

    def pace(self, step_s: Array) -> None:
        """Nothing: what stops stops within a step, however long."""

    def begin(self, load: Array, v: Array) -> None:
        """Nothing: what holds a drive at rest follows from its balance."""

    def narrow(self, k: int) -> None:
        """Keep the first k drives."""
        self.rise.narrow(k)

    def velocity(self, total: Array, inner: Array, v: Array) -> Array:
        """Velocity (k,) [%/s] in the middle of a step, of all other efforts [raw] and what resists velocity [raw s/%]."""
        level = self.rise.level(v)
        return (total - np.minimum(np.maximum(total, -level), level)) / inner

    def advance(self, v: Array, middle: Array) -> tuple[Array, Array]:
        """Velocity (k,) [%/s] at the end of the step and its mean; a drive that would turn round has stopped within the step."""
        fresh = 2.0 * middle - v
        turned = fresh * v
        if np.minimum.reduce(turned) < 0.0:
            stopped = turned < 0.0
            u = v[stopped]
            middle = middle.copy()
            middle[stopped], fresh[stopped] = 0.5 * u * u / (u - fresh[stopped]), 0.0
        return fresh, middle


class Bristles:
    """LuGre's friction (equations in `drive`), linear within a step."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.rise, self.bristle = Rise(q), q["bristle"]
        distance = np.maximum(q["presliding"], 1e-4)
        self.least, self.per = 1e-6 * distance, -1.0 / distance

    def pace(self, step_s: Array) -> None:
        """The steps (k,) [s] from here on."""
        self.step_s, self.reach, self.step_per = step_s, 0.5 * step_s + self.bristle[: len(step_s)], step_s * self.per

    def begin(self, load: Array, v: Array) -> None:
        """Friction of drives in balance with a load (B,) [raw], or sliding at v (B,) [%/s]."""
        top = self.rise.top
        self.f = np.where(v == 0.0, np.clip(load, -top, top), np.sign(v) * top)

    def narrow(self, k: int) -> None:
        """Keep the first k drives."""
        self.rise.narrow(k)
        for name in ("f", "step_s", "reach", "least", "per", "step_per"):
            setattr(self, name, getattr(self, name)[:k])

    def velocity(self, total: Array, inner: Array, v: Array) -> Array:
        """Velocity (k,) [%/s] in the middle of a step, of all other efforts [raw] and what resists velocity [raw s/%]."""
        push = total - self.f
        self.level = self.rise.level(v)
        travel = np.maximum(self.step_s * np.abs(v), self.least)
        slope = (np.copysign(self.f, self.f * push) - self.level) * np.expm1(travel * self.per) / travel
        return push / (inner + self.reach * slope)

    def advance(self, v: Array, middle: Array) -> tuple[Array, Array]:
        """Velocity (k,) [%/s] at the end of the step and its mean; the bristles go with it."""
        limit = np.copysign(self.level, middle)
        self.f = limit + (self.f - limit) * np.exp(self.step_per * np.abs(middle))
        return 2.0 * middle - v, middle


class Rise:
    """The level of friction [raw] over speed: Coulomb, with a Stribeck rise where any drive has one."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.coulomb, self.ratio, self.per_speed, self.exponent = q["coulomb"], q["static_ratio"] - 1.0, 1.0 / q["stribeck_speed"], q["stribeck_exponent"]
        self.flat = not np.any(self.ratio != 0.0)
        self.top = self.coulomb * (1.0 + self.ratio)

    def narrow(self, k: int) -> None:
        """Keep the first k drives."""
        self.coulomb, self.ratio, self.per_speed, self.exponent = self.coulomb[:k], self.ratio[:k], self.per_speed[:k], self.exponent[:k]

    def level(self, v: Array) -> Array:
        """Friction (k,) [raw] of sliding at velocities (k,) [%/s]."""
        if self.flat:
            return self.coulomb
        return self.coulomb * (1.0 + self.ratio * np.exp(-(np.abs(v * self.per_speed) ** self.exponent)))
