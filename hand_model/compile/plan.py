"""What both formats are written from: links, joints, linkages, shapes, inertias and keyframes of one file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import HandFileError
from ..hand import Hand
from ..kinematics import unit
from .clearance import PALM, Key, cleared
from .coupling import Linkage, checked, limits, linkages
from .course import Tied, checked_course, tied
from .names import Names, named, sanitised
from .posture import finger_posture, grips_of, known_grip_fingers, posture
from .shape import Capsule, Inertia, capsule_inertia, combined, finger_capsules, palm_capsules, with_tips
from .surface import Surface, mesh_inertia, surfaces

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Link:
    """One body and the joint that carries it, in its own frame: palm axes at rest, origin at the joint's centre.

    name: body. finger, segment: where it comes from ("" and "palm" for the palm). parent: body, None for the palm.
    position_parent, axis: (3,) [m], [-]. range_rad: (low, high). solid: nominal shape, which the
    inertia and the visual mesh (file stem `mesh`) come from; shapes: what collides. sites: name -> (3,) [m].
    surface: the probed surface that takes the nominal shape's place as visual, and as origin of the inertia if
    watertight.
    parts: its convex parts, which collide in place of `shapes`. extras: joints beside its hinge, turning with it or
    standing before it.
    """

    name: str
    finger: str
    segment: str
    parent: str | None
    joint: str | None
    position_parent: Array
    axis: Array
    range_rad: tuple[float, float]
    solid: tuple[Capsule, ...]
    shapes: tuple[Capsule, ...]
    inertia: Inertia
    sites: Mapping[str, Array]
    mesh: str
    surface: Surface | None = None
    parts: tuple[Surface, ...] = ()
    extras: tuple[Tied, ...] = ()
    turning: bool = False


@dataclass(frozen=True)
class Plan:
    """One file to be: the hand that it holds, and everything that MJCF and URDF share.

    stem: file name without ending; suffix: what tells it from the plain variant. linkages: equality name -> (finger,
    Linkage). keyframes: name -> {joint: angle [rad]}.
    reached: keyframe -> {finger: fraction closed}. excludes: (body, body, reason). guessed_tips: finger -> how.
    contact_notes: where probed parts could not serve for contact.
    """

    stem: str
    suffix: str
    hand: Hand
    names: Names
    links: tuple[Link, ...]
    linkages: Mapping[str, tuple[str, Linkage]]
    keyframes: Mapping[str, Mapping[str, float]]
    reached: Mapping[str, Mapping[str, float]]
    excludes: tuple[tuple[str, str, str], ...]
    guessed_tips: Mapping[str, str]
    contact_notes: tuple[str, ...] = ()

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(sum(link.inertia.mass for link in self.links))

    @property
    def reach(self) -> float:
        """Distance [m] of the furthest site from the palm frame's origin, open."""
        return max([0.02, *(float(np.linalg.norm(self.origin(k) + p)) for k in self.links for p in k.sites.values())])

    def origin(self, link: Link) -> Array:
        """Origin (3,) [m] of a link's frame in the palm frame, at rest."""
        position, by_name = np.zeros(3), {k.name: k for k in self.links}
        while link.parent is not None:
            position, link = position + link.position_parent, by_name[link.parent]
        return position


def variants(hand: Hand) -> dict[tuple[str, str], Hand]:
    """(stem, suffix) -> hand of each file: never two positions of one thumb in a file.

    Fingers `thumb_0`, `thumb_1`, ... are positions of one thumb; the first gets the plain stem `<name>_<side>`.
    """
    stem = f"{sanitised(hand.name)}_{sanitised(hand.side)}"
    thumbs = [f.name for f in hand.fingers if re.fullmatch(r"thumb_\d+", f.name)]
    if len(thumbs) < 2:
        return {(stem, ""): hand}
    out = {}
    for i, thumb in enumerate(thumbs):
        kept = tuple(f for f in hand.fingers if f.name not in thumbs or f.name == thumb)
        suffix = "" if i == 0 else f"_{thumb}"
        out[stem + suffix, suffix] = replace(hand, fingers=kept)
    return out


def complete(hand: Hand) -> tuple[Hand, Mapping[str, str]]:
    """The hand ready to compile: checked, axes at unit length, a tip on every finger; and the guessed tips.

    Raises HandFileError where it has no finger, a finger without joints, twice the same name, or figures that are not
    finite.
    """
    if not hand.fingers:
        raise HandFileError(f'hand "{hand.name}" has no finger; at least one with one joint is needed')
    names = [f.name for f in hand.fingers]
    if len(set(names)) < len(names):
        raise HandFileError(f'hand "{hand.name}" has two fingers of one name ({", ".join(names)})')
    known_grip_fingers(hand)
    fingers = []
    for finger in hand.fingers:
        segments = [j.name for j in finger.joints]
        if not segments or len(set(segments)) < len(segments):
            raise HandFileError(
                f'finger "{finger.name}" needs joints of different names; it has ({", ".join(segments) or "none"})'
            )
        for joint in finger.joints:
            figures = [joint.axis_palm, joint.centre_palm, joint.range_rad, *joint.markers_palm.values()]
            if not all(np.isfinite(np.asarray(v, float)).all() for v in figures):
                raise HandFileError(
                    f'finger "{finger.name}", joint "{joint.name}": axis, centre, range or a marker is not finite'
                )
            checked_course(finger, joint)
        joints = tuple(replace(j, axis_palm=unit(j.axis_palm)) for j in finger.joints)
        fingers.append(checked(replace(finger, joints=joints)))
    return with_tips(replace(hand, fingers=tuple(fingers)))


def planned(stem: str, suffix: str, hand: Hand, guessed_tips: Mapping[str, str]) -> Plan:
    """Lay out one file from a complete hand."""
    names = named(hand)
    shapes: dict[Key, tuple[Capsule, ...]] = {PALM: palm_capsules(hand)}
    for finger in hand.fingers:
        for joint, capsule in zip(finger.joints, finger_capsules(hand, finger), strict=True):
            shapes[finger.name, joint.name] = (capsule,)
    fist = {
        (f.name, j): a
        for f in hand.fingers
        if not f.name.startswith("thumb")
        for j, a in finger_posture(f, 1.0).items()
    }
    fitted, fitted_excluded = cleared(hand, shapes, {"close": fist})  # fingers side by side, before any grip
    postures, reached = {}, {}
    for name, fractions in grips_of(hand).items():
        postures[sanitised(name)], reached[sanitised(name)] = posture(hand, fractions, fitted, fitted_excluded)
    shrunk, excluded = cleared(hand, fitted, postures, fitted_excluded)
    links = [_palm(hand, names, shapes[PALM], shrunk[PALM], f"palm{suffix}")]
    for finger in hand.fingers:
        links += _finger_links(hand, finger.name, names, shapes, shrunk)
    links = _with_surfaces(hand, links)
    body = {PALM: "palm", **names.link}
    return Plan(
        stem,
        suffix,
        hand,
        names,
        tuple(links),
        {names.linkage[f.name, k.follower]: (f.name, k) for f in hand.fingers for k in linkages(f)},
        {pose: {names.joint[key]: angle for key, angle in angles.items()} for pose, angles in postures.items()},
        reached,
        tuple((*(body[key] for key in body if key in pair), reason) for pair, reason in excluded.items()),
        {f: how for f, how in guessed_tips.items() if f in names.tip},
    )


def _with_surfaces(hand: Hand, links: list[Link]) -> list[Link]:
    probed, out = surfaces(hand), []
    for link in links:
        found = probed.get((link.finger, link.segment))
        if found is not None:
            joints = [j for f in hand.fingers if f.name == link.finger for j in f.joints if j.name == link.segment]
            own = found.shifted(joints[0].centre_palm if joints else np.zeros(3))
            inertia = mesh_inertia(own) if own.watertight else link.inertia
            link = replace(link, surface=own, inertia=inertia, parts=own.parts)
        out.append(link)
    return out


def in_file_names(plan: Plan) -> Hand:
    """The plan's hand under the names that its file uses: `<finger>_<joint>` is the joint's name there, actuators are
    sanitised."""
    fingers, actuators = [], {}
    for finger in plan.hand.fingers:
        prefix = sanitised(finger.name)
        renamed = {j.name: plan.names.joint[finger.name, j.name].removeprefix(f"{prefix}_") for j in finger.joints}
        joints = tuple(replace(j, name=renamed[j.name]) for j in finger.joints)
        couplings = tuple(replace(c, driver=renamed[c.driver], follower=renamed[c.follower]) for c in finger.couplings)
        actuator = plan.names.actuator.get(finger.name)
        actuators.setdefault(finger.actuator, actuator)
        fingers.append(replace(finger, name=prefix, actuator=actuator, joints=joints, couplings=couplings))
    motors = tuple(replace(m, actuator=actuators.get(m.actuator) or sanitised(m.actuator)) for m in plan.hand.motors)
    return replace(plan.hand, fingers=tuple(fingers), motors=motors)


def _palm(hand: Hand, names: Names, solid: tuple[Capsule, ...], shapes: tuple[Capsule, ...], mesh: str) -> Link:
    sites = {names.marker["", label]: np.asarray(p, float) for label, p in hand.palm_markers_palm.items()}
    sites["attachment"] = np.zeros(3)
    inertia = combined(tuple(capsule_inertia(c) for c in solid))
    return Link(
        "palm", "", "palm", None, None, np.zeros(3), np.zeros(3), (0.0, 0.0), solid, shapes, inertia, sites, mesh
    )


def _finger_links(
    hand: Hand,
    name: str,
    names: Names,
    solid: Mapping[Key, tuple[Capsule, ...]],
    shapes: Mapping[Key, tuple[Capsule, ...]],
) -> list[Link]:
    finger = hand.finger(name)
    bounds, links = limits(finger), []
    parent, origin = "palm", np.zeros(3)
    for joint in finger.joints:
        key, centre = (name, joint.name), np.asarray(joint.centre_palm, float)
        sites = {names.marker[name, label]: np.asarray(p, float) - centre for label, p in joint.markers_palm.items()}
        if joint.tip_palm is not None:
            sites[names.tip[name]] = np.asarray(joint.tip_palm, float) - centre
        full, local = (
            tuple(Capsule(c.start - centre, c.end - centre, c.radius) for c in s[key]) for s in (solid, shapes)
        )
        inertia = combined(tuple(capsule_inertia(c) for c in full))
        position, axis, link = centre - origin, np.asarray(joint.axis_palm, float), names.link[key]
        where = (link, name, joint.name, parent, names.joint[key], position, axis, bounds[joint.name])
        turning = joint.course is not None and joint.course.turning
        links.append(
            Link(*where, full, local, inertia, sites, link, extras=tied(finger, joint, names), turning=turning)
        )
        parent, origin = link, centre
    return links
