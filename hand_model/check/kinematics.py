"""Hinges, digits and limits: the files against the hand that they were written from."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compile.coupling import limits as limits_of
from ..description import Description, Model
from ..engines.ours import Model as Ours
from ..engines.ours import load
from .finding import Finding
from .layout import tree

Array = NDArray[np.float64]

LAST_DIGIT = 1e-15  # m or unit-less: an ulp or two of the figures in a hand
UNIT = 1e-12


def _floats(text: str | None) -> Array:
    return np.array([float(v) for v in (text or "").split()])


def hinges(description: Description, model: Model) -> Finding:
    """Every hinge through its body's origin, angle zero at rest, axis of unit length, in both formats."""
    problems, worst = [], 0.0
    for joint in tree(model.mjcf).iter("joint"):
        if joint.getparent().tag != "body":
            continue
        name = joint.get("name")
        if _floats(joint.get("pos", "0 0 0")).any():
            problems.append(f'"{name}" has pos {joint.get("pos")}')
        if float(joint.get("ref", "0")) != 0:
            problems.append(f'"{name}" has ref {joint.get("ref")}')
        worst = max(worst, abs(float(np.linalg.norm(_floats(joint.get("axis", "0 0 1")))) - 1))
    for joint in tree(model.urdf).findall("joint"):
        if joint.get("type") == "revolute":
            worst = max(worst, abs(float(np.linalg.norm(_floats(joint.find("axis").get("xyz")))) - 1))
    if worst > UNIT:
        problems.append(f"an axis misses length one by {worst:.2g}")
    said = "; ".join(problems[:5]) or f"pos 0 0 0, ref 0, axes of length one to {worst:.1g}"
    return Finding(f"hinges: {model.stem}", not problems, worst, said)


def digits(description: Description, model: Model) -> Finding:
    """Axes, body origins, markers, tips and polynomials in the files equal those of hand.json to the last digit."""
    ours = load(model.mjcf)
    wanted = _exact(ours)
    worst, where = 0.0, ""
    for path, found in ((model.mjcf, _in_mjcf(tree(model.mjcf))), (model.urdf, _in_urdf(tree(model.urdf)))):
        for key, value in wanted.items():
            if key in found and len(found[key]) == len(value):
                gap = float(np.abs(found[key] - value).max())
                if gap > worst:
                    worst, where = gap, f'{key[0]} of "{key[1]}" in {path.name}'
    passed = worst <= LAST_DIGIT
    said = f"largest difference to hand.json {worst:.1g}" + ("" if passed else f": {where} was rounded or changed")
    return Finding(f"digits: {model.stem}", passed, worst, said)


def _exact(ours: Ours) -> dict[tuple[str, str], Array]:
    names, out = ours.names, {}
    out.update({("position", names.marker["", k]): np.asarray(p) for k, p in ours.hand.palm_markers_palm.items()})
    for finger in ours.hand.fingers:
        origin = np.zeros(3)
        for joint in finger.joints:
            key = (finger.name, joint.name)
            out["axis", names.joint[key]] = joint.axis_palm
            out["origin", names.link[key]] = joint.centre_palm - origin
            origin = joint.centre_palm
            out.update({("position", names.marker[finger.name, k]): p - origin for k, p in joint.markers_palm.items()})
            if joint.tip_palm is not None:
                out["position", names.tip[finger.name]] = joint.tip_palm - origin
            for extra, (joint_name, equality) in zip(
                joint.course.joints if joint.course else (), names.course.get(key, ()), strict=True
            ):
                padded = np.zeros(5)
                padded[: len(extra.coefficients)] = extra.coefficients
                out["axis", joint_name], out["polynomial", equality] = extra.axis_palm, padded
        for coupling in finger.couplings:
            padded = np.zeros(5)
            padded[: len(coupling.coefficients)] = coupling.coefficients
            out["polynomial", names.linkage[finger.name, coupling.follower]] = padded
    return out


def _in_mjcf(root: Any) -> dict[tuple[str, str], Array]:
    out = {("axis", e.get("name")): _floats(e.get("axis")) for e in root.iter("joint") if e.getparent().tag == "body"}
    out |= {("origin", e.get("name")): _floats(e.get("pos", "0 0 0")) for e in root.iter("body")}
    out |= {("position", e.get("name")): _floats(e.get("pos", "0 0 0")) for e in root.iter("site")}
    return out | {("polynomial", e.get("name")): _floats(e.get("polycoef")) for e in root.iterfind("equality/joint")}


def _in_urdf(root: Any) -> dict[tuple[str, str], Array]:
    out = {}
    for joint in root.findall("joint"):
        origin = _floats(joint.find("origin").get("xyz"))
        moving = joint.get("type") != "fixed"
        out["origin" if moving else "position", joint.find("child").get("link")] = origin
        if moving:
            out["axis", joint.get("name")] = _floats(joint.find("axis").get("xyz"))
    return out


def limits(description: Description, model: Model) -> Finding:
    """Limits are the recorded ranges (a follower's widened to what its polynomial reaches), the same in both
    formats."""
    ours = load(model.mjcf)
    mjcf = {
        e.get("name"): _floats(e.get("range")) for e in tree(model.mjcf).iter("joint") if e.getparent().tag == "body"
    }
    urdf = {}
    for joint in tree(model.urdf).findall("joint"):
        if joint.find("limit") is not None:
            urdf[joint.get("name")] = np.array([float(joint.find("limit").get(k)) for k in ("lower", "upper")])
    worst, problems = 0.0, []
    for finger in ours.hand.fingers:
        for segment, bounds in limits_of(finger).items():
            name = ours.names.joint[finger.name, segment]
            for path, table in ((model.mjcf, mjcf), (model.urdf, urdf)):
                if len(table.get(name, ())) != 2:
                    problems.append(f'"{name}" has no limits in {path.name}')
                    continue
                gap = float(np.degrees(np.abs(table[name] - bounds).max()))
                worst = max(worst, gap)
                if gap > 1e-9:
                    problems.append(f'"{name}" is off by {gap:.3g} deg in {path.name}')
    said = "; ".join(problems[:5]) or f"the same in both formats and as recorded, to {worst:.1g} deg"
    return Finding(f"limits: {model.stem}", not problems, worst, said)
