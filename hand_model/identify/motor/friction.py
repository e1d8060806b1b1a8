"""Friction of a simulated drive, many at once: Coulomb's that truly sticks, or bristles that give (LuGre; Canudas de
Wit et al. 1995)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Stick:
    """Coulomb friction that truly sticks; set-valued at rest, solved implicitly (Moreau's sweeping process; Acary &
    Brogliato 2008)."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.rise = Rise(q)

    def pace(self, first: int, last: int, step_s: Array) -> None:
        """The first k drives from here on, in steps (k,) [s]."""
        k = len(step_s)
        self.rise.narrow(k)
        self.both, self.turned = np.empty((2, k))

    def begin(self, load: Array, v: Array) -> None:
        """Nothing: what holds a drive at rest follows from its balance."""

    def velocities(self, total: Array, resisting: Array, v: Array) -> Array:
        """Sum of the velocities (k,) [%/s] at both ends of a step, until the next call, of all other efforts [raw] in
        its middle and what resists it [raw s/%]."""
        low, high = self.rise.levels(v)
        np.maximum(total, low, out=self.both)
        np.minimum(self.both, high, out=self.both)
        np.subtract(total, self.both, out=self.both)
        np.divide(self.both, resisting, out=self.both)
        return self.both

    def advance(self, v: Array, both: Array, fresh: Array) -> None:
        """Velocity (k,) [%/s] at the end of the step, into `fresh`; a drive that would turn round has stopped within
        the step, which its mean then tells."""
        np.subtract(both, v, out=fresh)
        np.multiply(fresh, v, out=self.turned)
        if self.turned[self.turned.argmin()] < 0.0:
            stopped = self.turned < 0.0
            u = v[stopped]
            both[stopped], fresh[stopped] = u * u / (u - fresh[stopped]), 0.0


class Bristles:
    """LuGre's friction (equations in `drive`), linear within a step."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.rise, self.bristle = Rise(q), q["bristle"]
        self.distance = np.maximum(q["presliding"], 1e-4)

    def pace(self, first: int, last: int, step_s: Array) -> None:
        """The first k drives from here on, in steps (k,) [s]."""
        k = len(step_s)
        self.rise.narrow(k)
        self.f, distance = self.f[:k].copy(), self.distance[:k]
        self.per, self.half_per, self.least = -step_s / distance, -0.5 * step_s / distance, np.full(k, -1e-6)
        self.reach = -0.5 * (0.5 * step_s + self.bristle[:k]) / distance
        self.push, self.both, self.share, self.work = np.empty((4, k))

    def begin(self, load: Array, v: Array) -> None:
        """Friction of drives in balance with a load (B,) [raw], or sliding at v (B,) [%/s]."""
        top = self.rise.top
        self.f = np.where(v == 0.0, np.clip(load, -top, top), np.sign(v) * top)

    def velocities(self, total: Array, resisting: Array, v: Array) -> Array:
        """Sum of the velocities (k,) [%/s] at both ends of a step, until the next call, of all other efforts [raw] in
        its middle and what resists it [raw s/%]."""
        push, share, work = self.push, self.share, self.work
        np.subtract(total, self.f, out=push)
        _, self.level = self.rise.levels(v)
        # bristles as stiff as ever bend further under more friction
        self.softer = None if self.rise.flat else self.rise.coulomb / self.level
        # (exp(x) - 1) / x, x the travel of a step over the distance: of so small a travel at least that rounding does
        # not count
        np.absolute(v, out=work)
        np.multiply(work, self.per, out=work)
        if self.softer is not None:
            np.multiply(work, self.softer, out=work)
        np.minimum(work, self.least, out=work)
        np.exp(work, out=share)
        np.subtract(share, 1.0, out=share)
        np.divide(share, work, out=share)
        np.multiply(self.f, push, out=work)
        np.copysign(self.f, work, out=work)
        np.subtract(work, self.level, out=work)
        np.multiply(share, work, out=work)
        np.multiply(work, self.reach, out=work)
        if self.softer is not None:
            np.multiply(work, self.softer, out=work)
        np.add(work, resisting, out=work)
        return np.divide(push, work, out=self.both)

    def advance(self, v: Array, both: Array, fresh: Array) -> None:
        """Velocity (k,) [%/s] at the end of the step, into `fresh`; the bristles go with it."""
        limit, f, work = self.push, self.f, self.work
        np.copysign(self.level, both, out=limit)
        np.absolute(both, out=work)
        np.multiply(work, self.half_per, out=work)
        if self.softer is not None:
            np.multiply(work, self.softer, out=work)
        np.exp(work, out=work)
        np.subtract(f, limit, out=f)
        np.multiply(f, work, out=f)
        np.add(f, limit, out=f)
        np.subtract(both, v, out=fresh)


class Rise:
    """The level of friction [raw] over speed: Coulomb, with a Stribeck rise where any drive has one."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.coulomb, self.ratio, self.per_speed, self.exponent = (
            q["coulomb"],
            q["static_ratio"] - 1.0,
            1.0 / q["stribeck_speed"],
            q["stribeck_exponent"],
        )
        self.flat = not np.any(self.ratio != 0.0)
        self.top = self.coulomb * (1.0 + self.ratio)

    def narrow(self, k: int) -> None:
        """Keep the first k drives."""
        self.coulomb, self.ratio, self.per_speed, self.exponent = (
            self.coulomb[:k],
            self.ratio[:k],
            self.per_speed[:k],
            self.exponent[:k],
        )
        self.bounds = -self.coulomb, self.coulomb

    def levels(self, v: Array) -> tuple[Array, Array]:
        """Least and most friction (k,) [raw] of sliding at velocities (k,) [%/s] either way."""
        if self.flat:
            return self.bounds
        level = self.coulomb * (1.0 + self.ratio * np.exp(-(np.abs(v * self.per_speed) ** self.exponent)))
        return -level, level
