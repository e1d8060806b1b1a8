"""Inverse dynamics of a compiled motor: what current its file needs for a recorded motion, by MuJoCo, step by step.

The MJCF is reduced to the motor joint with what acts on it (friction, spring, tendons, passive motors, sensors);
effects that the file cannot hold act through the passive-force callback, as a user would turn them on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects import effect
from ...effects.base import DriveState
from ...effects.mjcf import motor_joint
from ...engines.mujoco import HOLD, divergence
from ...hand import Estimate, Hand, load_hand
from ...passive import effects_on

Array = NDArray[np.float64]

STEP_S = 0.002
KEPT = ("compiler", "option", "custom", "worldbody", "tendon", "actuator", "sensor")


@dataclass(frozen=True)
class CompiledMotor:
    """One motor of a compiled folder. root: its reduced MJCF (lxml). unit: effort per raw unit. joint: name of its
    joint."""

    root: Any
    actuator: str
    joint: str
    unit: float
    hand: Hand


def read_motor(folder: Path, actuator: str) -> CompiledMotor | None:
    """The motor `actuator` of a compiled folder; None where none of its files has one."""
    from lxml import etree

    for file in sorted(f for f in folder.glob("*.xml") if not f.name.startswith("scene")):
        root = etree.parse(str(file)).getroot()
        found = motor_joint(root, {"actuator": actuator})
        if found is not None:
            joint, unit = found[0].get("name"), found[1]
            return CompiledMotor(
                reduced(root, actuator, found[0]), actuator, joint, unit, load_hand(folder / "hand.json")
            )
    return None


def reduced(root: Any, actuator: str, joint: Any) -> Any:
    """`root` with nothing left but the motor's own body, tendons, actuators and sensors; changes it and returns it."""
    name = joint.get("name")
    link, palm = joint.getparent(), joint.getparent().getparent()
    for section in list(root):
        if section.tag not in KEPT:
            root.remove(section)
    for element in [e for e in palm if e is not link]:
        palm.remove(element)
    for element in [e for e in root.find("worldbody") if e is not palm]:
        element.getparent().remove(element)
    for tendon in root.findall("tendon/*"):
        if {j.get("joint") for j in tendon} != {name}:
            tendon.getparent().remove(tendon)
    for element in root.findall("actuator/*"):
        if element.get("joint") != name:
            element.getparent().remove(element)
    for element in root.findall("sensor/*"):
        if element.get("joint") != name and element.get("actuator") != actuator:
            element.getparent().remove(element)
    return root


def current_along(motor: CompiledMotor, state: DriveState) -> Array:
    """Current (n,) [raw] that a compiled motor needs for the motion of `state`, as its sensor would read it.

    mj_inverse at every step of 2 ms; the states of friction, tendons and effects come from stepping along the same
    motion.
    """
    import mujoco
    from lxml import etree

    model = mujoco.MjModel.from_xml_string(etree.tostring(motor.root).decode())
    model.opt.timestep = STEP_S
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)  # noise reaches a little beyond the range
    drive = model.actuator(motor.actuator).id
    model.actuator_gainprm[drive] = model.actuator_biasprm[drive] = 0.0  # the drive itself is what is asked for
    grid = np.arange(state.time_s[0], state.time_s[-1] + STEP_S, STEP_S)
    path = [np.interp(grid, state.time_s, x) for x in (state.position, state.velocity, state.acceleration)]
    # what is on a given path need not be stable by itself
    inertia, model.dof_armature[0] = model.dof_armature[0] - HOLD, HOLD
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data, out = mujoco.MjData(model), np.empty(len(grid))
    # passive motors have no control: nu does not count them
    own = np.delete(np.arange(len(data.actuator_force)), drive)
    data.time, data.qpos[0] = state.elapsed_s[0], path[0][0]
    data.plastic[:] = path[0][0]  # springs that yield start relaxed
    if "gravity_along" in state.extra:  # a motor without its finger has the plane of the finger in x and y
        gravity = np.stack(
            [np.interp(grid, state.time_s, state.extra[f"gravity_{k}"]) for k in ("along", "across")], axis=-1
        )
    else:
        gravity = np.broadcast_to(model.opt.gravity[:2], (len(grid), 2))
    with effects_on(model, started(motor.hand, state)), divergence():
        for i, (x, v, a) in enumerate(zip(*path, strict=True)):
            model.opt.gravity[:2] = gravity[i]
            data.qpos[0], data.qvel[0], data.qacc[0] = x, v, a
            mujoco.mj_inverse(model, data)
            mujoco.mj_fwdActuation(model, data)
            out[i] = data.qfrc_inverse[0] + inertia * a - data.actuator_force[own].sum()
            mujoco.mj_step(model, data)
    return _read(motor, np.interp(state.time_s, grid, out), state) / motor.unit


def started(hand: Hand, state: DriveState) -> Hand:
    """The hand with its effects as they stand when a recording begins (a drive that is warm by then)."""
    effects = tuple(
        replace(
            e,
            parameters={
                **e.parameters,
                **{
                    k: Estimate(v, None, "1", "recording")
                    for k, v in effect(e.effect).started(state, {k: x.value for k, x in e.parameters.items()}).items()
                },
            },
        )
        for e in hand.effects
    )
    return replace(hand, effects=effects)


def _read(motor: CompiledMotor, effort: Array, state: DriveState) -> Array:
    """The effort (n,) along a motion through the sensor of the motor's current: its delay against the encoder's, what
    its channel does, its cutoff."""
    sensors = {s.get("name"): s for s in motor.root.iterfind("sensor/*")}
    current, encoder = (sensors.get(f"{motor.actuator}_{kind}") for kind in ("current", "encoder"))
    time_s = state.time_s
    late = sum(sign * float(s.get("delay", 0.0)) for sign, s in ((1, current), (-1, encoder)) if s is not None)
    effort = np.interp(time_s - late, time_s, effort) if late else effort
    for e in motor.hand.effects:
        if e.where.get("actuator") == motor.actuator:
            effort = motor.unit * effect(e.effect).reading(
                effort / motor.unit, time_s, state.velocity, {k: v.value for k, v in e.parameters.items()}
            )
    cutoff = np.inf if current is None else float(current.get("cutoff", 0.0)) or np.inf
    return np.clip(effort, -cutoff, cutoff)
