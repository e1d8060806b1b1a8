"""The URDF of a hand: the same links, limits, inertias and names; markers and tips are links on fixed joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..rotation import perpendicular_basis
from .drive import nominal_drives
from .plan import Link, Plan
from .xml import child, comment, number

SPEED = 10.0  # rad/s, nominal: URDF demands a velocity limit
EFFORT = 1.0  # N m, nominal, for joints without a drive


def urdf(plan: Plan) -> Any:
    """The URDF tree (lxml element) of one plan."""
    from lxml import etree

    root = etree.Element("robot", name=plan.stem)
    comment(root, "how MuJoCo reads this file: every link kept, nothing rounded or balanced")
    extension = child(root, "mujoco")
    child(extension, "compiler", fusestatic=False, balanceinertia=False, discardvisual=False, strippath=False)
    mimic = {plan.names.joint[finger, k.follower]: (finger, k) for finger, k in plan.linkages.values()}
    drives = nominal_drives(plan)
    for link in plan.links:
        _link(root, link)
        if link.joint is not None:
            joint = child(root, "joint", name=link.joint, type="revolute")
            child(joint, "parent", link=link.parent)
            child(joint, "child", link=link.name)
            child(joint, "origin", xyz=link.position_parent, rpy=(0, 0, 0))
            child(joint, "axis", xyz=link.axis)
            drive = drives.get(link.joint)
            effort = drive.force if drive is not None and drive.actuator else EFFORT
            child(joint, "limit", lower=link.range_rad[0], upper=link.range_rad[1], effort=effort, velocity=SPEED)
            if link.joint in mimic:
                finger, k = mimic[link.joint]
                source = plan.names.joint[finger, k.source]
                child(joint, "mimic", joint=source, multiplier=k.multiplier, offset=k.offset)
        for name, position in link.sites.items():
            child(root, "link", name=name)
            joint = child(root, "joint", name=f"{name}_fixed", type="fixed")
            child(joint, "parent", link=link.name)
            child(joint, "child", link=name)
            child(joint, "origin", xyz=position, rpy=(0, 0, 0))
    return root


def _link(root: Any, link: Link) -> None:
    element = child(root, "link", name=link.name)
    inertial = child(element, "inertial")
    child(inertial, "origin", xyz=link.inertia.centre, rpy=(0, 0, 0))
    child(inertial, "mass", value=link.inertia.mass)
    t = link.inertia.tensor
    child(inertial, "inertia", ixx=t[0, 0], ixy=t[0, 1], ixz=t[0, 2], iyy=t[1, 1], iyz=t[1, 2], izz=t[2, 2])
    visual = child(element, "visual")
    child(visual, "origin", xyz=(0, 0, 0), rpy=(0, 0, 0))
    child(child(visual, "geometry"), "mesh", filename=f"assets/{link.mesh}.stl")
    for i in range(len(link.parts)):
        _collision(element, np.zeros(3), np.zeros(3), "mesh", filename=f"assets/{link.mesh}_part_{i}.stl")
    for shape in () if link.parts else link.shapes:  # URDF has no capsule: a cylinder and two balls
        length = float(np.linalg.norm(shape.end - shape.start))
        if length > 1e-6:
            rpy = roll_pitch_yaw((shape.end - shape.start) / length)
            _collision(
                element,
                (shape.start + shape.end) / 2,
                rpy,
                "cylinder",
                radius=number(shape.radius),
                length=number(length),
            )
        for end in (shape.start, shape.end) if length > 1e-6 else (shape.start,):
            _collision(element, end, np.zeros(3), "sphere", radius=number(shape.radius))


def _collision(link: Any, position: np.ndarray, rpy: np.ndarray, shape: str, **size: str) -> None:
    collision = child(link, "collision")
    child(collision, "origin", xyz=position, rpy=rpy)
    child(child(collision, "geometry"), shape, **size)


def roll_pitch_yaw(direction: np.ndarray) -> np.ndarray:
    """URDF's fixed-axis angles (3,) [rad] of a frame whose z axis is the unit direction (3,)."""
    x, y = perpendicular_basis(direction)
    rotation = np.stack([x, y, direction], axis=1)
    pitch = np.arcsin(np.clip(-rotation[2, 0], -1, 1))
    if abs(rotation[2, 0]) > 1 - 1e-12:
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])
