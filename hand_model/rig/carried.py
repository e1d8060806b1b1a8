"""What a joint's gear carries besides weight: the inertia of what it moves.

Friction in a gear bounds the acceleration that it carries, and grows with it: followed with a small lag, the two settle
where a bound from the step before would make them swing to and fro.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

LAG_S = 5e-3
Value = TypeVar("Value", float, NDArray[np.float64])


def followed(acceleration: Value, change: Value, step_s: float) -> Value:
    """The acceleration [per s^2] that the load follows after a step_s [s] in which the velocity changed by `change` [per
    s]."""
    return acceleration + (change / step_s - acceleration) * (step_s / (step_s + LAG_S))


def bodies_inertia(model: Any, joint: int) -> float:
    """Inertia [kg m2 or kg] of the bodies that a joint of an MjModel moves, in its reference pose, the others held."""
    import mujoco

    data, unit, column = mujoco.MjData(model), np.zeros(model.nv), np.zeros(model.nv)
    mujoco.mj_forward(model, data)
    unit[model.jnt_dofadr[joint]] = 1.0
    mujoco.mj_mulM(model, data, column, unit)
    return float(column[model.jnt_dofadr[joint]] - model.dof_armature[model.jnt_dofadr[joint]])


class CarriedLoad:
    """What a joint carries, step by step, as its gear feels it."""

    def __init__(self, inertia: float) -> None:
        """inertia [kg m2 or kg]: of what the joint carries."""
        self.inertia, self.acceleration, self.last = inertia, 0.0, (np.nan, 0.0)

    def __call__(self, time_s: float, velocity: float, external: float) -> float:
        """Effort of gravity and the like, `external` [N m or N], less what the carried inertia takes up. A clock that goes
        back begins anew."""
        before_s, before = self.last
        if time_s > before_s:
            self.acceleration = followed(self.acceleration, velocity - before, time_s - before_s)
        elif time_s < before_s:
            self.acceleration = 0.0
        self.last = time_s, velocity
        return external - self.inertia * self.acceleration
