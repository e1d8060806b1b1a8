"""Extra joints of a segment whose joint is no plain hinge: tied to its angle by MJCF joint equalities, five
coefficients each.

They stand in the segment's own body, before its hinge where their axes stay with the segment before, after it where
they turn with it.
URDF has no such tie (its mimic is linear, and the linear part of a course is mostly the hinge's own): its joints are
the plain hinges.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..course import ranges, value
from ..errors import HandFileError
from ..hand import Finger, Hand, Joint
from ..kinematics import displace, finger_angles
from .coupling import ORDER, SAMPLES, limits, source_of
from .names import WORDS, Names
from .xml import child, document, number, vector

Array = NDArray[np.float64]

# of an extra joint's reach, beyond it on both sides: its limits hold nothing back while it is on its course
ROOM = 0.05
MASS = 0.1  # kg of a slide beside what it carries: what holds a few grams at this step gives too much
TIME_S = 0.003  # time constant of a slide's tie: stable at steps of two milliseconds, too
MARGIN = 2.0  # by which the tie is left softer than that, for inertias that the pose or a user changes
LEAST = {"hinge": 1e-4, "slide": 1e-6}  # the same at least [rad, m]


@dataclass(frozen=True)
class Tied:
    """One extra joint of a link. name, equality: in the file. kind: "hinge" or "slide". axis: (3,) unit. polynomial:
    (5,) of its coordinate [rad or m] over powers of the hinge's angle [rad]. range: (low, high)."""

    name: str
    equality: str
    kind: str
    axis: Array
    polynomial: Array
    range: tuple[float, float]


def checked_course(finger: Finger, joint: Joint) -> None:
    """Raise HandFileError for a course that no file can hold."""
    where = f'finger "{finger.name}", joint "{joint.name}"'
    for extra in joint.course.joints if joint.course is not None else ():
        axis, coefficients = np.asarray(extra.axis_palm, float), np.asarray(extra.coefficients, float)
        if extra.kind not in WORDS:
            raise HandFileError(
                f'{where}: an extra joint of its course is a "{extra.kind}"; "hinge" or "slide" is needed'
            )
        if axis.shape != (3,) or not abs(float(np.linalg.norm(axis)) - 1) < 1e-9:
            raise HandFileError(f"{where}: an extra joint of its course needs an axis (3,) of length one")
        if not (2 <= len(coefficients) <= ORDER + 1 and np.isfinite(coefficients).all() and coefficients[0] == 0):
            raise HandFileError(
                f"{where}: an extra joint of its course needs two to five finite coefficients, the first zero"
            )


def tied(finger: Finger, joint: Joint, names: Names) -> tuple[Tied, ...]:
    """The extra joints of a checked joint, under their names."""
    if joint.course is None:
        return ()
    out = []
    for extra, (low, high), (name, equality) in zip(
        joint.course.joints,
        ranges(joint.course, *limits(finger)[joint.name]),
        names.course[finger.name, joint.name],
        strict=True,
    ):
        polynomial = np.zeros(ORDER + 1)
        polynomial[: len(extra.coefficients)] = extra.coefficients
        room = max(ROOM * (high - low), LEAST[extra.kind])
        out.append(
            Tied(name, equality, extra.kind, np.asarray(extra.axis_palm, float), polynomial, (low - room, high + room))
        )
    return tuple(out)


def write_joints(body: Any, extras: tuple[Tied, ...]) -> None:
    """The extra joints' elements of a segment's body, where they are due."""
    for extra in extras:
        joint = child(
            body, "joint", name=extra.name, type=extra.kind, pos=(0, 0, 0), axis=extra.axis, range=extra.range, ref="0"
        )
        if extra.kind == "slide":
            joint.set("armature", number(MASS))


def stiffen(root: Any, ties: dict[str, tuple[Tied, ...]]) -> None:
    """Make the ties of slides as stiff as those of hinges. ties: hinge -> its extra joints.

    MuJoCo scales a constraint's softness by the sum of the inverse inertias of both joints, here of a light hinge
    [1/(kg m^2)] and of a slide [1/kg], so that a slide gives a thousand times more than its share; stiffness and
    damping are raised by as much (MuJoCo's "Solver parameters").
    """
    import mujoco

    if not any(e.kind == "slide" for extras in ties.values() for e in extras):
        return
    bare = copy.deepcopy(root)
    for tag in ("asset", "contact", "keyframe", "sensor", "actuator", "tendon", "equality"):
        for element in bare.findall(tag):
            bare.remove(element)
    for geom in list(bare.find("worldbody").iter("geom")):
        geom.getparent().remove(geom)
    model = mujoco.MjModel.from_xml_string(document(bare).decode())
    weight = {
        name: float(model.dof_invweight0[model.joint(name).dofadr[0]])
        for name in (model.joint(i).name for i in range(model.njnt))
    }
    for hinge, extras in ties.items():
        for extra in (e for e in extras if e.kind == "slide"):
            equality = next(e for e in root.iterfind("equality/joint") if e.get("name") == extra.equality)
            impedance = float(equality.get("solimp").split()[1])
            softer = (
                1 + (1 - impedance) / impedance * (weight[hinge] + weight[extra.name]) / weight[extra.name] / MARGIN
            )
            equality.set("solref", vector((-softer / (impedance * TIME_S) ** 2, -2 * softer / (impedance * TIME_S))))


def complete_courses(root: Any, ties: dict[str, tuple[Tied, ...]]) -> None:
    """Put the extra joints of every keyframe where their hinge's angle wants them. ties: hinge -> its extra joints."""
    joints = [j.get("name") for j in root.find("worldbody").iter("joint")]
    for key in root.iterfind("keyframe/key"):
        pose = dict(zip(joints, map(float, (key.get("qpos") or "").split()), strict=True))
        for hinge, extras in ties.items():
            pose |= {e.name: float(np.polynomial.polynomial.polyval(pose[hinge], e.polynomial)) for e in extras}
        key.set("qpos", vector([pose[name] for name in joints]))


def lost_in_urdf(finger: Finger, joint: Joint) -> tuple[float, float]:
    """Largest tilt [rad] and shift of the fingertip [m], over the recorded range, that a URDF with the plain hinge
    leaves out."""
    source = source_of(finger, joint.name)
    angles = finger_angles(finger, {source: np.linspace(*limits(finger)[source], SAMPLES)})
    own = angles[:, [j.name for j in finger.joints].index(joint.name)]
    hinges = [value(e, own) for e in joint.course.joints if e.kind == "hinge"]
    tilt = float(np.sqrt(sum(h**2 for h in hinges)).max()) if hinges else 0.0
    plain = replace(finger, joints=tuple(replace(j, course=None) if j.name == joint.name else j for j in finger.joints))
    last = len(finger.joints) - 1
    tips = [displace(f, angles).points(last, finger.joints[last].tip_palm)[:, 0] for f in (finger, plain)]
    return tilt, float(np.linalg.norm(tips[0] - tips[1], axis=-1).max())


def with_courses(hand: Hand) -> list[tuple[Finger, Joint]]:
    """Every joint of a hand that has a course, with its finger."""
    return [(f, j) for f in hand.fingers for j in f.joints if j.course is not None]


def without_courses(hand: Hand) -> Hand:
    """The hand as URDF holds it: plain hinges."""
    return replace(
        hand, fingers=tuple(replace(f, joints=tuple(replace(j, course=None) for j in f.joints)) for f in hand.fingers)
    )
