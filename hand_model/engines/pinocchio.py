"""Pinocchio: kinematics of a URDF or MJCF. Mimic is not left to it: every joint's angle is passed (it refuses chains of
mimics).

Its MJCF parser makes one composite joint of the joints of a body, under the first one's name, and drops the equalities:
names and ties (those of a course, between joints of one body) are read from the file beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DescriptionError
from .common import ROOT, columns, homogeneous, relative

Array = NDArray[np.float64]

COMPOSITE = "Composite_"  # what its parser puts before the name of a body's first joint, where there are several


@dataclass(frozen=True)
class Model:
    """A Pinocchio model. joints: those with one angle, and the parts of composite ones; address: their places in q.
    frames: name -> (parent joint id, placement (4, 4)); links: names of bodies, points: names of sites and of links
    without a joint of their own.
    courses: joint -> (driver, polycoef (5,)) of those that follow another one of their body."""

    pin: Any
    joints: tuple[str, ...]
    address: tuple[int, ...]
    frames: Mapping[str, tuple[int, Array]]
    links: tuple[str, ...]
    points: tuple[str, ...]
    courses: Mapping[str, tuple[str, Array]]


def load(file: str | Path) -> Model:
    """Load a URDF, or an MJCF as far as Pinocchio's parser goes; raises DescriptionError with its reason where that
    fails."""
    import pinocchio as pin

    path = Path(file)
    if not path.is_file():
        raise DescriptionError(f"{path}: no such file")
    build = pin.buildModelFromUrdf if path.suffix == ".urdf" else pin.buildModelFromMJCF
    try:
        model = build(str(path))
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"{path}: Pinocchio cannot load it ({error})") from None
    frames = {
        f.name: (int(f.parentJoint), np.array(f.placement.homogeneous))
        for f in model.frames
        if f.type != pin.FrameType.JOINT
    }
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    own = {f.name for f in bodies if np.array_equal(f.placement.homogeneous, np.eye(4)) and _first(bodies, f)}
    points = tuple(
        f.name for f in model.frames if f.type == pin.FrameType.OP_FRAME or (f in bodies and f.name not in own)
    )
    together, courses = ({}, {}) if path.suffix == ".urdf" else _of_one_body(path)
    address: dict[str, int] = {}
    for i, name in enumerate(model.names):
        parts = together.get(name.removeprefix(COMPOSITE), ()) if name.startswith(COMPOSITE) else (name,)
        if i and len(parts) == model.joints[i].nq:
            address |= {part: model.joints[i].idx_q + k for k, part in enumerate(parts)}
    return Model(model, tuple(address), tuple(address.values()), frames, tuple(f.name for f in bodies), points, courses)


def _of_one_body(path: Path) -> tuple[dict[str, tuple[str, ...]], dict[str, tuple[str, Array]]]:
    """First joint -> all joints of each body of an MJCF that has several, and the ties between them."""
    from lxml import etree

    root = etree.parse(str(path)).getroot()
    bodies = [tuple(j.get("name") or "" for j in body.findall("joint")) for body in root.iter("body")]
    together = {names[0]: names for names in bodies if len(names) > 1}
    body = {name: first for first, names in together.items() for name in names}
    ties = {}
    for e in root.iterfind("equality/joint"):
        one, two = e.get("joint1"), e.get("joint2")
        if one in body and body[one] == body.get(two):
            ties[one] = two, np.array([float(v) for v in (e.get("polycoef") or "0 1 0 0 0").split()])
    return together, ties


def _first(bodies: list[Any], frame: Any) -> bool:
    """Whether a body is the one that its joint carries, and not one fixed to it."""
    return next(b.name for b in bodies if b.parentJoint == frame.parentJoint) == frame.name


def positions(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Positions (n, 3) [m] of sites and of links on fixed joints; joint_angles: joint -> (n,) [rad]."""
    carried = _joint_poses(model, _coordinates(model, joint_angles))
    return relative(_frames(model, carried, [name for name in model.links if name == ROOT]), _points(model, carried))[1]


def poses(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Link poses (n, 4, 4); joint_angles: joint -> (n,) [rad]."""
    return kinematics(model, joint_angles)[0]


def kinematics(model: Model, joint_angles: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Link poses (n, 4, 4) and positions (n, 3) [m]; joint_angles: joint -> (n,) [rad]."""
    carried = _joint_poses(model, _coordinates(model, joint_angles))
    return relative(_frames(model, carried, model.links), _points(model, carried))


def _coordinates(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Array:
    """Coordinates (n, joints) [rad or m], those of courses where their driver wants them."""
    out = columns(model.joints, joint_angles)
    for joint, (driver, coefficients) in model.courses.items():
        if joint not in joint_angles:
            along = out[:, model.joints.index(driver)]
            out[:, model.joints.index(joint)] = np.polynomial.polynomial.polyval(along, coefficients)
    return out


def _frames(model: Model, carried: list[Array], names: Iterable[str]) -> dict[str, Array]:
    return {name: carried[model.frames[name][0]] @ model.frames[name][1] for name in names}


def _points(model: Model, carried: list[Array]) -> dict[str, Array]:
    points = {}
    for name in model.points:
        parent, placement = model.frames[name]
        points[name] = carried[parent][:, :3, :3] @ placement[:3, 3] + carried[parent][:, :3, 3]
    return points


def _joint_poses(model: Model, angles: Array) -> list[Array]:
    """Pose (n, 4, 4) of every joint of the model, the universe first."""
    import pinocchio as pin

    data = model.pin.createData()
    address = list(model.address)
    neutral = pin.neutral(model.pin)
    n, count = len(angles), len(model.pin.names)
    rotation, translation = np.empty((count, n, 3, 3)), np.empty((count, n, 3))
    for k in range(n):
        q = neutral.copy()
        q[address] = angles[k]
        pin.forwardKinematics(model.pin, data, q)
        for i in range(count):
            placement = data.oMi[i]
            rotation[i, k], translation[i, k] = placement.rotation, placement.translation
    return [homogeneous(rotation[i], translation[i]) for i in range(count)]
