"""The rig's file in MuJoCo against its recordings: motion simulated in open loop, effort by inverse dynamics."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..engines.mujoco import divergence
from ..session import Session
from .coupling_angles import CouplingAngle, coupling_angles
from .inverse import apply_levels, effort_residuals
from .mjcf import read_effects
from .model import RigModel, RigTrial, load_rig
from .overrides import compile_model
from .states import fill_gaps
from .states import recorded_states as joint_states
from .stepper import EffectStepper
from .supply import supply_deviation

Array = NDArray[np.float64]
States = tuple[Array, Array, Array]  # times [s], positions, velocities
LOST = 2.0  # of the recorded range: a simulation that is as far off has left its recording
STEPS = 4  # of Gauss and Newton, towards a start: the motion is smooth in it


@dataclass(frozen=True)
class JointResidual:
    """What differs at one joint in one trial.

    position_rmse [rad or m]: simulated in open loop over the whole trial minus recorded (nan where that was not run).
    diverged: the simulation was off by `LOST` times the recorded range or more somewhere, or broke down; no sample counts
    as farther off than that, since by then how far it is says nothing. effort_rmse [N m or N]: recorded effort minus inverse
    dynamics at the recorded motion, moving samples only (nan where no effort is known).
    """

    trial: str
    joint: str
    validate: bool
    position_rmse: float
    position_mae: float
    effort_rmse: float
    samples: int
    time_s: Array = field(repr=False, default_factory=lambda: np.zeros(0))
    simulated: Array = field(repr=False, default_factory=lambda: np.zeros(0))
    effort_samples: int = 0
    diverged: bool = False

    @property
    def followed(self) -> bool:
        """Whether a simulation was run and stayed with its recording."""
        return bool(np.isfinite(self.position_rmse)) and not self.diverged


@dataclass(frozen=True)
class RigResiduals:
    """All residuals of a session, and figures over several trials; of couplings where both ends have an encoder."""

    joints: tuple[JointResidual, ...]
    couplings: tuple[CouplingAngle, ...] = ()

    def figure(self, metric: str, validate: bool, joint: str | None = None) -> float:
        """Root mean square (or mean, of position_mae) over trials, weighted by samples; nan where there is none."""
        chosen = [r for r in self.joints if r.validate == validate and joint in (None, r.joint)]
        values = np.array([getattr(r, metric) for r in chosen])
        weight = np.array([r.effort_samples if metric == "effort_rmse" else r.samples for r in chosen], float)
        good = np.isfinite(values)
        if not good.any():
            return float("nan")
        power = 1 if metric.endswith("mae") else 2
        return float((np.sum(weight[good] * values[good] ** power) / weight[good].sum()) ** (1 / power))


def simulate_trial(
    rig: RigModel, trial: RigTrial, horizon_s: float = np.inf, recorded: States | None = None
) -> tuple[Array, Array]:
    """Positions (n, joints) simulated in open loop at the trial's time stamps (n,), and those stamps.

    Start: recorded position and smoothed velocity, taken again after every horizon_s [s] (recorded: `recorded_states`,
    where they are known already); of a single joint that nothing drives what its first period asks for. Recorded effort
    or control goes in; nothing is fed back.
    """
    model = compile_model(rig, trial)
    apply_levels(model, rig, trial)
    effects = EffectStepper(model, read_effects(rig.xml))
    effects.follow(rig, trial)
    step = float(model.opt.timestep)
    grid = np.arange(0.0, trial.time_s[-1] + step, step)
    control, applied = _controls(rig, trial, model, effects, grid)
    stride = len(grid) if np.isinf(horizon_s) else max(1, round(horizon_s / step))
    known = recorded or recorded_states(rig, trial)
    starts = _states_at(known, grid[::stride])
    if stride == len(grid) and not model.nu and model.nv == 1 and not applied.any():
        starts = _asked_start(model, effects, trial, rig.joints[0], starts, _period_s(known))
    out = _simulated(model, effects, control, applied, starts, stride)
    at = np.stack([np.interp(trial.time_s, grid, column) for column in out.T], 1)
    return trial.time_s, at


def _asked_start(
    model: Any, effects: EffectStepper, trial: RigTrial, joint: str, start: tuple[Array, Array], period_s: float
) -> tuple[Array, Array]:
    """Position and velocity (1, 1) each that fit the first period best (Gauss and Newton): a speed differentiated from
    an encoder is wrong by more than friction does within it, and the error stays for good."""
    recorded, step = fill_gaps(trial.time_s, trial.position[joint]), float(model.opt.timestep)
    seen = trial.time_s <= period_s
    grid = np.arange(0.0, trial.time_s[seen][-1] + step, step)
    none, sizes = np.zeros((len(grid), 0)), 1e-3 * np.array([1.0, 2 * np.pi / period_s])

    def left(state: Array) -> Array:
        run = _simulated(model, effects, none, np.zeros((len(grid), 1)), tuple(state.reshape(2, 1, 1)), len(grid))
        return np.interp(trial.time_s[seen], grid, run[:, 0]) - recorded[seen]

    state = np.array([float(s[0, 0]) for s in start])
    error = left(state)
    for _ in range(STEPS if seen.sum() > len(state) else 0):
        slopes = np.stack(
            [(left(state + size * e) - error) / size for size, e in zip(sizes, np.eye(2), strict=True)], 1
        )
        moved = state - np.linalg.lstsq(slopes, error)[0]
        if not (after := left(moved)) @ after < error @ error:
            break
        state, error = moved, after
    return tuple(state.reshape(2, 1, 1))


def _period_s(recorded: States) -> float:
    """Period [s] of a swing, by its usual position and velocity; at most a quarter of the recording."""
    time_s, q, v = recorded
    return float(min(2 * np.pi * np.std(q) / max(np.std(v), 1e-300), 0.25 * time_s[-1]))


def _simulated(
    model: Any, effects: EffectStepper, control: Array, applied: Array, starts: tuple[Array, Array], stride: int
) -> Array:
    """Positions (n, nq) at every step, from starts (positions and velocities, (n / stride, nq) each), taken again after
    every stride steps."""
    import mujoco

    data = mujoco.MjData(model)
    step, grid = float(model.opt.timestep), control
    effects.restart()
    data.qpos[:], data.qvel[:] = (s[0] for s in starts)
    if not model.nu:  # semi-implicit Euler is leapfrog when the velocity starts half a step early
        mujoco.mj_forward(model, data)
        data.qvel[:] -= 0.5 * step * data.qacc_smooth
    out = np.empty((len(grid), model.nq))
    plain = not (effects.entries or effects.laws)
    with divergence() as broken:
        for k in range(len(grid)):
            if k and k % stride == 0:
                if broken:
                    mujoco.mj_resetData(model, data)
                    broken.clear()
                data.qpos[:], data.qvel[:] = (s[k // stride] for s in starts)
                data.time = k * step
                effects.restart()
            out[k] = np.nan if broken else data.qpos
            if broken:
                continue
            data.ctrl[:] = control[k]
            data.qfrc_applied[:] = applied[k]
            if plain:
                mujoco.mj_step(model, data)
            else:
                mujoco.mj_step1(model, data)
                mujoco.mj_fwdActuation(model, data)
                effects.passive(model, data)
                mujoco.mj_step2(model, data)
    return out


def can_simulate(rig: RigModel, trial: RigTrial) -> bool:
    """Whether the trial holds every joint's position and all that its drives put in, or are told."""
    return all(j in trial.position for j in rig.joints) and all(trial.tells(d) for d in rig.drives)


def recorded_states(rig: RigModel, trial: RigTrial) -> States:
    """Recorded position and velocity, both smoothed: (n,) [s], (n, joints) each."""
    smooth = [joint_states(trial.time_s, trial.position[j]) for j in rig.joints]
    return smooth[0][0], np.stack([q for _, q, _ in smooth], 1), np.stack([v for _, _, v in smooth], 1)


def _states_at(recorded: States, at_s: Array) -> tuple[Array, Array]:
    """Position and velocity (m, joints) each at times at_s (m,) [s]."""
    grid, q, v = recorded
    return tuple(np.stack([np.interp(at_s, grid, column) for column in x.T], 1) for x in (q, v))


def _controls(rig: RigModel, trial: RigTrial, model: Any, effects: EffectStepper, grid: Array) -> tuple[Array, Array]:
    """Control of every actuator (n, nu) on the simulation's grid, late and sagging where the file says so; and efforts
    (n, nv) recorded of drives that the file drives by voltage: their motor is disconnected."""
    out, applied = np.zeros((len(grid), model.nu)), np.zeros((len(grid), model.nv))
    supply = np.interp(grid, trial.time_s, supply_deviation(rig, trial))
    for drive in rig.drives:
        a, at = model.actuator(drive.name).id, grid - effects.delay_s(drive.joint)
        if drive.joint in trial.voltage:
            out[:, a] = effects.control(
                np.interp(at, trial.time_s, fill_gaps(trial.time_s, trial.voltage[drive.joint])), supply
            )
        elif drive.kind == "position" and drive.joint in trial.setpoint:
            out[:, a] = np.interp(at, trial.time_s, fill_gaps(trial.time_s, trial.setpoint[drive.joint]))
        elif drive.joint in trial.effort and (gain := trial.drives[drive.joint].gain):
            effort = np.interp(at, trial.time_s, fill_gaps(trial.time_s, trial.effort[drive.joint]))
            if drive.kind == "force":
                out[:, a] = effort / gain
            else:
                model.actuator_gear[a] = 0.0
                applied[:, rig.joints.index(drive.joint)] = effort
    return out, applied


def replay_rig(
    session: Session,
    model: bytes | RigModel | None = None,
    simulate: bool = True,
    efforts: bool = True,
    validate: bool | None = None,
    couplings: bool = False,
) -> RigResiduals:
    """Replay the trials of a rig session on its own file, or on `model` (MJCF bytes, or a RigModel).

    simulate, efforts, couplings: which comparisons to make; validate: only trials that do, or do not (None: all).
    Raises SessionError and DescriptionError as `load_rig` does.
    """
    rig = model if isinstance(model, RigModel) else load_rig(session, model)
    known = {(r.trial, r.joint): r.error for r in effort_residuals(rig)} if efforts else {}
    angles = coupling_angles(rig) if couplings else ()
    out: list[JointResidual] = []
    for trial in rig.trials:
        if validate not in (None, trial.validate) or not all(j in trial.position for j in rig.joints):
            continue
        run = simulate and can_simulate(rig, trial)
        time_s, simulated = simulate_trial(rig, trial) if run else (trial.time_s, None)
        for i, joint in enumerate(rig.joints):
            motion = None if simulated is None else simulated[:, i]
            out.append(_residual(trial, joint, time_s, motion, known.get((trial.name, joint))))
    return RigResiduals(tuple(out), tuple(a for a in angles if validate in (None, a.validate)))


def position_error(simulated: Array, recorded: Array) -> tuple[Array, bool]:
    """How far (n,) a simulation is off a recorded position [rad or m], at most `LOST` times the recorded range, and
    whether it was as far off anywhere, or broke down."""
    lost = LOST * np.ptp(recorded) + 1e-9
    error = np.minimum(np.nan_to_num(np.abs(simulated - recorded), nan=lost), lost)
    return error, bool(np.any(error == lost))


def _residual(
    trial: RigTrial, joint: str, time_s: Array, simulated: Array | None, effort_error: Array | None
) -> JointResidual:
    recorded = fill_gaps(trial.time_s, trial.position[joint])
    rmse, mae, diverged = float("nan"), float("nan"), False
    if simulated is not None:
        error, diverged = position_error(simulated, recorded)
        rmse, mae = float(np.sqrt(np.mean(error**2))), float(np.mean(error))
    effort, count = float("nan"), 0
    if effort_error is not None and len(effort_error):
        effort, count = float(np.sqrt(np.mean(effort_error**2))), len(effort_error)
    return JointResidual(
        trial.name,
        joint,
        trial.validate,
        rmse,
        mae,
        effort,
        len(recorded),
        time_s,
        np.zeros(0) if simulated is None else simulated,
        count,
        diverged,
    )
