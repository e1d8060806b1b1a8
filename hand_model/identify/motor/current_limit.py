"""The current limit of the controller, within an implicit step (equations in `drive`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .friction import Bristles, Stick

Array = NDArray[np.float64]


class Ceiling:
    """The most current [raw] that the controller may ask for."""

    def __init__(self, q: Mapping[str, Array], late: Array, limit: Array | float) -> None:
        self.q, self.late, self.limit = q, late, limit + np.zeros(len(late))

    def pace(self, first: int, last: int, step_s: Array) -> None:
        """The first k drives from here on, in steps (k,) [s]."""
        k = len(step_s)
        half, q, late = (
            0.5 * step_s,
            {n: self.q[n][:k] for n in ("inertia", "gain", "damping", "stiffness", "preload")},
            self.late[:k],
        )
        self.now = q["inertia"] / half, q["stiffness"], q["preload"], self.limit[:k]
        self.closed = 0.5 * (q["gain"] * (half - late) + q["damping"] * (1.0 - late / half))

    def kept(
        self,
        both: Array,
        total: Array,
        resisting: Array,
        p: Array,
        v: Array,
        pressed: Array | float,
        friction: Stick | Bristles,
    ) -> Array:
        """Sum of the velocities (k,) [%/s] at both ends of a step where the current that gives `both` is more than the
        limit."""
        mass, stiffness, preload, limit = self.now
        own = mass * v - stiffness * p - preload - pressed  # what is left without the controller
        current = total - own - self.closed * both
        over = np.abs(current) > limit
        if not over.any():
            return both
        free = both.copy()
        return np.where(over, friction.velocities(own + np.sign(current) * limit, resisting - self.closed, v), free)
