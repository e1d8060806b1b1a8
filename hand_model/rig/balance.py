"""The balance of effort at every joint: what the drive puts in against columns of the declared physics.

Coupled joints are projected on the independent one (virtual work): J^T of (inertia + friction - effort) = 0.
Effort, columns and states pass the same filter; samples at rest are left out, since friction is unknown there.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects.path import runs
from ..session.log import rows_lost
from .dynamics import INERTIAL, inertial_columns, inertial_parameters
from .model import RigModel, RigTrial
from .overrides import body_names, compile_model
from .rest import Creep, moving_weight
from .solve import sums_of
from .states import (
    PASSED,
    STEEP,
    choose_cutoff,
    differentiate,
    fill_gaps,
    later,
    low_pass,
    uniform_time,
    velocity_noise,
)

Array = NDArray[np.float64]
MAX_RATE_HZ = 250.0  # faster recordings are thinned to this: joints move below 50 Hz
STATE_CUTOFF = 3.0  # of the states, in cut-offs of the balance
MOST_ENDS = 0.05  # of a recording are left out at most at each end
RINGING = 1e-2  # of a joint's mean speed [rms]: what a filter leaves of it in a pause, which is no motion
GAP = 0.25  # of what the filter reaches: a shorter stretch without samples is bridged
MAX_SAMPLES = 4000  # per trial: residuals are correlated over far longer than this spacing


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
        values = low_pass(_weighed(values, self.weight), self.rate_hz, self.cutoff_hz)[:: self.step]
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


def trial_rows(
    rig: RigModel,
    trial: RigTrial,
    columns: tuple[Column, ...],
    cutoff_hz: float | None = None,
    trim_s: float | None = None,
    weights: Mapping[str, Array] | None = None,
    kept: Collection[str] = (),
) -> tuple[Rows, ...]:
    """The balance of every independent joint whose effort is known (or whose drive is absent or open) in one trial.
    trim_s [s]: what is left out at each of its ends, where the filter knows one side only; by default what the filter
    reaches; weights: joint -> weight of its samples, as another balance of the same trial has them; kept: joints whose
    rest is kept (`moving_weight`)."""
    missing = [j for j in rig.joints if j not in trial.position]
    if missing:
        return ()
    model = compile_model(rig, trial)
    grid = uniform_time(trial.time_s)
    rate = 1.0 / (grid[1] - grid[0])
    skip = max(1, int(rate / MAX_RATE_HZ + 1e-6)) if cutoff_hz is None or cutoff_hz < 0.3 * MAX_RATE_HZ else 1
    raw = {
        j: _thinned(np.interp(grid, trial.time_s, fill_gaps(trial.time_s, trial.position[j])), rate, skip)
        for j in rig.joints
    }
    effort = {j: None if e is None else _thinned(e, rate, skip) for j, e in _joint_effort(rig, trial, grid).items()}
    grid, channels = grid[::skip], {k: c[::skip] for k, c in _channels(trial, grid).items()}
    rate = rate / skip
    cutoff = cutoff_hz or min(choose_cutoff(raw[j], rate) for j in rig.independent)
    # Columns pass the balance's filter as the effort does; the states they are made of must not lose that band before.
    wide = STATE_CUTOFF * cutoff
    q = np.stack([low_pass(raw[j], rate, wide, STEEP) for j in rig.joints], 1)
    v = differentiate(q, rate, wide < PASSED * rate)
    a = differentiate(v, rate, wide < PASSED * rate)
    ringing = RINGING * np.std(v, axis=0)
    noise = [3 * velocity_noise(raw[j], rate, min(wide, PASSED * rate)) for j in rig.joints]
    rest = np.maximum(noise, ringing)
    sign = np.clip(v / rest, -1.0, 1.0)
    thin = max(1, int(rate / max(12 * cutoff, 24.0)))
    if weights is None:
        weights = {}
        for j in (j for j in rig.independent if j not in kept):
            i = rig.joints.index(j)
            creep = Creep.of(v[:, i], a[:, i], float(ringing[i]))
            weights[j] = moving_weight(raw[j], rate, cutoff, wide, creep)[::thin]
    q, v, a, sign = (*(x[::thin] for x in (q, v, a)), _averaged(sign, thin))
    effort = {j: None if e is None else _thinned(e, rate, thin) for j, e in effort.items()}
    grid, channels = grid[::thin], {k: c[::thin] for k, c in channels.items()}
    rate = rate / thin
    values = _column_values(rig, trial, model, columns, q, v, a, sign)
    still = _column_values(rig, trial, model, columns, q, v, np.zeros_like(a), sign)
    own = _own_bodies(rig, trial, model, q, v, a)
    step = max(1, int(np.ceil(len(grid) / MAX_SAMPLES)), int(rate / (6 * cutoff)))
    external = np.array([c.kind in ("inertial", "spring", "stiffness") for c in columns])
    away = np.minimum(grid - grid[0], grid[-1] - grid)
    settled = away >= (min(1.0 / cutoff, MOST_ENDS * (grid[-1] - grid[0])) if trim_s is None else trim_s)
    settled &= ~_near_gap(rig, trial, grid, 1.0 / cutoff)
    rows = []
    for joint in rig.independent:
        jacobian = _jacobian(rig, joint, q)
        if any(effort[j] is None for j in jacobian):
            continue
        i = rig.joints.index(joint)
        y = sum((effort[j] - own[:, rig.joints.index(j)]) * w for j, w in jacobian.items())
        x, x_still = (sum(c[:, rig.joints.index(j)] * w[:, None] for j, w in jacobian.items()) for c in (values, still))
        w = weights.get(joint, np.zeros(0))
        seen = (settled & (np.abs(v[:, i]) > rest[i]) & (w > 0 if len(w) else True))[::step]
        rows.append(
            Rows(
                trial.name,
                joint,
                trial.validate,
                grid,
                q[:, i],
                v[:, i],
                a[:, i],
                low_pass(_weighed(y, w), rate, cutoff)[::step],
                low_pass(_weighed(x, w), rate, cutoff)[::step],
                seen,
                float(rest[i]),
                cutoff,
                rate,
                {"effort": y, **channels},
                x,
                external,
                y - effort[joint],
                step,
                (q, v, a),
                sign[:, i],
                sign,
                jacobian,
                columns,
                x_still,
                w,
            )
        )
    return tuple(rows)


def _near_gap(rig: RigModel, trial: RigTrial, grid: Array, reach_s: float) -> NDArray[np.bool_]:
    """Which times (n,) [s] lie within `reach_s` of a stretch in which samples of a position or an effort were lost, more
    than a line between its ends stands for: a quarter of that, and more than is usual between two."""
    near = np.zeros(len(grid), bool)
    for values in (*(trial.position[j] for j in rig.joints), *trial.effort.values(), *trial.voltage.values()):
        time_s = trial.time_s[np.isfinite(values)]
        interval = np.diff(time_s)
        if not len(interval):
            continue
        lost = rows_lost(time_s) & (interval > GAP * reach_s)
        for begin, end in zip(time_s[:-1][lost], time_s[1:][lost], strict=True):
            near |= (grid > begin - reach_s) & (grid < end + reach_s)
    for begin, end in (run for clipped in trial.clipped.values() for run in runs(clipped)):
        near |= (grid > trial.time_s[begin] - reach_s) & (grid < trial.time_s[end - 1] + reach_s)
    return near


def _weighed(values: Array, weight: Array) -> Array:
    """Values (n, ...) times a weight (n,) of every sample (empty: one)."""
    return values * weight.reshape(-1, *[1] * (values.ndim - 1)) if len(weight) else values


def _own_bodies(rig: RigModel, trial: RigTrial, model: Any, q: Array, v: Array, a: Array) -> Array:
    """Effort (n, joints) of what the trial's own bodies (weights, lengths) have over the declared ones: it is known."""
    if not body_names(trial.set):
        return np.zeros(q.shape)
    change = inertial_parameters(model) - inertial_parameters(compile_model(rig))
    return np.einsum("njbp,bp->nj", inertial_columns(model, q, v, a, np.array(model.opt.gravity)), change)


def _thinned(values: Array, rate: float, skip: int) -> Array:
    """Every skip-th sample (m,) after an anti-alias filter."""
    return values if skip == 1 else low_pass(values, rate, 0.4 * rate / skip)[::skip]


def _averaged(values: Array, skip: int) -> Array:
    """Every skip-th sample (m, joints) of the mean over so many around it, which does not ring about a jump."""
    from scipy.ndimage import convolve1d

    kernel = np.ones(skip) if skip % 2 else np.convolve(np.ones(skip), [0.5, 0.5])
    return convolve1d(values, kernel / skip, axis=0, mode="nearest")[::skip]


def _channels(trial: RigTrial, grid: Array) -> dict[str, Array]:
    channels = dict(trial.extra) | {f"setpoint:{j}": s for j, s in trial.setpoint.items()}
    channels |= {f"position:{j}": s for j, s in trial.position.items()} | {
        f"voltage:{j}": s for j, s in trial.voltage.items()
    }
    return {k: np.interp(grid, trial.time_s, fill_gaps(trial.time_s, s)) for k, s in channels.items()}


def _jacobian(rig: RigModel, joint: str, q: Array) -> dict[str, Array]:
    """d(joint j) / d(independent joint), (n,) each, for the joint itself and all that hang on it by couplings."""
    out = {joint: np.ones(len(q))}
    grown = True
    while grown:
        grown = False
        for c in rig.couplings:
            if c.independent in out and c.dependent not in out:
                x = q[:, rig.joints.index(c.independent)]
                slope = sum(k * c.polycoef[k] * x ** (k - 1) for k in range(1, 5))
                out[c.dependent] = out[c.independent] * slope
                grown = True
    return out


def _joint_effort(rig: RigModel, trial: RigTrial, grid: Array) -> dict[str, Array | None]:
    """Known effort on each joint (n,), None where a connected drive's effort is not recorded."""
    out: dict[str, Array | None] = {}
    for joint in rig.joints:
        drive = rig.drive(joint)
        if drive is None or joint not in trial.live:
            out[joint] = np.zeros(len(grid))
        elif joint in trial.effort:
            out[joint] = np.interp(grid, trial.time_s, fill_gaps(trial.time_s, trial.effort[joint]))
        elif joint in trial.voltage:
            volts = np.interp(grid, trial.time_s, fill_gaps(trial.time_s, trial.voltage[joint]))
            out[joint] = trial.drives[joint].gain * volts
        elif drive.kind == "position" and joint in trial.setpoint:
            target = np.interp(grid, trial.time_s, fill_gaps(trial.time_s, trial.setpoint[joint]))
            position = np.interp(grid, trial.time_s, fill_gaps(trial.time_s, trial.position[joint]))
            out[joint] = trial.drives[joint].along(grid, target, position)
        else:
            out[joint] = None
    return out


def _column_values(
    rig: RigModel, trial: RigTrial, model: Any, columns: tuple[Column, ...], q: Array, v: Array, a: Array, sign: Array
) -> Array:
    """Effort per unit of each parameter at each joint, (n, joints, P); what the physics takes is positive."""
    out = np.zeros((len(q), len(rig.joints), len(columns)))
    inertial = inertial_columns(model, q, v, a, np.array(model.opt.gravity))
    for p, c in enumerate(columns):
        if c.kind == "inertial":
            out[:, :, p] = inertial[:, :, model.body(c.name).id - 1, INERTIAL.index(c.part)]
        elif c.kind == "spring":
            out[:, :, p] = _tendon_column(model, c.name, q)
        elif c.kind in ("offset", "back_emf"):
            drive = next(d for d in rig.drives if d.name == c.name)
            j = rig.joints.index(drive.joint)
            # as this recording's drive is set: its gear and resistance may not be the declared ones
            brake = back_emf(model, c.name) / c.value if c.value else 1.0
            own = -model.actuator(c.name).gear[0] if c.kind == "offset" else brake * v[:, j]
            out[:, j, p] = own * (drive.joint in trial.live)
        else:
            j = rig.joints.index(c.name)
            if c.kind == "frictionloss":
                level = trial.set.get(f"joint:{c.name}:frictionloss")
                mine = not c.part or (level is not None and repr(float(np.atleast_1d(level)[0])) == c.part)
                out[:, j, p] = sign[:, j] * mine
            else:
                state = {"armature": a, "damping": v, "stiffness": q - model.qpos_spring[j]}[c.kind]
                out[:, j, p] = state[:, j]
    return out


def _tendon_column(model: Any, name: str, q: Array) -> Array:
    """Effort (n, joints) per unit stiffness of a fixed tendon with a dead band, what the spring takes from the
    joints."""
    t = model.tendon(name).id
    coef = np.zeros(model.nv)
    for w in range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t]):
        coef[model.wrap_objid[w]] = model.wrap_prm[w]
    length = q @ coef
    low, high = model.tendon_lengthspring[t]
    stretch = np.where(length > high, length - high, np.where(length < low, length - low, 0.0))
    return stretch[:, None] * coef
