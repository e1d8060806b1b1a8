"""Dry friction that gives before it slips: Dahl's state, share of friction's bound that opposes the motion (Dahl 1976).

dz / dq = (1 - z sign(v)) / reach, solved along the way, so that it hangs on no step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SHORTEST = 1e-9  # rad or m: a reach of no length, at which friction turns round at once
STIFFEST = 0.25  # of inertia over step squared: bristles beyond would be shaken by an explicit step
NEWTON = 4


def bent(bristle: Array, moved: Array, reach: Array) -> Array:
    """State (L,) in -1..1 after a way moved (L,) with a reach (L,) [rad or m]."""
    way = np.sign(moved)
    keep = np.exp(-np.abs(moved) / np.maximum(reach, SHORTEST))
    return np.where(moved == 0.0, bristle, way + (bristle - way) * keep)


def begun(velocity: Array, effort: Array, bound: Array, inertia: Array, reach: Array) -> Array:
    """State (L,) at a start: of a joint that moves, all the way; of one that rests, what holds the effort (L,)."""
    bound = np.maximum(bound, 1e-12)
    rests = np.exp(-0.5 * inertia * velocity**2 / (bound * np.maximum(reach, SHORTEST)))
    return (1.0 - rests) * np.sign(velocity) + rests * np.clip(effort / bound, -1.0, 1.0)


def slowed(free: Array, stop: Array, bristle: Array, give: Array) -> Array:
    """Velocity (L,) at the end of a step that without dry friction would end with `free`, friction being what the
    bristles have come to by then; stop: what all of it takes off; give: way of a step per velocity, over the reach.
    w = a + b exp(-w give) along the way, by Newton's method, which comes from below; bristles that do not give leave the
    clipped impulse of Coulomb's friction."""
    way = np.sign(free - stop * bristle)
    a, b = way * free - stop, stop * (1.0 - way * bristle)
    w = np.maximum(a, 0.0)
    for _ in range(NEWTON):
        tail = b * np.exp(-w * give)
        w = w + (a + tail - w) / (1.0 + give * tail)
    return way * np.maximum(w, 0.0)


class Bristles:
    """The state of one joint, step by step of an explicit simulation."""

    def __init__(self, reach: float) -> None:
        """reach [rad or m]: over which friction turns round."""
        self.reach, self.state, self.last = reach, np.nan, np.nan

    def __call__(self, position: float, velocity: float, effort: float, bound: float, stiffest: float) -> float:
        """Friction [N m or N] that opposes the motion under an effort that it has to hold, at that bound; stiffest:
        inertia over step squared."""
        if np.isnan(self.state):
            inertia = stiffest * STIFFEST
            self.state = float(begun(*(np.float64(x) for x in (velocity, effort, bound, inertia, self.reach))))
        else:
            reach = max(self.reach, bound / (STIFFEST * stiffest))
            self.state = float(bent(np.float64(self.state), np.float64(position - self.last), np.float64(reach)))
        self.last = position
        return bound * self.state


__all__ = ["SHORTEST", "Bristles", "begun", "bent", "slowed"]
