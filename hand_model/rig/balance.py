"""The balance of effort at every joint: what the drive puts in against columns of the declared physics.

Coupled joints are projected on the independent one (virtual work): J^T of (inertia + friction - effort) = 0.
Effort, columns and states pass the same filter; samples at rest are left out, since friction is unknown there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .dynamics import INERTIAL, inertial_parameters
from .model import RigModel
from .overrides import compile_model
from .solve import sums_of
from .states import (
    later,
    low_pass,
)

Array = NDArray[np.float64]
STATE_CUTOFF = 3.0  # of the states, in cut-offs of the balance


MOMENTS = ("hx", "hy", "hz")


@dataclass(frozen=True)
class Column:
    """One declared parameter that the balance is linear in. kind: "inertial", "armature", "damping", "frictionloss",
    "stiffness", "offset", "gain" or "spring"; name: body, joint, drive or tendon; value: as declared."""

    kind: str
    name: str
    part: str
    value: float

    @property
    def label(self) -> str:
        """kind:name:part, as parameters are reported."""
        return f"{self.kind}:{self.name}" + (f":{self.part}" if self.part else "")


@dataclass(frozen=True)
class Rows:
    """The balance of one independent joint in one trial.

    Full-rate grid (n,): time_s, states, extra channels (never filtered: an effect reads them as they are), full_columns
    (n, P), still_columns (n, P): the same without acceleration, carried (P,) bool and load_known (n,): of what the
    joint carries besides its own drive and friction. Filtered and thinned (m,): effort, columns (m, P), moving (bool):
    what the fit uses, neither at rest nor at the ends.
    effort: recorded, less what the trial's own bodies add to the declared ones. states: position, velocity,
    acceleration (n, joints) of the whole rig; direction (n,), directions (n, joints): of friction in [-1, 1]: the sign
    of velocity, linear where it drowns in noise, its mean around each instant (or jumps between two would all be up to
    half a sample early or late); jacobian: joint -> (n,), what hangs on this joint by couplings, itself included;
    declared: the columns' names; weight (n,): of every sample before the filter, zero where the joint stands (empty:
    one).
    """

    trial: str
    joint: str
    validate: bool
    time_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    columns: Array
    moving: Array
    rest_speed: float
    cutoff_hz: float
    rate_hz: float
    extra: Mapping[str, Array]
    full_columns: Array
    carried: Array
    load_known: Array
    step: int
    states: tuple[Array, Array, Array] = ()
    direction: Array = ()
    directions: Array = ()
    jacobian: Mapping[str, Array] = field(default_factory=dict)
    declared: tuple[Column, ...] = ()
    still_columns: Array = field(default_factory=lambda: np.zeros((0, 0)))
    weight: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def used(self) -> NDArray[np.int64]:
        """Which of the columns (P,) are not zero throughout: of a chain few parts move any one joint."""
        return np.flatnonzero(np.any(self.full_columns != 0, axis=0))

    @cached_property
    def sums(self) -> tuple[Array, Array, float, int]:
        """Of the moving samples: columns by columns (P, P), columns by effort (P,), effort squared, count."""
        x = self.columns[self.moving][:, self.used]
        return sums_of(x, self.effort[self.moving], self.used, self.columns.shape[1])

    def filtered(self, values: Array, delay_s: float = 0.0) -> Array:
        """Full-rate columns (n, ...), later by a delay, through the weight and filter of this balance, thinned to (m,
        ...)."""
        # at rest all comes later, and the weight stays where it is; else the filter may come first
        stands = len(self.weight) > 0
        values = later(self.time_s, values, delay_s) if delay_s and stands else values
        values = low_pass(weighed(values, self.weight), self.rate_hz, self.cutoff_hz)[:: self.step]
        return later(self.time_s[:: self.step], values, delay_s) if delay_s and not stands else values

    def load(self, theta: Array) -> Array:
        """Load (n,) that the joint transmits at declared parameters theta (P,)."""
        return self.full_columns @ (theta * self.carried) - self.load_known

    def bias(self, theta: Array) -> Array:
        """Load (n,) without what the joints' acceleration asks for: weight, centrifugal and Coriolis forces,
        springs."""
        return self.still_columns @ (theta * self.carried) - self.load_known

    def expected(self, theta: Array) -> Array:
        """Effort (n,) of the joint's own drive that the declared parameters theta (P,) ask for at this motion."""
        return self.full_columns @ theta - self.load_known


def declared_columns(rig: RigModel, off_axis: bool = False) -> tuple[Column, ...]:
    """The parameters that the MJCF declares: every number in it that is not zero is a starting value to be fitted; a
    declared zero is a statement (a symmetric body, a joint without friction) and stays. off_axis: free the first
    moments that are declared zero as well (centres of mass off their declared axes)."""
    model = compile_model(rig)
    columns: list[Column] = []
    inertial = inertial_parameters(model)
    for b in range(1, model.nbody):
        for p, part in enumerate(INERTIAL):
            if inertial[b - 1, p] != 0 or (off_axis and part in MOMENTS):
                columns.append(Column("inertial", model.body(b).name, part, float(inertial[b - 1, p])))
    for j, joint in enumerate(rig.joints):
        for kind, value in (
            ("armature", model.dof_armature[j]),
            ("damping", model.dof_damping[j]),
            ("stiffness", model.jnt_stiffness[j]),
        ):
            if value != 0:
                columns.append(Column(kind, joint, "", float(value)))
        key = f"joint:{joint}:frictionloss"
        levels = sorted({float(np.atleast_1d(t.set[key])[0]) for t in rig.trials if key in t.set})
        if not levels and model.dof_frictionloss[j] != 0:
            columns.append(Column("frictionloss", joint, "", float(model.dof_frictionloss[j])))
        columns += [Column("frictionloss", joint, repr(level), level) for level in levels]
    for drive in rig.drives:
        if drive.offset:
            columns.append(Column("offset", drive.name, "", 0.0))
        # Back-EMF: damping while the leads are connected, unless what the drive gives after it is recorded.
        if drive.kind == "voltage" and not any(drive.joint in t.effort for t in rig.trials):
            columns.append(Column("back_emf", drive.name, "", back_emf(model, drive.name)))
    columns += [
        Column("spring", model.tendon(t).name, "", float(model.tendon_stiffness[t]))
        for t in range(model.ntendon)
        if model.tendon_stiffness[t] != 0
    ]
    return tuple(columns)


def back_emf(model: Any, name: str) -> float:
    """Damping [N m s or N s/m] at its joint of a drive by voltage whose leads are connected."""
    a = model.actuator(name).id
    resistance, constant = model.actuator_gainprm[a, :2]
    return float(constant**2 / resistance * model.actuator_gear[a, 0] ** 2)


def weighed(values: Array, weight: Array) -> Array:
    """Values (n, ...) times a weight (n,) of every sample (empty: one)."""
    return values * weight.reshape(-1, *[1] * (values.ndim - 1)) if len(weight) else values
