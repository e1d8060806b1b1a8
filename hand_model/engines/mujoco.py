"""MuJoCo: kinematics of an MJCF or URDF, and the simulation in which the linkages move the driven fingers' further
joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..effects.input import SUFFIX
from ..errors import DescriptionError, did_you_mean
from .common import columns, homogeneous, relative

Array = NDArray[np.float64]

STEP_S = 0.001
HOLD = 1.0  # kg m^2 of armature on a prescribed joint: some 1e5 times a finger, so that nothing pushes it off its path


@dataclass(frozen=True)
class Model:
    """A MuJoCo model. joints: its hinges and slides. points: sites and bodies without joints, by name. courses: joint
    id -> (driver's id, polycoef (5,)) of those that an equality ties to another one of their body: where they are not
    given, they follow it."""

    mj: Any
    joints: tuple[str, ...]
    addresses: NDArray[np.int64]
    points: Mapping[str, tuple[str, int]]
    bodies: Mapping[str, int]
    courses: Mapping[int, tuple[int, Array]]


@dataclass(frozen=True)
class Simulated:
    """positions: site -> (t, 3) [m] in the palm frame. angles_rad: joint -> (t,) [rad]. warnings: those MuJoCo
    raised."""

    positions: Mapping[str, Array]
    angles_rad: Mapping[str, Array]
    warnings: tuple[str, ...]


def load(file: str | Path) -> Model:
    """Load an MJCF or URDF; raises DescriptionError with MuJoCo's reason where that fails."""
    import mujoco

    path = Path(file)
    if not path.is_file():
        raise DescriptionError(f"{path}: no such file")
    try:
        mj = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise DescriptionError(f"{path}: MuJoCo cannot load it ({error})") from None
    return wrap(mj)


def wrap(mj: Any) -> Model:
    """Model of a mujoco.MjModel."""
    import mujoco

    kinds = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    courses = {j: tie for j, tie in followers(mj).items() if mj.jnt_bodyid[j] == mj.jnt_bodyid[tie[0]]}
    moving = [i for i in range(mj.njnt) if mj.jnt_type[i] in kinds]
    bodies = {mj.body(i).name: i for i in range(1, mj.nbody)}
    points = {mj.site(i).name: ("site", i) for i in range(mj.nsite)}
    points |= {
        name: ("body", i)
        for name, i in bodies.items()
        if mj.body_jntnum[i] == 0 and name != "palm" and name not in points
    }
    return Model(mj, tuple(mj.joint(i).name for i in moving), mj.jnt_qposadr[moving], points, bodies, courses)


def positions(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Positions (n, 3) [m] of sites and of bodies without joints; joint_angles: joint -> (n,) [rad]."""
    return _kinematics(model, _coordinates(model, joint_angles), rotations=False)[1]


def poses(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Body poses (n, 4, 4); joint_angles: joint -> (n,) [rad]."""
    return kinematics(model, joint_angles)[0]


def kinematics(model: Model, joint_angles: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Body poses (n, 4, 4) and positions (n, 3) [m]; joint_angles: joint -> (n,) [rad]."""
    return _kinematics(model, _coordinates(model, joint_angles), rotations=True)


def _coordinates(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Array:
    """Coordinates (n, joints) [rad or m], those of courses where their driver wants them."""
    out = columns(model.joints, joint_angles)
    place = {int(a): i for i, a in enumerate(model.addresses)}
    for joint, (driver, coefficients) in model.courses.items():
        if model.mj.joint(joint).name not in joint_angles:
            a, b = int(model.mj.jnt_qposadr[joint]), int(model.mj.jnt_qposadr[driver])
            moved = np.polynomial.polynomial.polyval(out[:, place[b]] - model.mj.qpos0[b], coefficients)
            out[:, place[a]] = model.mj.qpos0[a] + moved
    return out


def _kinematics(model: Model, angles: Array, rotations: bool) -> tuple[dict[str, Array], dict[str, Array]]:
    import mujoco

    mj = model.mj
    data = mujoco.MjData(mj)
    n = len(angles)
    body, turn, site = np.empty((n, mj.nbody, 3)), np.empty((n, mj.nbody, 9)), np.empty((n, mj.nsite, 3))
    base = model.bodies.get("palm")
    for i in range(n):
        data.qpos[model.addresses] = angles[i]
        mujoco.mj_kinematics(mj, data)
        body[i], site[i] = data.xpos, data.site_xpos
        if rotations:
            turn[i] = data.xmat
        elif base is not None:
            turn[i, base] = data.xmat[base]
    points = {name: (site if kind == "site" else body)[:, k] for name, (kind, k) in model.points.items()}
    wanted = model.bodies if rotations else ({} if base is None else {"palm": base})
    frames = {name: homogeneous(turn[:, k].reshape(n, 3, 3), body[:, k]) for name, k in wanted.items()}
    return relative(frames, points)


def followers(mj: Any) -> Mapping[int, tuple[int, Array]]:
    """Joint id of each dependent joint -> (driver's joint id, polycoef (5,)), as the model's active equalities say."""
    import mujoco

    out = {}
    for i in range(mj.neq):
        if mj.eq_type[i] == int(mujoco.mjtEq.mjEQ_JOINT) and mj.eq_active0[i] and mj.eq_obj2id[i] >= 0:
            out[int(mj.eq_obj1id[i])] = (int(mj.eq_obj2id[i]), mj.eq_data[i, :5].copy())
    return out


def on_linkages(mj: Any, qpos: Array) -> Array:
    """qpos (nq,) with every dependent joint put where its equality wants it, drivers first."""
    coupled, done = followers(mj), set()
    out = np.array(qpos, float)
    while len(done) < len(coupled):
        ready = [j for j, (driver, _) in coupled.items() if j not in done and (driver not in coupled or driver in done)]
        if not ready:
            raise DescriptionError("the model's joint equalities form a circle")
        for joint in ready:
            driver, coefficients = coupled[joint]
            a, b = mj.jnt_qposadr[joint], mj.jnt_qposadr[driver]
            out[a] = mj.qpos0[a] + np.polynomial.polynomial.polyval(out[b] - mj.qpos0[b], coefficients)
            done.add(joint)
    return out


def simulate(
    file: str | Path, time_s: ArrayLike, driver_angles: Mapping[str, ArrayLike], sample_s: ArrayLike | None = None
) -> Simulated:
    """Simulate with the palm fixed, the independent joints on given paths and everything else moved by the equalities.

    time_s: (t,) [s], increasing. driver_angles: independent joint -> (t,) [rad], joined by a cubic spline; independent
    joints that are not given stay at zero. sample_s: (m,) [s] within time_s at which to report (default time_s).
    Contact, limits and actuators are off:
    this measures the linkages. Raises DescriptionError for unknown or dependent joints, or paths with gaps.
    """
    from scipy.interpolate import CubicSpline

    model = load(file)
    mj, time = model.mj, np.asarray(time_s, float)
    sample = time if sample_s is None else np.asarray(sample_s, float)
    coupled = followers(mj)
    # what stands between a driver and its map (lost motion, a stop) is moved by its tendons
    free = [name for name in model.joints if mj.joint(name).id not in coupled and SUFFIX not in name]
    for name in driver_angles:
        if name not in free:
            raise DescriptionError(f'joint "{name}" cannot be driven; {did_you_mean(name, free)}')
    angles = columns(
        free, {name: np.broadcast_to(np.asarray(a, float), time.shape) for name, a in driver_angles.items()}
    )
    angles = np.broadcast_to(angles, (len(time), len(free)))
    if len(time) < 2 or not (np.isfinite(angles).all() and np.isfinite(time).all() and (np.diff(time) > 0).all()):
        raise DescriptionError("a path needs two or more samples, time increasing, without gaps")
    if sample.min() < time[0] - 1e-9 or sample.max() > time[-1] + 1e-9:
        raise DescriptionError(
            f"samples from {sample.min()} to {sample.max()} s lie outside the path ({time[0]} to {time[-1]} s)"
        )
    spline = CubicSpline(time, angles)
    steps = int(np.ceil((time[-1] - time[0]) / STEP_S)) + 1
    grid = time[0] + STEP_S * np.arange(steps + 1)
    qpos, warnings = _roll(mj, [mj.joint(name).id for name in free], grid, spline)
    joints = {name: np.interp(sample, grid, qpos[:, a]) for name, a in zip(model.joints, model.addresses, strict=True)}
    joints |= {name: spline(sample)[:, i] for i, name in enumerate(free)}
    return Simulated(positions(model, joints), joints, warnings)


def _roll(mj: Any, prescribed: list[int], grid: Array, spline: Any) -> tuple[Array, tuple[str, ...]]:
    """Step through the grid (t,) [s] with joints on a spline; qpos (t, nq) and warnings."""
    import mujoco

    off = mujoco.mjtDisableBit
    mj.opt.disableflags |= int(off.mjDSBL_CONTACT) | int(off.mjDSBL_ACTUATION)
    if not any(SUFFIX in mj.joint(i).name for i in range(mj.njnt)):
        mj.opt.disableflags |= int(off.mjDSBL_LIMIT)
    mj.opt.timestep = STEP_S
    address, dof = mj.jnt_qposadr[prescribed], mj.jnt_dofadr[prescribed]
    mj.dof_armature[dof] = HOLD
    mj.dof_frictionloss[dof] = 0.0
    mj.jnt_limited[prescribed] = 0  # a path a little beyond its range would be braked, and throw what it carries
    data = mujoco.MjData(mj)
    path, speed, push = spline(grid), spline(grid, 1), HOLD * spline(grid, 2)
    data.qpos[address] = path[0]
    data.qpos[:] = on_linkages(mj, data.qpos)
    qpos = np.empty((len(grid), mj.nq))
    with divergence():
        for i in range(len(grid)):
            data.qpos[address], data.qvel[dof], data.qfrc_applied[dof] = path[i], speed[i], push[i]
            qpos[i] = data.qpos
            mujoco.mj_step(mj, data)
    return qpos, raised(data)


@contextmanager
def divergence() -> Iterator[list[str]]:
    """What MuJoCo says of states that are no numbers or too large, after which it goes on from the model's own start;
    unheard it would write that to a file in the user's folder."""
    import mujoco

    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: said.append(text) if "unstable" in text else None)
    try:
        yield said
    finally:
        mujoco.set_mju_user_warning(before)


def raised(data: Any) -> tuple[str, ...]:
    """Names of the warnings that a simulation has raised."""
    import mujoco

    kinds = mujoco.mjtWarning
    return tuple(kinds(i).name for i in range(int(kinds.mjNWARNING)) if data.warning[i].number)
