"""Correct hands with a URDF and an MJCF each, made from one seeded specification, for planting mistakes in."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from lxml import etree

# 24 joints, as the largest hands have
FINGERS = {"wrist": 2, "index": 4, "middle": 4, "ring": 4, "little": 5, "thumb": 5}


@dataclass
class Link:
    """A link with the joint that moves it: pose in the parent's frame at zero, axis in its own frame, all in SI
    units."""

    name: str
    joint: str
    parent: str
    origin: np.ndarray
    axis: np.ndarray
    limits: tuple[float, float]
    follows: tuple[str, list[float]] | None = None
    ref: float = 0.0
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    tip: np.ndarray | None = None


def rotation(vector) -> np.ndarray:
    """Exponential map, written apart from the package."""
    v = np.asarray(vector, float)
    angle = np.linalg.norm(v)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = v / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def transform(vector, position) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation(vector), position
    return out


def make_hand(seed: int = 0, side: str = "right", couplings: bool = True) -> list[Link]:
    """A five-fingered hand of 24 joints with generic axes; the left one is the mirror image of the right one of the
    same seed."""
    rng = np.random.default_rng(seed)
    links: list[Link] = []
    for n, (finger, count) in enumerate(FINGERS.items()):
        parent = "palm_base" if finger == "wrist" else "wrist_2_link"
        for k in range(1, count + 1):
            first = k == 1
            place = [0.02 * (n - 3), 0.004 * rng.normal(), 0.08] if first and finger != "wrist" else [0.0, 0.0, 0.0]
            place = np.array(place) + ([0, 0, 0] if first else [0.0, 0.0, 0.035]) + 0.003 * rng.normal(size=3)
            axis = np.array([1.0, 0, 0]) if k != 1 else np.array([0, 1.0, 0])
            axis = rotation(0.2 * rng.normal(size=3)) @ axis
            origin = transform(0.3 * rng.normal(size=3), place)
            low, high = -0.1 - 0.3 * rng.random(), 1.0 + 0.6 * rng.random()
            link = Link(f"{finger}_{k}_link", f"{finger}_{k}", parent, origin, axis, (low, high))
            if couplings and k == count and finger != "wrist":
                link.follows = (f"{finger}_{k - 1}", [0.05 * rng.normal(), 0.6 + 0.3 * rng.random()])
            if k == count and finger != "wrist":
                link.tip = np.array([0.0, 0.004, 0.025]) + 0.002 * rng.normal(size=3)
            links.append(link)
            parent = link.name
    return links if side == "right" else [mirror(link) for link in links]


def mirror(link: Link) -> Link:
    """The other hand's link: reflected in the xz plane, turning so that the same angle means the same flexion."""
    flip = np.diag([1.0, -1.0, 1.0])
    out = deepcopy(link)
    out.origin[:3, :3], out.origin[:3, 3] = flip @ link.origin[:3, :3] @ flip, flip @ link.origin[:3, 3]
    out.axis, out.point = -flip @ link.axis, flip @ link.point
    out.tip = None if link.tip is None else flip @ link.tip
    return out


def text(values, digits: int | None = None) -> str:
    return " ".join(repr(float(v) if digits is None else round(float(v), digits) + 0.0) for v in np.atleast_1d(values))


def write_urdf(links: list[Link], path: Path, digits: int | None = None, mimic: bool = True, tips: bool = True) -> Path:
    root = etree.Element("robot", name="synthetic")
    for name in ("palm_base", *(link.name for link in links)):
        etree.SubElement(root, "link", name=name)
    for link in links:
        joint = etree.SubElement(root, "joint", name=link.joint, type="revolute")
        _origin(joint, link.origin, digits)
        etree.SubElement(joint, "parent", link=link.parent)
        etree.SubElement(joint, "child", link=link.name)
        etree.SubElement(joint, "axis", xyz=text(link.axis, digits))
        low, high = link.limits
        etree.SubElement(joint, "limit", lower=text(low, digits), upper=text(high, digits), effort="1", velocity="1")
        if link.follows and mimic:
            driver, law = link.follows
            etree.SubElement(joint, "mimic", joint=driver, multiplier=text(law[1]), offset=text(law[0]))
        if link.tip is not None and tips:
            etree.SubElement(root, "link", name=f"{link.name}_tip")
            fixed = etree.SubElement(root, "joint", name=f"{link.joint}_tip_fixed", type="fixed")
            _origin(fixed, transform([0, 0, 0], link.tip), digits)
            etree.SubElement(fixed, "parent", link=link.name)
            etree.SubElement(fixed, "child", link=f"{link.name}_tip")
    etree.ElementTree(root).write(str(path), pretty_print=True)
    return path


def _origin(joint, origin, digits) -> None:
    r = origin[:3, :3]
    rpy = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0])), np.arctan2(r[1, 0], r[0, 0])
    etree.SubElement(joint, "origin", xyz=text(origin[:3, 3], digits), rpy=text(rpy, digits))


def write_mjcf(
    links: list[Link],
    path: Path,
    digits: int | None = None,
    frames: int | None = None,
    degrees: bool = False,
    tips: bool = True,
    poly: dict[str, list[float]] | None = None,
    base: np.ndarray | None = None,
) -> Path:
    """frames: seed of other link frames than the URDF's (None: the same); base: (4, 4) the base frame's own turn.

    poly: joint -> polynomial instead of its line.
    """
    scale = 180 / np.pi if degrees else 1.0
    root = etree.Element("mujoco", model="synthetic")
    etree.SubElement(root, "compiler", angle="degree" if degrees else "radian", autolimits="true")
    world = etree.SubElement(root, "worldbody")
    rng = np.random.default_rng(frames)
    turn = {
        n: transform(rng.normal(size=3), 0.01 * rng.normal(size=3))
        for n in ("palm_base", *(link.name for link in links))
    }
    turn = {n: np.eye(4) if frames is None or n == "palm_base" else t for n, t in turn.items()}
    turn["palm_base"] = np.eye(4) if base is None else base
    bodies = {"palm_base": etree.SubElement(world, "body", name="palm_base", pos="0.1 0.2 0.3", quat="0.8 0.6 0 0")}
    for link in links:
        ref = transform(-link.ref * link.axis, [0, 0, 0])
        ref[:3, 3] = link.point - ref[:3, :3] @ link.point
        at_ref = link.origin @ np.linalg.inv(ref)  # at the value `ref` the body stands where it is written
        placed = np.linalg.inv(turn[link.parent]) @ at_ref @ turn[link.name]
        body = etree.SubElement(
            bodies[link.parent],
            "body",
            name=link.name,
            pos=text(placed[:3, 3], digits),
            quat=text(_quat(placed), digits),
        )
        bodies[link.name] = body
        back = np.linalg.inv(turn[link.name])
        joint = etree.SubElement(body, "joint", name=link.joint, axis=text(back[:3, :3] @ link.axis, digits))
        joint.set("pos", text(back[:3, :3] @ link.point + back[:3, 3], digits))
        joint.set("range", text(np.array(link.limits) * scale, digits))
        if link.ref:
            joint.set("ref", text(link.ref * scale, digits))
        if link.tip is not None and tips:
            etree.SubElement(
                body, "site", name=f"{link.name}_tip", pos=text(back[:3, :3] @ link.tip + back[:3, 3], digits)
            )
    equality = etree.SubElement(root, "equality")
    refs = {link.joint: link.ref for link in links}
    for link in links:
        if link.follows:
            driver, law = link.follows
            law = (poly or {}).get(link.joint, law)
            moved = np.polynomial.Polynomial(law)(np.polynomial.Polynomial([refs[driver], 1.0])) - link.ref
            coefficients = np.pad(moved.coef, (0, 5 - len(moved.coef)))
            etree.SubElement(equality, "joint", joint1=link.joint, joint2=driver, polycoef=text(coefficients))
    etree.ElementTree(root).write(str(path), pretty_print=True)
    return path


def _quat(placed) -> np.ndarray:
    values, vectors = np.linalg.eigh(_quat_matrix(placed[:3, :3]))
    return vectors[:, np.argmax(values)]


def _quat_matrix(r) -> np.ndarray:
    """Bar-Itzhack's matrix (2000): its leading eigenvector is the quaternion."""
    k = np.zeros((4, 4))
    k[1:, 1:] = r + r.T - np.trace(r) * np.eye(3)
    k[0, 0] = np.trace(r)
    k[0, 1:] = k[1:, 0] = [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    return k / 3
