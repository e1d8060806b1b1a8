"""Linkages: who drives whom, how stiffly, and what URDF's mimic makes of them."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compile.coupling import linkages, source_of
from ..description import Description, Model
from ..effects import effect
from ..effects.input import source
from ..engines import mujoco as engine
from ..engines.ours import load
from ..kinematics import finger_angles
from .finding import Finding
from .layout import tree

Array = NDArray[np.float64]

TRACKING = np.radians(0.1)
STIFFNESS = np.radians(0.05)
FORCE = 1.0  # N at the tip
PUSH_S = 0.3


def direction(description: Description, model: Model) -> Finding:
    """Move every driver through its range in MuJoCo and read the followers against the hand's polynomials."""
    ours, item = load(model.mjcf), f"coupling: {model.stem}"
    coupled = [f for f in ours.hand.fingers if f.couplings]
    if not coupled:
        return Finding(item, True, None, "the hand has no linkage")
    problems = _roles(ours, tree(model.mjcf))
    if problems:
        return Finding(item, False, None, "; ".join(problems[:5]))
    time = np.linspace(0, 1, 201)
    drive, wanted = {}, {}
    for finger in coupled:
        sources = {source_of(finger, c.follower) for c in finger.couplings}
        paths = {}
        for joint in finger.joints:
            if joint.name in sources:
                low, high = sorted(joint.range_rad)
                paths[joint.name] = low + (high - low) * (0.5 - 0.5 * np.cos(np.pi * time))
        angles = finger_angles(finger, paths)
        for i, joint in enumerate(finger.joints):
            name = ours.names.joint[finger.name, joint.name]
            (drive if joint.name in paths else wanted)[name] = angles[:, i]
    loose = _loose(ours)
    wanted = {name: a for name, a in wanted.items() if name not in loose}
    if not wanted:
        return Finding(item, True, None, f"loose by their named effects: {', '.join(sorted(loose))}")
    run = engine.simulate(model.mjcf, time, drive)
    gap = {n: float(np.abs(run.angles_rad[n] - a).max()) for n, a in wanted.items() if n in run.angles_rad}
    name = max(gap, key=lambda n: gap[n])
    passed = bool(gap[name] <= TRACKING and not run.warnings)
    said = f"drivers moved through their ranges, followers within {np.degrees(gap[name]):.2g} deg of the polynomial"
    return Finding(item, passed, float(np.degrees(gap[name])), said + ("" if passed else f' ("{name}")'))


def _loose(ours: Any) -> set[str]:
    """Followers that a named effect takes off their polynomial: lost motion, give, a stop, a dead band."""
    return {
        ours.names.joint[str(e.where.get("finger")), str(e.where.get("joint"))]
        for e in ours.hand.effects
        if effect(e.effect).station == "linkage" and (e.where.get("finger"), e.where.get("joint")) in ours.names.joint
    }


def _roles(ours: Any, root: Any) -> list[str]:
    found = {e.get("name"): e for e in root.iterfind("equality/joint")}
    problems = []
    for finger in ours.hand.fingers:
        for coupling in finger.couplings:
            name = ours.names.linkage[finger.name, coupling.follower]
            driver, follower = (ours.names.joint[finger.name, j] for j in (coupling.driver, coupling.follower))
            if name not in found:
                problems.append(f'no equality "{name}"')
                continue
            # lost motion, a dead band or a stop stands between them as an input joint
            roles = found[name].get("joint1"), source(root, found[name].get("joint2"))
            if roles == (driver, follower):
                problems.append(
                    f'"{name}" has joint1 and joint2 reversed: the dependent joint "{follower}" must be joint1'
                )
            elif roles != (follower, driver):
                problems.append(f'"{name}" couples {roles[0]} to {roles[1]} instead of {follower} to {driver}')
            if not (found[name].get("solref") and found[name].get("solimp")):
                problems.append(f'"{name}" leaves solref or solimp to the default')
    return problems


def stiffness(description: Description, model: Model) -> Finding:
    """Push each coupled finger's tip with 1 N, flexing and extending, and read the coupling's error.

    With the driver held still the error counts from the first moment; with the driver on its own actuator the finger
    may give way and move fast, so there it counts once the finger has settled, and its peak is stated.
    """
    ours, item = load(model.mjcf), f"coupling stiffness: {model.stem}"
    mj = engine.load(model.mjcf).mj
    if not engine.followers(mj):
        return Finding(item, not any(f.couplings for f in ours.hand.fingers), None, "the model has no linkage")
    worst, where, moving, loose = 0.0, "none", 0.0, _loose(ours)
    for finger in ours.hand.fingers:
        if not finger.couplings or any(ours.names.joint[finger.name, c.follower] in loose for c in finger.couplings):
            continue
        joints = [ours.names.joint[finger.name, j.name] for j in finger.joints]
        for held in (True, False):
            for sign in (1.0, -1.0):
                gaps = _pushed(copy.copy(mj), ours.names.tip[finger.name], joints, held, sign)
                moving = max(moving, float(gaps.max()))
                gap = float(gaps.max() if held else gaps[len(gaps) // 2 :].max())
                if not gap <= worst:
                    worst, where = gap, finger.name
    said = (
        f"{FORCE:.0f} N at the tip: at most {np.degrees(worst):.2g} deg ({where}), "
        f"{np.degrees(moving):.2g} deg while a finger gives way"
    )
    return Finding(item, bool(worst <= STIFFNESS), float(np.degrees(worst)), said)


def _pushed(mj: Any, tip: str, joints: list[str], held: bool, sign: float) -> Array:
    """Coupling error (t,) [rad] of a finger under a force that turns with the tip; it flexes (sign 1) or extends the
    last joint."""
    import mujoco

    mj.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    coupled = engine.followers(mj)
    mine = {mj.joint(j).id for j in joints}
    if held:
        mj.dof_armature[[mj.joint(j).dofadr[0] for j in joints if mj.joint(j).id not in coupled]] = 1e3
    data = mujoco.MjData(mj)
    data.qpos[:] = engine.on_linkages(mj, 0.5 * (mj.key("open").qpos + mj.key("close").qpos))
    for i in np.flatnonzero(mj.actuator_ctrlnum):  # servos hold where the push starts; passive motors have no control
        if mj.actuator_trntype[i] == int(mujoco.mjtTrn.mjTRN_JOINT):
            data.ctrl[mj.actuator_ctrladr[i]] = data.qpos[mj.jnt_qposadr[mj.actuator_trnid[i, 0]]]
    site, last = mj.site(tip).id, mj.joint(joints[-1]).id
    gaps = []
    with engine.divergence():
        for _ in range(round(PUSH_S / mj.opt.timestep)):
            mujoco.mj_kinematics(mj, data)
            lever = data.site_xpos[site] - data.xanchor[last]
            push = np.cross(data.xaxis[last], lever)
            push *= sign * FORCE / max(float(np.linalg.norm(push)), 1e-9)
            data.qfrc_applied[:] = 0
            mujoco.mj_comPos(mj, data)
            mujoco.mj_applyFT(
                mj, data, push, np.zeros(3), data.site_xpos[site], mj.site_bodyid[site], data.qfrc_applied
            )
            mujoco.mj_step(mj, data)
            wanted = engine.on_linkages(mj, data.qpos)
            gaps.append(
                max(abs(wanted[mj.jnt_qposadr[j]] - data.qpos[mj.jnt_qposadr[j]]) for j in coupled if j in mine)
            )
    return np.nan_to_num(np.array(gaps), nan=np.inf)


def mimic(description: Description, model: Model) -> Finding:
    """URDF's mimic: a line per follower, source independent and declared earlier, its loss as stated in hand.json."""
    ours, item = load(model.mjcf), f"mimic: {model.stem}"
    seen, dependent, problems, worst = [], {}, [], 0.0
    for joint in tree(model.urdf).findall("joint"):
        element = joint.find("mimic")
        if element is not None:
            dependent[joint.get("name")] = element
            if element.get("joint") not in seen:
                problems.append(f'the source of "{joint.get("name")}" is declared later or not at all')
        seen.append(joint.get("name"))
    stated = next(m for m in description.table["models"] if m["stem"] == model.stem)["linkages"]
    for name, element in dependent.items():
        if element.get("joint") in dependent:
            problems.append(f'"{name}" mimics "{element.get("joint")}", which mimics another joint')
    for finger in ours.hand.fingers:
        for linkage in linkages(finger):
            name = ours.names.joint[finger.name, linkage.follower]
            equality = ours.names.linkage[finger.name, linkage.follower]
            element = dependent.pop(name, None)
            worst = max(worst, float(np.degrees(linkage.loss_rad)))
            if element is None:
                problems.append(f'"{name}" mimics nothing')
                continue
            gap = abs(float(element.get("multiplier", "1")) - linkage.multiplier) + abs(
                float(element.get("offset", "0")) - linkage.offset
            )
            if element.get("joint") != ours.names.joint[finger.name, linkage.source] or gap > 1e-6:
                problems.append(f'"{name}" is not the best line through its polynomial')
            if abs(stated[equality]["mimic_loss_deg"] - np.degrees(linkage.loss_rad)) > 1e-6:
                problems.append(f'the loss that hand.json states for "{equality}" is not that of its line')
    problems += [f'"{name}" mimics a joint, though nothing couples them' for name in dependent]
    said = (
        "; ".join(problems[:5])
        or f"lines, unchained, declared in order; at worst {worst:.2g} deg from the polynomial, as stated"
    )
    return Finding(item, not problems, worst, said)
