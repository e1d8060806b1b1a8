"""Forward replay of a compiled hand: one joint on its recorded path, everything behind it moved by the file's own
elements.

Contact and gravity are off (the pose of the palm is not the question), limits, tendons and equalities on; effects that
the file cannot hold act through the passive-force callback, the motor's load being the recorded one. The motion is
slowed down: maps, plays and stops do not mind, and nothing of the file that was not measured is tested.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects import effect
from ...effects.base import DriveState
from ...effects.chain import behind_inputs, inputs, map_ahead, map_to, source
from ...effects.input import STRETCHED, SUFFIX, steepest
from ...engines.mujoco import HOLD, divergence, on_linkages
from ...hand import load_hand
from ...passive import effects_on

Array = NDArray[np.float64]

STEP_S = 0.002
COASTING_S = 0.002  # in which a part that nothing drives stands: whatever rubs in its play, nobody has measured
# the replay's time over the recording's: the spring that holds a finger on its lever is nominal, not what is tested
SLOWER = 3.0


def follower_along(folder: Path, state: DriveState, where: Mapping[str, Any], station: str) -> Array | None:
    """Angle (n,) [rad] of a joint of a compiled folder while its driver moves as in `state`; None where no file has
    both.

    where: "finger", "joint" and "actuator" of a finding. station "encoder": the driver is the motor, in percent, and
    the joint stands behind its lever. "linkage": the driver is the joint's own, in degrees.
    """
    import mujoco

    for file in sorted(f for f in folder.glob("*.xml") if not f.name.startswith("scene")):
        model = mujoco.MjModel.from_xml_path(str(file))
        follower = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{where['finger']}_{where['joint']}")
        driver = _driver(model, str(where["actuator"]), follower, station)
        if driver is not None:
            path = state.position if station == "encoder" else np.deg2rad(state.position)
            hand = load_hand(folder / "hand.json")
            # no other one moves it
            own = replace(hand, effects=tuple(e for e in hand.effects if effect(e.effect).station == station))
            return _roll(model, own, state, str(where["actuator"]), driver, path, follower)
    return None


def _driver(model: Any, actuator_name: str, follower: int, station: str) -> int | None:
    """Id of the joint that is put on the recorded path."""
    import mujoco

    if follower < 0:
        return None
    if station == "encoder":
        actuator = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator_name)
        joint = int(model.actuator_trnid[actuator, 0]) if actuator >= 0 else -1
        # a nominal actuator acts on the finger itself: such a file has no motor
        return joint if joint >= 0 and joint != follower else None
    row = map_to(model, follower)
    return None if row is None else source(model, int(model.eq_obj2id[row]))


def _roll(model: Any, hand: Any, state: DriveState, motor: str, driver: int, path: Array, follower: int) -> Array:
    import mujoco
    from scipy.interpolate import PchipInterpolator

    model.opt.timestep = STEP_S
    model.opt.gravity[:] = 0
    model.opt.tolerance = 1e-16  # of forces on inertias a millionth of the held one
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    hurried = any(effect(e.effect).hurries({k: x.value for k, x in e.parameters.items()}) for e in hand.effects)
    slower = 1.0 if hurried else SLOWER
    _rub(
        model,
        driver,
        float(model.dof_M0[model.jnt_dofadr[follower]]),
        path,
        float(np.abs(np.gradient(path, state.time_s)).max()) / slower,
    )
    held = {driver}
    for actuator in range(len(model.actuator_trnid)):
        joint = int(model.actuator_trnid[actuator, 0])
        held.add(joint)  # motors whose finger is moved otherwise rest where they are
        if mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator) == motor:
            model.actuator_gainprm[actuator, 0] = _unit(model, motor)
            model.actuator_biasprm[actuator] = 0.0
            model.actuator_ctrllimited[model.actuator_ctrladr[actuator]] = 0  # passive motors have no control
    address, dof = model.jnt_qposadr[list(held)], model.jnt_dofadr[list(held)]
    model.dof_armature[dof] = HOLD
    model.jnt_limited[list(held)] = 0  # a path a little beyond its range would be braked, and throw what it carries
    _free(model, driver)
    _let_follow(model, follower)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    # ties of slides, stiff for the inertias as they were and for the file's own step
    absolute = model.eq_solref[:, 0] < 0
    model.eq_solref[absolute] = 2 * STEP_S, 1.0
    at, rate = model.jnt_qposadr[driver], model.jnt_dofadr[driver]
    time_s = slower * state.time_s
    spline = PchipInterpolator(time_s, path)
    grid = np.arange(time_s[0], time_s[-1] + STEP_S, STEP_S)
    position, velocity = spline(grid.clip(None, time_s[-1])), spline(grid.clip(None, time_s[-1]), 1)
    load = np.interp(grid, time_s, state.extra.get("load", np.zeros(len(state.time_s))))
    data, out = mujoco.MjData(model), np.empty(len(grid))
    data.qpos[at] = position[0]
    data.qpos[:] = _started(model, data.qpos, driver)
    rest = data.qpos[address].copy()
    with effects_on(model, hand), divergence():
        for i, (x, v, f) in enumerate(zip(position, velocity, load, strict=True)):
            data.qpos[address], data.qvel[dof] = rest, 0.0
            data.qpos[at], data.qvel[rate] = x, v
            data.ctrl[:] = f  # of other motors, which rest on their places, it does not matter
            out[i] = data.qpos[model.jnt_qposadr[follower]]
            mujoco.mj_step(model, data)
    return np.interp(time_s, grid, out)


def _free(model: Any, driver: int) -> None:
    """Take the lever off a finger that is itself on the path: pulled back to it, it would accelerate, and what it
    carries with it."""
    for t, finger, _ in _pushes(model):
        if finger == driver:
            _cut(model, t)


def _let_follow(model: Any, joint: int) -> None:
    """Let what follows a joint do so by its maps alone: what is lost there is not asked, and would pull at it."""
    import mujoco

    lost = {i for i in range(model.njnt) if SUFFIX in model.joint(i).name and source(model, i) == joint}
    ahead = {i: behind_inputs(model, i) for i in lost}
    for row in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
        model.eq_obj2id[row] = ahead.get(int(model.eq_obj2id[row]), model.eq_obj2id[row])
    for t in range(model.ntendon):
        if lost & set(model.wrap_objid[_parts(model, t)].tolist()):
            _cut(model, t)


def _cut(model: Any, tendon: int) -> None:
    """Let a tendon do nothing."""
    model.tendon_stiffness[tendon] = model.tendon_damping[tendon] = model.tendon_limited[tendon] = 0


def _parts(model: Any, tendon: int) -> slice:
    """Where the joints of a tendon and their coefficients lie among those of all."""
    return slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])


def _rub(model: Any, driver: int, inertia: float, path: Array, fastest: float) -> None:
    """Let inputs that lie loose in a play behind a driver stand within `COASTING_S`, as friction, which the gap's ends
    push without lag; springs that hold inputs ahead of them, which have to bear it, so stiff that it hardly stretches
    them, with inputs so heavy that they are no faster. inertia: of the joint that is moved [kg m^2]; path (n,) [its unit]
    and fastest [per second]: of the driver."""
    import mujoco

    for row in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
        last = int(model.eq_obj2id[row])
        if source(model, last) == driver:
            between = list(inputs(model, last))
            loose = [model.jnt_dofadr[joint] for joint, tendon in between if not model.tendon_stiffness[tendon]]
            ahead = behind_inputs(model, last)
            slope = (
                1.0 if ahead == driver else steepest(model.eq_data[map_to(model, ahead), :5], path.min(), path.max())
            )
            friction = inertia * model.eq_data[row, 1] ** 2 * fastest * slope / COASTING_S
            for joint, tendon in _ties_ahead(model, last):
                heavier = max(friction * slope / STRETCHED / model.tendon_stiffness[tendon], 1.0)
                # the last joint of a tendon is the one that it holds
                mine = [t for t in range(model.ntendon) if model.wrap_objid[_parts(model, t)][-1] == joint]
                model.tendon_stiffness[mine] *= heavier
                model.tendon_damping[mine] *= heavier
                model.dof_armature[model.jnt_dofadr[joint]] *= heavier
            model.dof_frictionloss[loose] = friction


def _ties_ahead(model: Any, joint: int, loose: bool = False) -> list[tuple[int, int]]:
    """The inputs that springs hold on what they follow, with these, towards the driver from the first that lies loose in
    a play on, or from the joint on."""
    ties = []
    for held, tendon in inputs(model, joint):
        if not model.tendon_stiffness[tendon]:
            loose = True
        elif loose:
            ties.append((held, tendon))
    row = map_ahead(model, behind_inputs(model, joint))
    return ties if row is None else [*ties, *_ties_ahead(model, int(model.eq_obj2id[row]), loose)]


def _unit(model: Any, motor: str) -> float:
    """Effort per raw unit of current of a motor."""
    import mujoco

    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, f"{motor}_effort_per_raw")
    return float(model.numeric_data[model.numeric_adr[number]]) if number >= 0 else 1.0


def _started(model: Any, qpos: Array, driver: int) -> Array:
    """qpos (nq,) with inputs at the end of their tendons' ranges that a first stroke finds closed, followers on their
    maps."""
    out = on_linkages(model, qpos)
    for joint in range(model.njnt):
        if SUFFIX in model.joint(joint).name and source(model, joint) == driver:
            out[model.jnt_qposadr[joint]] = _within(model, out, joint)
            out = on_linkages(model, out)
    return _pushed(model, out)


def _within(model: Any, qpos: Array, joint: int) -> float:
    """Coordinate of an input joint: that of what inputs follow there plus half the gap of its play, within the tendons
    that bound it."""
    low, high, gap = -np.inf, np.inf, 0.0
    for t in range(model.ntendon):
        parts = _parts(model, t)
        joints, coefficients = model.wrap_objid[parts].tolist(), model.wrap_prm[parts]
        if joint not in joints or not model.tendon_limited[t]:
            continue
        own = coefficients[joints.index(joint)]
        if own == 0:  # a stop beyond which nothing of this one passes
            continue
        rest = sum(c * qpos[model.jnt_qposadr[j]] for j, c in zip(joints, coefficients, strict=True) if j != joint)
        ends = sorted((model.tendon_range[t] - rest) / own)
        low, high = max(low, ends[0]), min(high, ends[1])
        if np.ptp(model.tendon_range[t]) < 1e5:
            gap = float(np.ptp(ends))
    return float(np.clip(qpos[model.jnt_qposadr[behind_inputs(model, joint)]] + 0.5 * gap, low, high))


def _pushed(model: Any, qpos: Array) -> Array:
    """qpos (nq,) with every finger on its lever, and what follows it on its maps."""
    out = qpos.copy()
    for _, finger, lever in _pushes(model):
        out[model.jnt_qposadr[finger]] = max(out[model.jnt_qposadr[finger]], out[model.jnt_qposadr[lever]])
    return on_linkages(model, out)


def _pushes(model: Any) -> Iterator[tuple[int, int, int]]:
    """The tendons that hold fingers on their levers, each with the joints of both."""
    for t in range(model.ntendon):
        if model.tendon(t).name.endswith("_push"):
            yield t, *model.wrap_objid[model.tendon_adr[t] :][:2].tolist()
