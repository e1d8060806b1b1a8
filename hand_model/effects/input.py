"""An input joint in a compiled MJCF: what an equality's driver becomes before the equality's polynomial takes it.

Lost motion, a dead band and a stop are changes of the driver: follower = map(input), with the input tied to the driver
by tendons with a one- or two-sided range. The input is a joint without mass worth mentioning, on a body of its own on
the palm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from .mjcf import fixed_tendon, free_name, motor_joint

# friction that keeps a loose part where it is, at the driver [N m per its unit]; the weight of a finger may move it
HOLD = 2e-4
INERTIA = 1e-7  # of an input joint, that of a compiled lever
YIELD_RATE = 150.0  # rad/s: of a follower on the spring that lets a stop hold it back, as of a finger on its actuator
# rad/s: of a finger on its lever then; what is tied to it by springs or rubs would lift it off otherwise
FIRM_RATE = 400.0
STRETCHED = 1e-3  # rad: by what rubs in a play, a spring that holds an input may be stretched
HARD = {"solreflimit": (0.002, 1.0), "solimplimit": (0.9999, 0.9999, 0.001, 0.5, 2.0)}
FRICTION = {"solreffriction": "0.004 1", "solimpfriction": "0.9999 0.9999 0.001 0.5 2"}
LEAST_SLOPE = 1e-3  # of a map, in its units
SHARP = np.deg2rad(0.1)  # a corner of a bound no wider is none
ROUNDING = (0.03, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # of a corner, above its bound: where springs begin to round it off
SUFFIX = "_input"
MAPPED = "_mapped"  # of a joint that a map moves, behind which something is lost


def map_of(root: Any, where: Mapping[str, Any], station: str) -> Any:
    """The joint equality that maps a driver to the place's follower: of the lever ("encoder") or of a joint
    ("linkage"); None where the file has none."""
    if station == "encoder":
        found = motor_joint(root, where)
        wanted = None if found is None else (lambda e: source(root, e.get("joint2")) == found[0].get("name"))
    else:
        follower = f"{where.get('finger')}_{where.get('joint')}"
        wanted = lambda e: e.get("joint1") == follower
    return None if wanted is None else next((e for e in root.iterfind("equality/joint") if wanted(e)), None)


def source(root: Any, joint: str) -> str:
    """The joint behind a chain of inputs and maps."""
    joint = _behind_inputs(root, joint)
    if MAPPED not in joint:
        return joint
    return source(root, next(e for e in root.iterfind("equality/joint") if e.get("joint1") == joint).get("joint2"))


def _behind_inputs(root: Any, joint: str) -> str:
    """The joint that a chain of inputs follows: one that a map moves, or the driver itself."""
    while SUFFIX in joint:
        joint = _tie(root, joint).find("joint").get("joint")
    return joint


def _tie(root: Any, joint: str) -> Any:
    """The tendon by which an input follows what is ahead of it."""
    return next(t for t in root.iterfind("tendon/fixed") if t.findall("joint")[-1].get("joint") == joint)


def _put_between(root: Any, equality: Any) -> tuple[str, str]:
    """Put an input joint between an equality and its driver; names of driver and input."""
    driver = equality.get("joint2")
    _hold_firmly(root, equality.get("joint1"), source(root, driver))
    name = _loose_joint(root, f"{equality.get('name')}{SUFFIX}")
    equality.set("joint2", name)
    return driver, name


def _map_ahead(root: Any, equality: Any) -> None:
    """Let an equality's map move a joint of its own, which the follower follows at its size: what is put between them is
    behind the map."""
    name = _loose_joint(root, f"{equality.get('name')}{MAPPED}")
    ahead = deepcopy(equality)
    ahead.set("name", free_name(root, f"{equality.get('name')}_map"))
    ahead.set("joint1", name)
    equality.addprevious(ahead)
    equality.set("joint2", name)
    equality.set("polycoef", "0 1 0 0 0")


def _loose_joint(root: Any, name: str) -> str:
    """A joint without mass worth mentioning on the palm; its name."""
    from lxml import etree

    name = free_name(root, name)
    palm = root.find("worldbody").find("body")
    body = etree.SubElement(palm, "body", name=free_name(root, f"{name}_link"))
    etree.SubElement(body, "inertial", pos="0 0 0", mass="1e-9", diaginertia="1e-9 1e-9 1e-9")
    etree.SubElement(
        body,
        "joint",
        name=name,
        type="hinge",
        pos="0 0 0",
        axis="0 0 1",
        ref="0",
        limited="false",
        armature=repr(INERTIA),
    )
    return name


def _hold_firmly(root: Any, follower: str, driver: str) -> None:
    """Make the spring that holds a finger on its lever as fast as `FIRM_RATE`, where a tendon has one at either joint;
    a lever that is to follow a play as heavy as its finger, or the gap's ends would be too soft for both."""
    for tendon in root.iterfind("tendon/fixed"):
        finger, *lever = (j.get("joint") for j in tendon.findall("joint"))
        if not tendon.get("name", "").endswith("_push") or not {follower, driver} & {finger, *lever}:
            continue
        if follower in lever:
            next(j for j in root.find("worldbody").iter("joint") if j.get("name") == follower).set(
                "armature", repr(float(tendon.get("stiffness")) / _rate(tendon) ** 2)
            )
        _make_firm(tendon)


def _rate(tendon: Any) -> float:
    """[rad/s] of what hangs on a critically damped spring."""
    return 2 * float(tendon.get("stiffness")) / float(tendon.get("damping"))


def _make_firm(tendon: Any) -> None:
    """Make a critically damped spring as fast as `FIRM_RATE` at least."""
    more = max(FIRM_RATE / _rate(tendon), 1.0)
    tendon.set("stiffness", repr(float(tendon.get("stiffness")) * more**2))
    tendon.set("damping", repr(float(tendon.get("damping")) * more))


def write_play(root: Any, equality: Any, gap: float, behind: bool = False) -> str:
    """The input lags by half the `gap` [driver's unit] and stays while the driver crosses it; path of the tendon.
    behind: the follower does so behind its map, by half the `gap` [its unit]."""
    ahead = equality.get("joint2")
    tie = _tie(root, ahead).get("stiffness") if SUFFIX in ahead else None
    hold = HOLD if tie is None else min(HOLD, STRETCHED * float(tie))
    if behind:
        hold /= _slope(root, equality)  # the same at the driver
        _map_ahead(root, equality)
    driver, name = _put_between(root, equality)
    joint = next(j for j in root.find("worldbody").iter("joint") if j.get("name") == name)
    joint.set("frictionloss", repr(hold))
    for key, value in FRICTION.items():
        joint.set(key, value)
    return _limit(root, f"{name}_gap", {driver: 1.0, name: -1.0}, -0.5 * gap, 0.5 * gap)


def write_bound(root: Any, equality: Any, side: int, at: float, passing: float = 0.0, corner: float = 0.0) -> str:
    """The input follows the driver up to `at` (side 1) or down to it (side -1), and a share `passing` of the motion
    beyond;
    a spring holds it on the driver elsewhere. corner: over which a lower bound is rounded (`CouplingDeadband`). `at` and
    `corner` in the driver's unit. Path of the tendon that bounds it."""
    inertia = _inertia(root, equality)
    driver, name = _put_between(root, equality)
    next(j for j in root.find("worldbody").iter("joint") if j.get("name") == name).set("armature", repr(inertia))
    spring = {"stiffness": inertia * YIELD_RATE**2, "damping": 2 * inertia * YIELD_RATE, "springlength": 0.0}
    ends = (0.0, 1e6) if side > 0 else (-1e6, 0.0)  # driver - input: the input is never beyond the driver
    _limit(root, f"{name}_follow", {driver: 1.0, name: -1.0}, *ends, **spring)
    if corner > SHARP:
        at = _round_off(root, name, at, corner, spring["stiffness"])
    bound = (1 - passing) * at
    ends = (-1e6, bound) if side > 0 else (bound, 1e6)
    return _limit(root, f"{name}_stop", {driver: -passing, name: 1.0}, *ends)


def _round_off(root: Any, name: str, at: float, corner: float, stiffness: float) -> float:
    """Springs that push an input, which one of that stiffness holds on its driver, off a lower bound `at` one after the
    other, so that it follows the driver by s ln(1 + exp((q - at) / s)), s the corner: pieces of its inverse, straight
    between `ROUNDING`. Where the hard bound is then."""
    input_ = np.array(ROUNDING)
    slope = np.r_[np.diff(np.log(np.expm1(input_))) / np.diff(input_), 1.0]  # of the driver over the input
    for until, firmer in zip(input_[1:], slope[:-1] - slope[1:], strict=True):
        spring = {"stiffness": stiffness * firmer, "springlength": (at + corner * until, 1e6)}
        fixed_tendon(root, free_name(root, f"{name}_round"), {name: 1.0}, **spring)
    return float(at + corner * input_[0])


def _limit(root: Any, name: str, coefficients: Mapping[str, float], low: float, high: float, **more: Any) -> str:
    place = fixed_tendon(root, free_name(root, name), coefficients, range=(low, high), **HARD, **more)
    root.find("tendon")[-1].set("limited", "true")
    return place


def _inertia(root: Any, equality: Any) -> float:
    """Nominal inertia of an equality's follower, at its driver [kg m^2]."""
    joint = next(j for j in root.find("worldbody").iter("joint") if j.get("name") == equality.get("joint1"))
    inertial = joint.getparent().find("inertial")
    position = np.array([float(x) for x in inertial.get("pos").split()])
    return (float(inertial.get("mass")) * float(position @ position) + 1e-6) * _slope(root, equality) ** 2


def _slope(root: Any, equality: Any) -> float:
    """How fast an equality's follower goes with its driver at most, over the range of what is ahead of it."""
    driver = _behind_inputs(root, equality.get("joint2"))
    joint = next(j for j in root.find("worldbody").iter("joint") if j.get("name") == driver)
    low, high = (float(x) for x in joint.get("range", "0 0").split())
    return max(steepest([float(x) for x in equality.get("polycoef").split()], low, high), LEAST_SLOPE)


def steepest(coefficients: Sequence[float], low: float, high: float) -> float:
    """The largest slope of a map (its coefficients, constant first) from one place of its driver to another."""
    slope = np.polynomial.Polynomial(coefficients).deriv()
    return float(np.abs(slope(np.linspace(low, high, 50))).max())


def settle(root: Any, pose: dict[str, float]) -> None:
    """Put every input joint of `pose` (joint -> coordinate, changed in place) within its tendons, near its driver, and
    every follower on its map."""
    tendons = [
        (
            float(t.get("range").split()[0]),
            float(t.get("range").split()[1]),
            {j.get("joint"): float(j.get("coef")) for j in t.findall("joint")},
        )
        for t in root.iterfind("tendon/fixed")
        if t.get("range")
    ]
    for equality in root.iterfind("equality/joint"):
        driver, follower = equality.get("joint2"), equality.get("joint1")
        if driver not in pose:
            continue
        if SUFFIX in driver:
            low, high = -np.inf, np.inf
            for a, b, joints in tendons:
                if driver in joints:
                    rest = sum(c * pose[j] for j, c in joints.items() if j != driver)
                    ends = sorted(((a - rest) / joints[driver], (b - rest) / joints[driver]))
                    low, high = max(low, ends[0]), min(high, ends[1])
            pose[driver] = float(np.clip(pose[_behind_inputs(root, driver)], low, high))
        if SUFFIX in driver or MAPPED in follower:
            coefficients = [float(x) for x in equality.get("polycoef").split()]
            pose[follower] = float(np.polynomial.polynomial.polyval(pose[driver], coefficients))
