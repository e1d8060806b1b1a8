"""Changes to the kinematics of a URDF or an MJCF that leave everything else in the file as it is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import DescriptionError
from ..output import new_file
from .tree import Array, Tree, inverse
from .urdf import parse_xml


def text(values: Sequence[float]) -> str:
    """Numbers with all their digits."""
    return " ".join(repr(float(v) + 0.0) for v in values)


def rpy(rotation: Array) -> Array:
    """Roll, pitch, yaw [rad] of a rotation (3, 3), also where the pitch is a right angle."""
    flat = np.hypot(rotation[0, 0], rotation[1, 0])
    pitch = np.arctan2(-rotation[2, 0], flat)
    if flat < 1e-9:
        return np.array([0.0, pitch, np.arctan2(-rotation[0, 1], rotation[1, 1])])
    return np.array([np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def quaternion(rotation: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation (3, 3): the largest component first (Shepperd 1978)."""
    r = rotation
    table = np.array(
        [
            [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
        ]
    )
    best = table[np.argmax(np.diag(table))]
    return best / np.linalg.norm(best) * (1 if best[0] >= 0 else -1)


class UrdfEditor:
    """A URDF under change. Every value is in the file's own units [m, rad]."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.document = parse_xml(tree.path)
        root = self.document.getroot()
        self.joints = {j.get("name"): j for j in root.findall("joint")}
        self.by_child = {j.find("child").get("link"): j for j in self.joints.values()}
        self.links = {link.get("name"): link for link in root.findall("link")}

    def place(self, index: int, origin: Array, axis: Array | None, _point: Array | None) -> None:
        """Set the origin (4, 4) of a node and, where it has a joint, its axis (3,) in the node's frame."""
        element = self.by_child[self.tree.nodes[index].name]
        _child(element, "origin", {"xyz": text(origin[:3, 3]), "rpy": text(rpy(origin[:3, :3]))})
        if axis is not None:
            _child(element, "axis", {"xyz": text(axis)})

    def displace(self, index: int, shift: Array) -> None:
        """Move what a link carries by shift (3,) [m] in its frame, after the frame has moved the other way."""
        for part in self.links[self.tree.nodes[index].name]:
            if part.tag in ("inertial", "visual", "collision"):
                origin = part.find("origin")
                old = (
                    np.zeros(3) if origin is None else np.array([float(w) for w in origin.get("xyz", "0 0 0").split()])
                )
                _child(part, "origin", {"xyz": text(old + shift)})

    def limit(self, name: str, limits: tuple[float, float] | None) -> None:
        """Set limits [rad or m]; None makes a hinge continuous."""
        if limits is None:
            self.joints[name].set("type", "continuous")
            return
        if self.joints[name].get("type") == "continuous":
            self.joints[name].set("type", "revolute")
        _child(self.joints[name], "limit", {"lower": repr(float(limits[0])), "upper": repr(float(limits[1]))})

    def couple(self, name: str, driver: str | None, coefficients: Sequence[float] | None) -> bool:
        """Let `name` follow coefficients[0] + coefficients[1] driver; None frees it. False where a mimic cannot say
        it."""
        for mimic in self.joints[name].findall("mimic"):
            self.joints[name].remove(mimic)
        if coefficients is None:
            return True
        if driver is None or any(abs(c) > 1e-15 for c in coefficients[2:]):
            return False
        offset, factor = (*coefficients, 0.0)[:2]
        _child(
            self.joints[name],
            "mimic",
            {"joint": driver, "multiplier": repr(float(factor)), "offset": repr(float(offset))},
        )
        return True

    def write(self, path: Path) -> None:
        """Write the file: a temporary sibling first."""
        _write(self.document, path)


class MjcfEditor:
    """An MJCF under change. Raises DescriptionError for what it cannot change in place: includes, frames, unnamed
    joints."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.document = parse_xml(tree.path)
        self.root = self.document.getroot()
        if next(self.root.iter("include"), None) is not None:
            raise DescriptionError(f"{tree.path}: a corrected copy needs one file without <include>")
        worlds = self.root.findall("worldbody")
        self.bodies = {e.get("name"): e for w in worlds for e in w.iter("body")}
        self.joints = {e.get("name"): e for w in worlds for e in w.iter("joint")}
        self.sites = {e.get("name"): e for w in worlds for e in w.iter("site")}
        angle = [c.get("angle") for c in self.root.findall("compiler") if c.get("angle")]
        self.angle = 1.0 if angle and angle[-1] == "radian" else np.pi / 180

    def place(self, index: int, origin: Array, axis: Array | None, point: Array | None) -> None:
        """Set the pose (4, 4) of a body or site at zero and, where it has a joint, axis (3,) and point (3,) [m] in its
        frame."""
        node = self.tree.nodes[index]
        element = (self.sites if node.kind == "site" else self.bodies).get(node.name)
        if element is None or element.getparent().tag == "frame" or node.kind == "hidden" or self._crowded(element):
            raise DescriptionError(
                f'{self.tree.path}: "{node.name}" (a <frame>, or several joints in one body) is left to you'
            )
        for attribute in ("quat", "euler", "axisangle", "xyaxes", "zaxis"):
            element.attrib.pop(attribute, None)
        element.set("pos", text(origin[:3, 3]))
        element.set("quat", text(quaternion(origin[:3, :3])))
        if axis is not None:
            joint = self.joints[node.joint.name]
            joint.set("axis", text(axis))
            joint.set("pos", text(point))
            joint.set("ref", "0")

    def _crowded(self, element: etree._Element) -> bool:
        return len(element.findall("joint")) > 1 or element.find("frame/joint") is not None

    def displace(self, index: int, shift: Array) -> None:
        """Nothing to do: an MJCF joint need not pass through its body's origin."""

    def limit(self, name: str, limits: tuple[float, float] | None) -> None:
        """Set limits [rad or m]; None makes the joint unlimited."""
        element = self.joints[name]
        if limits is None:
            element.set("limited", "false")
            return
        scale = self.angle if self.tree.joint(name).kind == "hinge" else 1.0
        element.set("range", text(np.array(limits) / scale))
        element.set("limited", "true")

    def couple(self, name: str, driver: str | None, coefficients: Sequence[float] | None) -> bool:
        """Let `name` follow a polynomial of driver in absolute values; None frees it. False where five coefficients do
        not do."""
        for section in self.root.findall("equality"):
            for old in section.findall("joint"):
                if old.get("joint1") == name:
                    section.remove(old)
        if coefficients is None:
            return True
        if len(coefficients) > 5:
            return False
        refs = [0.0 if n is None else self._ref(n) for n in (driver, name)]
        law = np.polynomial.Polynomial(coefficients)(np.polynomial.Polynomial([refs[0], 1.0])) - refs[1]
        padded = np.pad(np.atleast_1d(law.coef), (0, 5 - len(law.coef)))
        section = self.root.find("equality")
        if section is None:
            section = etree.SubElement(self.root, "equality")
        element = etree.SubElement(section, "joint", joint1=name, polycoef=text(padded))
        if driver is not None:
            element.set("joint2", driver)
        return True

    def _ref(self, name: str) -> float:
        given = self.joints[name].get("ref")
        return self.tree.joint(name).ref if given is None else float(given) * self.angle

    def write(self, path: Path) -> None:
        """Write the file: a temporary sibling first."""
        _write(self.document, path)


def editor(tree: Tree) -> UrdfEditor | MjcfEditor:
    """The editor for a tree's file."""
    return UrdfEditor(tree) if tree.format == "urdf" else MjcfEditor(tree)


def relative(parent: Array, child: Array) -> Array:
    """Pose (4, 4) of a child in its parent's frame."""
    return inverse(parent) @ child


def _child(element: etree._Element, tag: str, attributes: dict[str, str]) -> None:
    found = element.find(tag)
    if found is None:
        found = etree.SubElement(element, tag)
    for key, value in attributes.items():
        found.set(key, value)


def _write(document: etree._ElementTree, path: Path) -> None:
    with new_file(path) as staging:
        document.write(str(staging), xml_declaration=True, encoding="utf-8")
