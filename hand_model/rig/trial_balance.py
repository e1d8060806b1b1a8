"""The balance of one trial: recorded efforts and positions, filtered and thinned, against columns of the declared
physics."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects.path import runs
from ..session.log import rows_lost
from .balance import STATE_CUTOFF, Column, Rows, back_emf, weighed
from .dynamics import INERTIAL, inertial_columns, inertial_parameters
from .model import RigModel, RigTrial
from .overrides import body_names, compile_model
from .rest import Creep, moving_weight
from .states import (
    PASSED,
    STEEP,
    choose_cutoff,
    differentiate,
    fill_gaps,
    low_pass,
    uniform_time,
    velocity_noise,
)

Array = NDArray[np.float64]
MAX_RATE_HZ = 250.0  # faster recordings are thinned to this: joints move below 50 Hz
MOST_ENDS = 0.05  # of a recording are left out at most at each end
RINGING = 1e-2  # of a joint's mean speed [rms]: what a filter leaves of it in a pause, which is no motion
GAP = 0.25  # of what the filter reaches: a shorter stretch without samples is bridged
PER_PERIOD, ENOUGH_SAMPLES = (12.0, 48.0), 20_000  # of the cut-off, as many as make so many of a session
MAX_SAMPLES = 4000  # per trial: residuals are correlated over far longer than this spacing


@dataclass(frozen=True)
class _Motion:
    """What of one trial a balance is made of, rests or not, on the thinned grid (n,). states: position, velocity,
    acceleration (n, joints); directions (n, joints); effort: joint -> (n,) or None; rest: joint -> weight (n,) where
    it stands, slow (joints,): speeds next to rest; values, still (n, joints, P): columns, without acceleration too;
    own (n, joints): effort of what the trial's bodies add; step: of the filtered samples."""

    trial: RigTrial
    columns: tuple[Column, ...]
    time_s: Array
    rate_hz: float
    cutoff_hz: float
    states: tuple[Array, Array, Array]
    directions: Array
    slow: Array
    rest: Mapping[str, Array]
    effort: Mapping[str, Array | None]
    channels: Mapping[str, Array]
    values: Array
    still: Array
    own: Array
    step: int


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
    motion = _motion(rig, trial, columns, cutoff_hz, rests=weights is None, kept=kept)
    return () if motion is None else _rows(rig, motion, trim_s, motion.rest if weights is None else weights)


def rows_with_rests(
    rig: RigModel, trial: RigTrial, columns: tuple[Column, ...], cutoff_hz: float, trim_s: float, kept: Collection[str]
) -> tuple[tuple[Rows, ...], tuple[Rows, ...]]:
    """`trial_rows`, and the same with the rests of all joints kept."""
    motion = _motion(rig, trial, columns, cutoff_hz, rests=True, kept=kept)
    if motion is None:
        return (), ()
    moving = _rows(rig, motion, trim_s, motion.rest)
    return moving, _rows(rig, motion, trim_s, {}) if any(len(r.weight) for r in moving) else moving


def _motion(
    rig: RigModel,
    trial: RigTrial,
    columns: tuple[Column, ...],
    cutoff_hz: float | None,
    rests: bool,
    kept: Collection[str],
) -> _Motion | None:
    """None where a joint's position is missing; rests: whether their weights are asked for."""
    if any(j not in trial.position for j in rig.joints):
        return None
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
    slow = np.maximum(noise, ringing)
    sign = np.clip(v / slow, -1.0, 1.0)
    thin = max(1, int(rate / max(_samples_a_period(rig, cutoff) * cutoff, 24.0)))
    rest = {}
    for j in (j for j in rig.independent if rests and j not in kept):
        i = rig.joints.index(j)
        creep = Creep.of(v[:, i], a[:, i], float(ringing[i]))
        rest[j] = moving_weight(raw[j], rate, cutoff, wide, creep)[::thin]
    q, v, a, sign = (*(x[::thin] for x in (q, v, a)), _averaged(sign, thin))
    grid, rate = grid[::thin], rate / thin
    return _Motion(
        trial,
        columns,
        grid,
        rate,
        cutoff,
        (q, v, a),
        sign,
        slow,
        rest,
        {j: None if e is None else _thinned(e, rate * thin, thin) for j, e in effort.items()},
        {k: c[::thin] for k, c in channels.items()},
        _column_values(rig, trial, model, columns, q, v, a, sign),
        _column_values(rig, trial, model, columns, q, v, np.zeros_like(a), sign),
        _own_bodies(rig, trial, model, q, v, a),
        max(1, int(np.ceil(len(grid) / MAX_SAMPLES)), int(rate / (6 * cutoff))),
    )


def _samples_a_period(rig: RigModel, cutoff_hz: float) -> float:
    """Of the balance's cut-off: friction turns round within less than one, and is smeared over a coarse grid, but many
    joints for a long time are many samples."""
    seconds = sum(float(t.time_s[-1] - t.time_s[0]) for t in rig.trials)
    return float(np.clip(ENOUGH_SAMPLES / (seconds * len(rig.independent) * cutoff_hz), *PER_PERIOD))


def _rows(rig: RigModel, motion: _Motion, trim_s: float | None, weights: Mapping[str, Array]) -> tuple[Rows, ...]:
    """Balances of a motion, with weights of the samples by joint."""
    trial, grid, rate, cutoff, step = motion.trial, motion.time_s, motion.rate_hz, motion.cutoff_hz, motion.step
    (q, v, a), effort = motion.states, motion.effort
    external = np.array([c.kind in ("inertial", "spring", "stiffness") for c in motion.columns])
    away = np.minimum(grid - grid[0], grid[-1] - grid)
    settled = away >= (min(1.0 / cutoff, MOST_ENDS * (grid[-1] - grid[0])) if trim_s is None else trim_s)
    settled &= ~_near_gap(rig, trial, grid, 1.0 / cutoff)
    rows = []
    for joint in rig.independent:
        jacobian = _jacobian(rig, joint, q)
        if any(effort[j] is None for j in jacobian):
            continue
        i = rig.joints.index(joint)
        y = sum((effort[j] - motion.own[:, rig.joints.index(j)]) * w for j, w in jacobian.items())
        x, x_still = (
            sum(c[:, rig.joints.index(j)] * w[:, None] for j, w in jacobian.items())
            for c in (motion.values, motion.still)
        )
        w = weights.get(joint, np.zeros(0))
        seen = (settled & (np.abs(v[:, i]) > motion.slow[i]) & (w > 0 if len(w) else True))[::step]
        rows.append(
            Rows(
                trial.name,
                joint,
                trial.validate,
                grid,
                q[:, i],
                v[:, i],
                a[:, i],
                low_pass(weighed(y, w), rate, cutoff)[::step],
                low_pass(weighed(x, w), rate, cutoff)[::step],
                seen,
                float(motion.slow[i]),
                cutoff,
                rate,
                {"effort": y, **motion.channels},
                x,
                external,
                y - effort[joint],
                step,
                (q, v, a),
                motion.directions[:, i],
                motion.directions,
                jacobian,
                motion.columns,
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
