"""MJCF -> Tree: nested bodies, defaults, frames, every way to write an orientation, joints with pos and ref,
equalities."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import DescriptionError, did_you_mean
from ..rotation import rotation_about
from .tree import Array, Coupling, Joint, Node, Tree, half_units, numbers, pose, unit
from .urdf import parse_xml

REFUSED = {"replicate": "expand it first", "attach": "expand it first", "composite": "it is not a hand's skeleton"}
DEGREE = np.pi / 180


@dataclass
class _Reader:
    file: Path
    angle: float = DEGREE
    eulerseq: str = "xyz"
    autolimits: bool = True
    defaults: dict[str, dict[str, dict[str, str]]] = field(default_factory=dict)
    nodes: list[Node] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    names: dict[tuple[str, str], int] = field(default_factory=dict)


def read_mjcf(path: str | Path, root: etree._Element | None = None) -> Tree:
    """Read the kinematics of an MJCF model as MuJoCo compiles it
    (https://mujoco.readthedocs.io/en/stable/XMLreference.html).

    Free joints count as fixed: poses are compared relative to a base body. Raises DescriptionError for ball joints, for
    `<replicate>` and `<attach>` (save the compiled model first), and for what is not MJCF.
    """
    file = Path(path)
    if root is None:
        root = parse_xml(file).getroot()
    if root.tag != "mujoco":
        raise DescriptionError(f"{file}: the root of an MJCF is <mujoco>, not <{root.tag}>")
    root = copy.deepcopy(root)
    _include(root, file, (file.resolve(),))
    reader = _Reader(file)
    _compiler(root, reader)
    reader.defaults["main"] = {}
    for top in root.findall("default"):
        _defaults(top, top.get("class", "main"), reader.defaults["main"], reader)
    reader.nodes.append(Node("world", -1, np.eye(4)))
    for world in root.findall("worldbody"):
        _children(world, 0, np.eye(4), (0.0, 0.0), world.get("childclass"), reader)
    _equalities(root, reader)
    return Tree(file, "mjcf", tuple(reader.nodes), tuple(reader.warnings), _missing_meshes(root, file))


def _include(element: etree._Element, file: Path, seen: tuple[Path, ...]) -> None:
    for include in list(element.iter("include")):
        target = (seen[0].parent / include.get("file", "")).resolve()
        if target in seen:
            raise DescriptionError(
                f'{file}:{include.sourceline}: <include file="{include.get("file")}"> includes itself'
            )
        inner = parse_xml(target).getroot()
        _include(inner, target, (*seen, target))
        parent, at = include.getparent(), include.getparent().index(include)
        for offset, child in enumerate(list(inner)):
            parent.insert(at + offset, child)
        parent.remove(include)


def _compiler(root: etree._Element, reader: _Reader) -> None:
    for compiler in root.findall("compiler"):
        if compiler.get("coordinate", "local") != "local":
            raise DescriptionError(
                f'{reader.file}:{compiler.sourceline}: coordinate="global" is no longer MJCF; save it as local'
            )
        reader.angle = {"radian": 1.0, "degree": DEGREE}.get(compiler.get("angle"), reader.angle)
        reader.eulerseq = compiler.get("eulerseq", reader.eulerseq)
        reader.autolimits = compiler.get("autolimits", "true" if reader.autolimits else "false") == "true"
    if len(reader.eulerseq) != 3 or set(reader.eulerseq) - set("xyzXYZ"):
        raise DescriptionError(f'{reader.file}: eulerseq "{reader.eulerseq}" should be three letters of xyzXYZ')


def _defaults(element: etree._Element, name: str, inherited: dict, reader: _Reader) -> None:
    own = {tag: dict(attributes) for tag, attributes in inherited.items()}
    for child in element:
        if isinstance(child.tag, str) and child.tag != "default":
            own[child.tag] = own.get(child.tag, {}) | dict(child.attrib)
    reader.defaults[name] = own
    for child in element.findall("default"):
        if not child.get("class"):
            raise DescriptionError(f'{reader.file}:{child.sourceline}: a nested <default> needs a "class"')
        _defaults(child, child.get("class"), own, reader)


def _attributes(element: etree._Element, childclass: str | None, reader: _Reader) -> dict[str, str]:
    name = element.get("class") or childclass or "main"
    if name not in reader.defaults:
        raise DescriptionError(
            f'{reader.file}:{element.sourceline}: no default class "{name}"; {did_you_mean(name, reader.defaults)}'
        )
    return reader.defaults[name].get(element.tag, {}) | dict(element.attrib)


def _children(
    element: etree._Element, at: int, frame: Array, slack: tuple[float, float], childclass: str | None, reader: _Reader
) -> None:
    """Append what hangs below node `at`; `frame` (4, 4) is the surrounding <frame>, `slack` its rounding [m, rad]."""
    for child in element:
        if not isinstance(child.tag, str):
            continue
        if child.tag in REFUSED or child.tag == "flexcomp":
            why = REFUSED.get(child.tag, "it is not a hand's skeleton")
            raise DescriptionError(
                f"{reader.file}:{child.sourceline}: <{child.tag}> is not read ({why}: mujoco's mj_saveLastXML)"
            )
        if child.tag == "frame":
            inner, m, rad = _placement(child, dict(child.attrib), reader)
            deeper = (slack[0] + m, slack[1] + rad)
            _children(child, at, frame @ inner, deeper, child.get("childclass") or childclass, reader)
        elif child.tag == "body":
            _body(child, at, frame, slack, child.get("childclass") or childclass, reader)
        elif child.tag == "site" and child.get("name"):
            placed, m, rad = _placement(child, _attributes(child, childclass, reader), reader)
            _claim("site", child.get("name"), child, reader)
            node = Node(child.get("name"), at, frame @ placed, None, "site", None, slack[0] + m, slack[1] + rad)
            reader.nodes.append(replace(node, line=child.sourceline))


def _body(
    element: etree._Element, at: int, frame: Array, slack: tuple[float, float], childclass: str | None, reader: _Reader
) -> None:
    name = element.get("name") or f"body@{element.sourceline}"
    _claim("body", name, element, reader)
    placed, m, rad = _placement(element, dict(element.attrib), reader)
    joints = [
        j for e, f, c in _joint_elements(element, np.eye(4), childclass, reader) if (j := _joint(e, f, c, reader))
    ]
    origin, parent, slack_m, slack_rad = frame @ placed, at, slack[0] + m, slack[1] + rad
    inertial = element.find("inertial")
    where = f'{reader.file}:{element.sourceline}: body "{name}"'
    com = None if inertial is None else numbers(inertial.get("pos", "0 0 0"), 3, where)
    for k, joint in enumerate(joints or [None]):
        last = k == max(len(joints), 1) - 1
        label, kind = (name, "link") if last else (f"{name}#{k}", "hidden")
        node = Node(label, parent, origin, joint, kind, com if last else None, slack_m, slack_rad, element.sourceline)
        reader.nodes.append(node)
        origin, parent, slack_m, slack_rad = np.eye(4), len(reader.nodes) - 1, 0.0, 0.0
    _children(element, parent, np.eye(4), (0.0, 0.0), childclass, reader)


def _joint_elements(element: etree._Element, frame: Array, childclass: str | None, reader: _Reader):
    """Joints of one body with the <frame>s (4, 4) and the default class around each."""
    for child in element:
        if child.tag in ("joint", "freejoint"):
            yield child, frame, childclass
        elif child.tag == "frame":
            inner = _placement(child, dict(child.attrib), reader)[0]
            yield from _joint_elements(child, frame @ inner, child.get("childclass") or childclass, reader)


def _joint(element: etree._Element, frame: Array, childclass: str | None, reader: _Reader) -> Joint | None:
    if element.tag == "freejoint":
        return None
    a = _attributes(element, childclass, reader)
    name = a.get("name") or f"joint@{element.sourceline}"
    where = f'{reader.file}:{element.sourceline}: joint "{name}"'
    kind = a.get("type", "hinge")
    if kind == "free":
        return None
    if kind not in ("hinge", "slide"):
        raise DescriptionError(
            f"{where}: type {kind!r} cannot be compared; {did_you_mean(kind, ['hinge', 'slide', 'free'])}"
        )
    _claim("joint", name, element, reader)
    scale = reader.angle if kind == "hinge" else 1.0
    axis_text = a.get("axis", "0 0 1")
    raw = numbers(axis_text, 3, where)
    axis, point = frame[:3, :3] @ unit(raw, where), numbers(a.get("pos", "0 0 0"), 3, where)
    limited = a.get("limited", "auto")
    limits, slack = None, (0.0, 0.0)
    if "range" in a and (limited == "true" or (limited == "auto" and reader.autolimits)):
        low, high = numbers(a["range"], 2, where)
        units = [half_units(word)[0] * scale for word in a["range"].split()]
        limits, slack = (float(low * scale), float(high * scale)), (units[0], units[1])
    if "range" in a and limited == "auto" and not reader.autolimits:
        reader.warnings.append(
            f'{where}: range without limited="true" while autolimits is off: MuJoCo leaves it unlimited'
        )
    ref = float(numbers(a.get("ref", "0"), 1, where)[0]) * scale
    point = frame[:3, :3] @ point + frame[:3, 3]
    tilt = float(np.linalg.norm(half_units(axis_text)) / np.linalg.norm(raw))
    return Joint(name, kind, axis, point, ref, limits, None, tilt, slack, element.sourceline)


def _claim(kind: str, name: str, element: etree._Element, reader: _Reader) -> None:
    if (kind, name) in reader.names:
        raise DescriptionError(
            f'{reader.file}:{element.sourceline}: a second {kind} "{name}" (first in line {reader.names[kind, name]})'
        )
    reader.names[kind, name] = element.sourceline


def _placement(element: etree._Element, a: dict[str, str], reader: _Reader) -> tuple[Array, float, float]:
    """Transform (4, 4) of pos and whichever orientation is given, with half units of its last digits [m, rad]."""
    where = f"{reader.file}:{element.sourceline}: <{element.tag}>"
    position = a.get("pos", "0 0 0")
    rotation, slack = _orientation(a, element, where, reader)
    return pose(rotation, numbers(position, 3, where)), float(np.linalg.norm(half_units(position))), slack


def _orientation(a: dict[str, str], element: etree._Element, where: str, reader: _Reader) -> tuple[Array, float]:
    own = [k for k in ("quat", "axisangle", "xyaxes", "zaxis", "euler") if k in element.attrib]
    if len(own) > 1:
        raise DescriptionError(f"{where}: several orientations ({', '.join(own)}); one is allowed")
    key = own[0] if own else next((k for k in ("axisangle", "xyaxes", "zaxis", "euler", "quat") if k in a), None)
    if key is None:
        return np.eye(3), 0.0
    room = float(np.linalg.norm(half_units(a[key])))
    if key == "quat":
        quat = numbers(a[key], 4, where)
        return rotation_quat(unit(quat, where)), 2 * room / float(np.linalg.norm(quat))
    if key == "axisangle":
        v = numbers(a[key], 4, where)
        return rotation_about(unit(v[:3], where), v[3] * reader.angle), 2 * room
    if key == "euler":
        return rotation_euler(numbers(a[key], 3, where) * reader.angle, reader.eulerseq), 2 * room * reader.angle
    if key == "xyaxes":
        v = numbers(a[key], 6, where)
        x = unit(v[:3], where)
        y = unit(v[3:] - (v[3:] @ x) * x, where)
        return np.stack([x, y, np.cross(x, y)], axis=1), 2 * room
    z = unit(numbers(a[key], 3, where), where)
    cross = np.cross([0.0, 0.0, 1.0], z)
    length = np.linalg.norm(cross)
    turn = cross / length if length > 1e-10 else np.array([1.0, 0, 0])
    return rotation_about(turn, np.arctan2(length, z[2])), 2 * room


def rotation_quat(quat: Array) -> Array:
    """Rotation (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_euler(angles: Array, sequence: str) -> Array:
    """Rotation (3, 3) of Euler angles [rad]: lower-case letters turn about moving axes, upper-case about fixed ones."""
    out = np.eye(3)
    for angle, letter in zip(angles, sequence, strict=True):
        turn = rotation_about(np.eye(3)["xyz".index(letter.lower())], angle)
        out = out @ turn if letter.islower() else turn @ out
    return out


def _equalities(root: etree._Element, reader: _Reader) -> None:
    index = {n.joint.name: i for i, n in enumerate(reader.nodes) if n.joint}
    tendons = {t.get("name"): t for s in root.findall("tendon") for t in s.findall("fixed")}
    for section in root.findall("equality"):
        for element in section:
            if element.tag in ("joint", "tendon") and element.get("active", "true") == "true":
                where = f"{reader.file}:{element.sourceline}: <{element.tag}>"
                if element.tag == "joint":
                    _joint_equality(element, index, where, reader)
                else:
                    _tendon_equality(element, tendons, index, where, reader)


def _joint_equality(element: etree._Element, index: dict[str, int], where: str, reader: _Reader) -> None:
    first, second = element.get("joint1"), element.get("joint2")
    for name in (first, second):
        if name not in index and not (name is None and name is second):
            raise DescriptionError(f'{where}: no joint "{name}"; {did_you_mean(name or "", index)}')
    given = numbers(element.get("polycoef", "0 1 0 0 0"), None, where)
    coefficients = tuple(given[:5]) + (0.0, 1.0, 0.0, 0.0, 0.0)[len(given) :]
    if second is None:
        coefficients = coefficients[:1]
    _couple(first, second, coefficients, index, where, reader)


def _tendon_equality(element, tendons: dict, index: dict[str, int], where: str, reader: _Reader) -> None:
    """A fixed tendon over two joints, held at its rest length, is a linear coupling; others are passed over, with a
    warning."""
    tendon = tendons.get(element.get("tendon1"))
    parts = [] if tendon is None else tendon.findall("joint")
    given = numbers(element.get("polycoef", "0 1 0 0 0"), None, where)
    if element.get("tendon2") or len(parts) != 2 or any(p.get("joint") not in index for p in parts):
        reader.warnings.append(
            f'{where}: an equality of tendon "{element.get("tendon1")}" is not a coupling of two joints; not compared'
        )
        return
    driver, follower = parts[0], parts[1]
    c1, c2 = (float(numbers(p.get("coef", "1"), 1, where)[0]) for p in (driver, follower))
    _couple(follower.get("joint"), driver.get("joint"), (given[0] / c2, -c1 / c2), index, where, reader)


def _couple(first: str, second: str | None, coefficients, index: dict[str, int], where: str, reader: _Reader) -> None:
    node = reader.nodes[index[first]]
    if node.joint.coupling is not None:
        reader.warnings.append(f'{where}: a second equality for joint "{first}"; the first is compared')
        return
    ref = reader.nodes[index[second]].joint.ref if second else 0.0
    coupling = Coupling(second, tuple(float(c) for c in coefficients), ref, node.joint.ref)
    reader.nodes[index[first]] = replace(node, joint=replace(node.joint, coupling=coupling))


def _missing_meshes(root: etree._Element, file: Path) -> tuple[str, ...]:
    folder = ""
    for compiler in root.findall("compiler"):
        folder = compiler.get("meshdir", compiler.get("assetdir", folder))
    names = {m.get("file") for m in root.findall("asset/mesh") if m.get("file")}
    return tuple(sorted(n for n in names if not (file.parent / folder / n).is_file()))
