"""The MJCF of a hand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..effects import effect
from ..effects.base import LOST_MOTION
from ..hand import Effect, Hand
from .course import Tied, complete_courses, stiffen, write_joints
from .drive import Drive, nominal_drives
from .motor import complete_keyframes, write_motors
from .plan import Link, Plan, in_file_names
from .xml import child, comment, number, vector

# Equality as stiff as MuJoCo keeps stable at this step: time constant of two steps, impedance at MuJoCo's upper limit.
TIMESTEP = 0.001
SOLREF = (2 * TIMESTEP, 1.0)
SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)


def mjcf(plan: Plan, newton_metre_per_unit: float | None = None) -> Any:
    """The MJCF tree (lxml element) of one plan; newton_metre_per_unit: torque per raw unit of current [N m], where it
    is known."""
    from lxml import etree

    root = etree.Element("mujoco", model=plan.stem)
    child(root, "compiler", angle="radian", autolimits=True, balanceinertia=False, meshdir="assets")
    child(root, "option", timestep=TIMESTEP, jacobian="dense", integrator="implicitfast")
    _defaults(root)
    asset = child(root, "asset")
    world = child(root, "worldbody")
    bodies: dict[str | None, Any] = {None: world}
    drives = nominal_drives(plan)
    for link in plan.links:
        bodies[link.name] = _body(bodies[link.parent], asset, link, drives)
    if plan.excludes:
        contact = child(root, "contact")
        for one, other, reason in plan.excludes:
            comment(contact, reason)
            child(contact, "exclude", body1=one, body2=other)
    _equalities(root, plan)
    _actuators(root, plan, drives)
    _physics(root, in_file_names(plan), newton_metre_per_unit)
    _keyframes(root, plan)
    stiffen(root, _ties(plan))
    return root


def _defaults(root: Any) -> None:
    default = child(root, "default")
    visual = child(default, "default", class_="visual")
    child(visual, "geom", group="2", contype="0", conaffinity="0", mass="0", rgba=(0.75, 0.75, 0.78, 1.0))
    collision = child(default, "default", class_="collision")
    child(
        collision,
        "geom",
        type="capsule",
        group="3",
        mass="0",
        condim="4",
        friction=(0.9, 0.01, 1e-4),
        rgba=(0.2, 0.5, 0.9, 0.4),
    )
    marker = child(default, "default", class_="marker")
    child(marker, "site", size=0.0025, group="4", rgba=(0.9, 0.1, 0.1, 1.0))


def _body(parent: Any, asset: Any, link: Link, drives: dict[str, Drive]) -> Any:
    body = child(parent, "body", name=link.name, pos=link.position_parent)
    inertia = link.inertia
    t = inertia.tensor
    full = (t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2])
    child(body, "inertial", pos=inertia.centre, mass=inertia.mass, fullinertia=full)
    if link.joint is not None:
        drive = drives.get(link.joint)
        write_joints(body, () if link.turning else link.extras)
        joint = child(
            body, "joint", name=link.joint, type="hinge", pos=(0, 0, 0), axis=link.axis, range=link.range_rad, ref="0"
        )
        if drive is not None:
            joint.set("damping", number(drive.damping))
            if drive.armature:
                joint.set("armature", number(drive.armature))
        write_joints(body, link.extras if link.turning else ())
    child(asset, "mesh", name=f"{link.name}_visual", file=f"{link.mesh}.stl")
    child(body, "geom", class_="visual", type="mesh", mesh=f"{link.name}_visual")
    for i in range(len(link.parts)):
        child(asset, "mesh", name=f"{link.name}_part_{i}", file=f"{link.mesh}_part_{i}.stl")
        child(body, "geom", class_="collision", type="mesh", mesh=f"{link.name}_part_{i}")
    for shape in () if link.parts else link.shapes:
        if np.linalg.norm(shape.end - shape.start) < 1e-6:
            child(body, "geom", class_="collision", type="sphere", size=shape.radius, pos=shape.start)
        else:
            child(body, "geom", class_="collision", size=shape.radius, fromto=np.concatenate([shape.start, shape.end]))
    for name, position in link.sites.items():
        child(body, "site", name=name, class_="marker", pos=position)
    return body


def _equalities(root: Any, plan: Plan) -> None:
    if not plan.linkages and not any(link.extras for link in plan.links):
        return
    equality = child(root, "equality")
    for name, (finger, linkage) in plan.linkages.items():
        coefficients = np.zeros(5)
        coefficients[: len(linkage.coefficients)] = linkage.coefficients
        child(
            equality,
            "joint",
            name=name,
            joint1=plan.names.joint[finger, linkage.follower],
            joint2=plan.names.joint[finger, linkage.driver],
            polycoef=coefficients,
            solref=SOLREF,
            solimp=SOLIMP,
        )
    for link in plan.links:
        for extra in link.extras:
            ends = {"joint1": extra.name, "joint2": link.joint, "polycoef": extra.polynomial}
            child(equality, "joint", name=extra.equality, **ends, solref=SOLREF, solimp=SOLIMP)


def _actuators(root: Any, plan: Plan, drives: dict[str, Drive]) -> None:
    driven = {joint: drive for joint, drive in drives.items() if drive.actuator}
    if not driven:
        return
    ranges = {link.joint: link.range_rad for link in plan.links}
    actuator = child(root, "actuator")
    comment(actuator, "nominal, not measured: gains and forces are scaled to the fallback inertias (README)")
    for joint, d in driven.items():
        child(
            actuator,
            "position",
            name=d.actuator,
            joint=joint,
            kp=d.kp,
            kv=d.kv,
            ctrlrange=ranges[joint],
            forcerange=(-d.force, d.force),
        )


def _physics(root: Any, hand: Hand, newton_metre_per_unit: float | None) -> None:
    """Identified motors and effects, as far as MJCF can hold them."""
    write_motors(root, hand, newton_metre_per_unit)
    fingers = {f.name for f in hand.fingers} | {None}
    for found in in_order(hand.effects):
        if found.where.get("finger") in fingers:
            values = {name: estimate.value for name, estimate in found.parameters.items()}
            effect(found.effect).write_mjcf(root, found.where, values)


def in_order(effects: Iterable[Effect]) -> list[Effect]:
    """Effects as they are written one behind the other: lost motion last, for the spring that holds an input on its
    driver, above or below a bound, would pull a play ahead of it shut."""
    return sorted(effects, key=lambda e: effect(e.effect).family == LOST_MOTION)


def _keyframes(root: Any, plan: Plan) -> None:
    """Every joint of the tree at its angle; what a motor or an effect brought in is at zero until it is completed."""
    keyframe = child(root, "keyframe")
    joints = [e.get("name") for e in root.find("worldbody").iter("joint")]
    # an actuator without input has no control
    actuators = [a for a in root.iterfind("actuator/*") if isinstance(a.tag, str) and a.get("input") != "none"]
    for name, angles in plan.keyframes.items():
        key = child(keyframe, "key", name=name, qpos=[angles.get(joint, 0.0) for joint in joints])
        if actuators:
            key.set(
                "ctrl", vector([angles.get(a.get("joint"), 0.0) if a.tag == "position" else 0.0 for a in actuators])
            )
    complete_keyframes(root, in_file_names(plan))
    complete_courses(root, _ties(plan))


def _ties(plan: Plan) -> dict[str, tuple[Tied, ...]]:
    """Hinge -> its extra joints."""
    return {link.joint: link.extras for link in plan.links if link.joint is not None and link.extras}
