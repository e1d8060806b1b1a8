"""Names in a compiled file: sanitised, and unique across kinds, since some loaders trip on a name that two kinds
share."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field

from ..hand import Hand

WORDS = {"hinge": "wobble", "slide": "travel"}  # what a segment's extra joints do


@dataclass(frozen=True)
class Names:
    """What everything of one file is called.

    joint, link: (finger, joint) -> name. marker: (finger, label) -> site, finger "" for the palm. tip, collision:
    finger -> name. linkage: (finger, follower joint) -> equality. actuator: finger -> name, for fingers that have one.
    course: (finger, joint) -> (joint, equality) of each of its extra joints, for joints that are no plain hinges.
    """

    joint: Mapping[tuple[str, str], str]
    link: Mapping[tuple[str, str], str]
    marker: Mapping[tuple[str, str], str]
    tip: Mapping[str, str]
    linkage: Mapping[tuple[str, str], str]
    actuator: Mapping[str, str]
    course: Mapping[tuple[str, str], tuple[tuple[str, str], ...]] = field(default_factory=dict)


def sanitised(name: str) -> str:
    """Letters, digits and underscores of a name, starting with a letter: what URDF, xacro, ROS and MJCF all accept."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", plain).strip("_") or "unnamed"
    return plain if plain[0].isalpha() else f"n{plain}"


def named(hand: Hand) -> Names:
    """Names of one file's hand (its fingers must be those of the file); the same hand gives the same names."""
    taken = {"palm", "attachment", "floor", "open", "close"}

    def claim(name: str) -> str:
        free, count = name, 2
        while free in taken:
            free, count = f"{name}_{count}", count + 1
        taken.add(free)
        return free

    keys = [(f.name, j.name) for f in hand.fingers for j in f.joints]
    actuator: dict[str, str] = {}
    for finger in hand.fingers:
        if finger.actuator is not None:
            shared = any(f.actuator == finger.actuator and f.name in actuator for f in hand.fingers)
            wanted = f"{finger.actuator}_{finger.name}" if shared else finger.actuator
            actuator[finger.name] = claim(sanitised(wanted))
    joint = {key: claim(sanitised("_".join(key))) for key in keys}
    link = {key: claim(f"{joint[key]}_link") for key in keys}
    tip = {f.name: claim(f"{sanitised(f.name)}_tip") for f in hand.fingers}
    linkage = {}
    for finger in hand.fingers:
        for coupling in finger.couplings:
            linkage[finger.name, coupling.follower] = claim(f"{sanitised(finger.name)}_linkage")
    labels = [("", label) for label in hand.palm_markers_palm]
    labels += [(f.name, label) for f in hand.fingers for j in f.joints for label in j.markers_palm]
    marker = {key: claim("marker_" + label_part(key[1])) for key in labels}
    course: dict[tuple[str, str], tuple[tuple[str, str], ...]] = {}
    for finger in hand.fingers:
        for own in (j for j in finger.joints if j.course is not None):
            key = (finger.name, own.name)
            extra = [claim(f"{joint[key]}_{WORDS.get(e.kind, e.kind)}") for e in own.course.joints]
            course[key] = tuple((name, claim(f"{name}_course")) for name in extra)
    return Names(joint, link, marker, tip, linkage, actuator, course)


def label_part(label: str) -> str:
    """A marker label as it stands behind `marker_`: sanitised, but free to start with a digit."""
    return sanitised(f"m_{label}")[2:] or "unnamed"
