"""An object that the drive runs into."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Contact:
    """An object: a one-sided spring with damping."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.stiffness, self.at, self.damping = q["contact_stiffness"], q["contact_at"], q["contact_damping"]

    def pace(self, first: int, last: int, step_s: Array) -> None:
        """The first k drives from here on, in steps (k,) [s]."""
        k = len(step_s)
        self.reach = 0.5 * step_s + self.damping[:k]

    def load(self, p: Array) -> tuple[Array, Array]:
        """Load (k,) [raw] at positions (k,) [%], and what it resists velocity with [raw s/%]."""
        k = len(p)
        pressed = np.where(p > self.at[:k], self.stiffness[:k], 0.0)
        return pressed * (p - self.at[:k]), pressed * self.reach[:k]
