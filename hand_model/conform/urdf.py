"""URDF -> Tree: links, joints, origins, axes, limits and mimics, parsed here so that no loader's opinion comes
between."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import DescriptionError, did_you_mean
from ..rotation import rotation_about
from .tree import Array, Coupling, Joint, Node, Tree, half_units, numbers, pose, unit

KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": None}
ATTRIBUTES = {
    "origin": {"xyz", "rpy", "quat_xyzw"},
    "axis": {"xyz"},
    "limit": {"lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"},
    "mimic": {"joint", "multiplier", "offset"},
    "parent": {"link"},
    "child": {"link"},
}


def read_urdf(path: str | Path, root: etree._Element | None = None) -> Tree:
    """Read a URDF [m, rad] (http://wiki.ros.org/urdf/XML). `calibration`, `dynamics` and `safety_controller` are
    ignored.

    Raises DescriptionError for what is not a kinematic tree: unknown links, a second parent, loops, several roots.
    """
    file = Path(path)
    if root is None:
        root = parse_xml(file).getroot()
    if root.tag != "robot":
        raise DescriptionError(f"{file}: the root of a URDF is <robot>, not <{root.tag}>; expand xacro first")
    warnings: list[str] = []
    links = {}
    for link in root.findall("link"):
        name = _required(link, "name", file)
        if name in links:
            raise DescriptionError(f'{file}:{link.sourceline}: a second link "{name}"')
        links[name] = link
    by_parent: dict[str, list[etree._Element]] = {name: [] for name in links}
    child_of: dict[str, str] = {}
    names: set[str] = set()
    for element in root.findall("joint"):
        name = _required(element, "name", file)
        parent, child = (_end(element, end, links, file) for end in ("parent", "child"))
        if name in names:
            raise DescriptionError(f'{file}:{element.sourceline}: a second joint "{name}"')
        if child in child_of:
            raise DescriptionError(
                f'{file}:{element.sourceline}: link "{child}" has two parents ("{child_of[child]}", "{parent}")'
            )
        names.add(name)
        child_of[child] = parent
        by_parent[parent].append(element)
    roots = [name for name in links if name not in child_of]
    if len(roots) != 1:
        raise DescriptionError(
            f"{file}: a URDF has one root link, this one has {len(roots)} ({', '.join(roots[:5]) or 'a loop'})"
        )
    nodes = [Node(roots[0], -1, np.eye(4), com=_com(links[roots[0]], file), line=links[roots[0]].sourceline)]
    index = {roots[0]: 0}
    queue = [roots[0]]
    while queue:
        parent = queue.pop(0)
        for element in by_parent[parent]:
            child = element.find("child").get("link")
            node = _node(element, file, warnings)
            nodes.append(replace(node, name=child, parent=index[parent], com=_com(links[child], file)))
            index[child] = len(nodes) - 1
            queue.append(child)
    if len(index) != len(links):
        raise DescriptionError(f"{file}: links in a loop: {', '.join(sorted(set(links) - set(index))[:5])}")
    joints = {n.joint.name for n in nodes if n.joint}
    for node in nodes:
        if node.joint and node.joint.coupling and node.joint.coupling.driver not in joints:
            driver = node.joint.coupling.driver
            raise DescriptionError(
                f'{file}:{node.joint.line}: joint "{node.joint.name}" mimics "{driver}", which is no moving joint; '
                f"{did_you_mean(driver or '', joints)}"
            )
    return Tree(file, "urdf", tuple(nodes), tuple(warnings), _missing_meshes(root, file))


def parse_xml(file: Path) -> etree._ElementTree:
    """Parse XML without network or entities; raises DescriptionError with the line that is wrong."""
    if not file.is_file():
        raise DescriptionError(f"{file}: no such file; a URDF or MJCF file is needed")
    try:
        return etree.parse(str(file), etree.XMLParser(remove_comments=False, resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        raise DescriptionError(f"{file}: not XML ({error})") from None


def rotation_rpy(rpy: Array) -> Array:
    """Rotation (3, 3) of URDF roll, pitch, yaw [rad] about the fixed x, y, z."""
    r, p, y = rpy
    return rotation_about([0, 0, 1], y) @ rotation_about([0, 1, 0], p) @ rotation_about([1, 0, 0], r)


def _required(element: etree._Element, attribute: str, file: Path) -> str:
    value = element.get(attribute)
    if not value:
        raise DescriptionError(f'{file}:{element.sourceline}: <{element.tag}> needs the attribute "{attribute}"')
    return value


def _end(element: etree._Element, end: str, links: dict, file: Path) -> str:
    found = element.find(end)
    name = element.get("name")
    if found is None:
        raise DescriptionError(f'{file}:{element.sourceline}: joint "{name}" has no <{end} link="..."/>')
    link = _required(found, "link", file)
    if link not in links:
        raise DescriptionError(
            f'{file}:{found.sourceline}: joint "{name}": no link "{link}"; {did_you_mean(link, links)}'
        )
    return link


def _node(element: etree._Element, file: Path, warnings: list[str]) -> Node:
    name, kind = element.get("name"), element.get("type")
    where = f'{file}:{element.sourceline}: joint "{name}"'
    if kind not in KINDS:
        raise DescriptionError(f"{where}: type {kind!r} cannot be compared; {did_you_mean(kind or '', KINDS)}")
    for tag, valid in ATTRIBUTES.items():
        for found in element.findall(tag):
            for extra in sorted(set(found.attrib) - valid):
                warnings.append(
                    f'{file.name}:{found.sourceline}: joint "{name}": <{tag}> has no attribute "{extra}", '
                    f'so every loader ignores {extra}="{found.get(extra)}"; {did_you_mean(extra, valid)}'
                )
    origin, slack_m, slack_rad = _origin(element.find("origin"), where)
    joint = _joint(element, KINDS[kind], where, warnings, file) if KINDS[kind] else None
    return Node("", -1, origin, joint, slack_m=slack_m, slack_rad=slack_rad, line=element.sourceline)


def _origin(element: etree._Element | None, where: str) -> tuple[Array, float, float]:
    if element is None:
        return np.eye(4), 0.0, 0.0
    xyz, rpy = element.get("xyz", "0 0 0"), element.get("rpy", "0 0 0")
    transform = pose(rotation_rpy(numbers(rpy, 3, where)), numbers(xyz, 3, where))
    return transform, float(np.linalg.norm(half_units(xyz))), float(np.sum(half_units(rpy)))


def _joint(element: etree._Element, kind: str, where: str, warnings: list[str], file: Path) -> Joint:
    axis_element = element.find("axis")
    text = axis_element.get("xyz", "1 0 0") if axis_element is not None else "1 0 0"
    raw = numbers(text, 3, where)
    axis = unit(raw, where)
    limit, limits, slack = element.find("limit"), None, (0.0, 0.0)
    if limit is None and element.get("type") != "continuous":
        warnings.append(
            f'{file.name}:{element.sourceline}: joint "{element.get("name")}" has no <limit>; taken as unlimited'
        )
    if limit is not None and element.get("type") != "continuous":
        lower, upper = limit.get("lower", "0"), limit.get("upper", "0")
        limits = (float(numbers(lower, 1, where)[0]), float(numbers(upper, 1, where)[0]))
        slack = (half_units(lower)[0], half_units(upper)[0])
        if limits[0] > limits[1]:
            warnings.append(
                f'{file.name}:{limit.sourceline}: joint "{element.get("name")}": lower limit above upper limit'
            )
    coupling, mimic = None, element.find("mimic")
    if mimic is not None:
        offset, factor = (
            float(numbers(mimic.get(a, d), 1, where)[0]) for a, d in (("offset", "0"), ("multiplier", "1"))
        )
        coupling = Coupling(mimic.get("joint"), (offset, factor))
    tilt = float(np.linalg.norm(half_units(text)) / np.linalg.norm(raw))
    return Joint(element.get("name"), kind, axis, np.zeros(3), 0.0, limits, coupling, tilt, slack, element.sourceline)


def _com(link: etree._Element, file: Path) -> Array | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    origin = inertial.find("origin")
    return numbers(
        "0 0 0" if origin is None else origin.get("xyz", "0 0 0"), 3, f"{file}:{inertial.sourceline}: <inertial>"
    )


def _missing_meshes(root: etree._Element, file: Path) -> tuple[str, ...]:
    names = {m.get("filename", "") for m in root.iter("mesh")}
    missing = []
    for name in sorted(names):
        plain = name.split("://", 1)[-1]
        tails = [file.parent / plain, file.parent / Path(*Path(plain).parts[1:])] if plain else []
        if plain and not any(t.is_file() for t in tails):
            missing.append(name)
    return tuple(missing)
