"""The neutral kinematic tree that a URDF and an MJCF are both read into, and its forward kinematics."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError, did_you_mean
from ..rotation import rotation_about

Array = NDArray[np.float64]

DECIMALS_MIN = 3
"""No description is published with fewer decimals (1 mm, 1 mrad): shorter numbers are taken for exact to this."""


@dataclass(frozen=True)
class Coupling:
    """follower - follower_ref = sum_i coefficients[i] (driver - driver_ref)^i [rad or m]; driver None: held at a
    constant."""

    driver: str | None
    coefficients: tuple[float, ...]
    driver_ref: float = 0.0
    follower_ref: float = 0.0

    def follower(self, driver: Array) -> Array:
        """Follower coordinates (n,) of driver coordinates (n,)."""
        x = np.asarray(driver, float) - self.driver_ref
        return self.follower_ref + np.polynomial.polynomial.polyval(x, self.coefficients)

    @property
    def degree(self) -> int:
        """Degree of the polynomial, trailing zeros ignored."""
        nonzero = [i for i, c in enumerate(self.coefficients) if c != 0]
        return max(nonzero, default=0)


@dataclass(frozen=True)
class Joint:
    """One degree of freedom. axis (3,) unit and point (3,) [m] in its node's frame before the motion; value - ref moves
    it.

    limits: (lower, upper) [rad or m], None where it is unlimited. slack_rad: half a unit of the axis's last written
    digit;
    limit_slack: the same for limits. line: line in the source file.
    """

    name: str
    kind: str  # "hinge" or "slide"
    axis: Array
    point: Array
    ref: float = 0.0
    limits: tuple[float, float] | None = None
    coupling: Coupling | None = None
    slack_rad: float = 0.0
    limit_slack: tuple[float, float] = (0.0, 0.0)
    line: int | None = None


@dataclass(frozen=True)
class Node:
    """A link, body, or site. origin: (4, 4) constant transform from the parent node to this one, before its joint
    moves.

    kind: "link" (URDF link or MJCF body), "site", or "hidden" (between several joints of one body). com: (3,) [m]
    centre of mass in the node's frame, where the file states one. slack_m, slack_rad: half a unit of the origin's last
    written digit.
    """

    name: str
    parent: int
    origin: Array
    joint: Joint | None = None
    kind: str = "link"
    com: Array | None = None
    slack_m: float = 0.0
    slack_rad: float = 0.0
    line: int | None = None


@dataclass(frozen=True)
class Tree:
    """Nodes in topological order (node 0 is the root). format: "urdf" or "mjcf". warnings: what the reader passed
    over."""

    path: Path
    format: str
    nodes: tuple[Node, ...]
    warnings: tuple[str, ...] = ()
    missing_meshes: tuple[str, ...] = ()
    joint_node: Mapping[str, int] = field(init=False, repr=False)
    link_node: Mapping[str, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_node", {n.joint.name: i for i, n in enumerate(self.nodes) if n.joint})
        links = {n.name: i for i, n in enumerate(self.nodes) if n.kind == "site"}
        links |= {n.name: i for i, n in enumerate(self.nodes) if n.kind == "link"}
        object.__setattr__(self, "link_node", links)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints in topological order."""
        return tuple(n.joint for n in self.nodes if n.joint)

    def joint(self, name: str) -> Joint:
        """The joint of that name; raises DescriptionError with a near name."""
        if name not in self.joint_node:
            raise DescriptionError(f'{self.path}: no joint "{name}"; {did_you_mean(name, self.joint_node)}')
        return self.nodes[self.joint_node[name]].joint

    def node_of_link(self, name: str) -> int:
        """Index of the link, body or site of that name; raises DescriptionError with a near name."""
        if name not in self.link_node:
            raise DescriptionError(f'{self.path}: no link or body "{name}"; {did_you_mean(name, self.link_node)}')
        return self.link_node[name]

    def ancestors(self, index: int) -> list[int]:
        """Node indices from `index` (included) to the root."""
        out = [index]
        while self.nodes[out[-1]].parent >= 0:
            out.append(self.nodes[out[-1]].parent)
        return out

    def resolve_couplings(self, values: Mapping[str, Array]) -> dict[str, Array]:
        """Joint values (n,) with every follower set by its coupling, chains followed to their driver."""
        out = dict(values)

        def settle(name: str, seen: tuple[str, ...]) -> Array:
            if name in seen:
                raise DescriptionError(
                    f'{self.path}: the couplings of "{name}" form a loop: {" <- ".join((*seen, name))}'
                )
            coupling = self.joint(name).coupling
            if coupling is None:
                return np.asarray(out.get(name, 0.0), float)
            driver = 0.0 if coupling.driver is None else settle(coupling.driver, (*seen, name))
            return coupling.follower(driver)

        return {name: settle(name, ()) for name in self.joint_node}


def pose(rotation: Array, translation: Array) -> Array:
    """Transforms (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3) [m]."""
    r, t = np.asarray(rotation, float), np.asarray(translation, float)
    out = np.zeros((*np.broadcast_shapes(r.shape[:-2], t.shape[:-1]), 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = r, t, 1.0
    return out


def inverse(transform: Array) -> Array:
    """Inverse of rigid transforms (..., 4, 4)."""
    r = np.swapaxes(transform[..., :3, :3], -1, -2)
    return pose(r, -(r @ transform[..., :3, 3, None])[..., 0])


def transformed(transform: Array, points: Array) -> Array:
    """Points (..., 3) [m] moved by a transform (4, 4)."""
    return points @ transform[:3, :3].T + transform[:3, 3]


def forward(tree: Tree, values: Mapping[str, Array], wanted: Sequence[int], base: int = 0) -> list[tuple[Array, Array]]:
    """Rotations (n, 3, 3) and positions (n, 3) [m] of the wanted nodes in the base node's frame.

    values: joint name -> (n,) [rad or m]; joints that are not named stay at zero; couplings are not applied. Nodes that
    are not below `base` are carried through the root with everything above the base at zero.
    """
    count = max((np.size(v) for v in values.values()), default=1)
    needed = {j for i in wanted for j in tree.ancestors(i)} | set(tree.ancestors(base))
    world: dict[int, tuple[Array, Array]] = {}
    for i in sorted(needed):
        node = tree.nodes[i]
        r, p = world[node.parent] if node.parent >= 0 else (np.eye(3), np.zeros(3))
        p = p + r @ node.origin[:3, 3]
        r = r @ node.origin[:3, :3]
        if node.joint is not None:
            motion = np.asarray(values.get(node.joint.name, 0.0), float) - node.joint.ref
            if np.ndim(motion) or motion != 0:
                r, p = _move(node.joint, motion, r, p)
        world[i] = (r, p)
    r0, p0 = world[base]
    out = []
    for i in wanted:
        r, p = world[i]
        r, p = np.swapaxes(r0, -1, -2) @ r, (np.swapaxes(r0, -1, -2) @ (p - p0)[..., None])[..., 0]
        out.append((np.broadcast_to(r, (count, 3, 3)), np.broadcast_to(p, (count, 3))))
    return out


def _move(joint: Joint, motion: Array, r: Array, p: Array) -> tuple[Array, Array]:
    if joint.kind == "slide":
        return r, p + (r @ joint.axis) * np.asarray(motion)[..., None]
    turned = r @ rotation_about(joint.axis, motion)
    if joint.point.any():
        p = p + r @ joint.point - turned @ joint.point
    return turned, p


def zero_poses(tree: Tree, base: int) -> Array:
    """Transforms (nodes, 4, 4) of all nodes in the base node's frame with every joint at zero."""
    poses = forward(tree, {}, range(len(tree.nodes)), base)
    return np.stack([pose(r[0], p[0]) for r, p in poses])


def zero_lines(tree: Tree, base: int, names: Sequence[str], poses: Array) -> tuple[Array, Array]:
    """Axis directions (k, 3) and points (k, 3) [m] of the named joints in the base node's frame, every joint at zero.

    A hinge's own motion leaves its axis where it is, and a slide's direction too, so the node's zero pose carries both.
    """
    axes, points = [], []
    for name in names:
        i = tree.joint_node[name]
        joint, at = tree.nodes[i].joint, poses[i]
        axes.append(at[:3, :3] @ joint.axis)
        points.append(at[:3, :3] @ joint.point + at[:3, 3])
    return np.array(axes).reshape(-1, 3), np.array(points).reshape(-1, 3)


_NUMBER = re.compile(r"^[+-]?(\d*)\.?(\d*)(?:[eE]([+-]?\d+))?$")


def half_units(text: str) -> list[float]:
    """Half a unit of the last digit that each number of an attribute is written to (trailing zeros may have been
    dropped).

    Decimals and significant digits are those of the longest number of the attribute, whichever leaves more room.
    """
    decimals, digits, values = DECIMALS_MIN, DECIMALS_MIN, []
    for word in text.split():
        match = _NUMBER.match(word)
        if not match:
            continue
        whole, fraction, exponent = match[1], match[2], int(match[3] or 0)
        decimals = max(decimals, len(fraction) - exponent)
        digits = max(digits, len((whole + fraction).lstrip("0")))
        values.append(abs(float(word)))
    by_decimals = 0.5 * 10.0**-decimals
    return [
        max(by_decimals, 0.5 * 10.0 ** (np.floor(np.log10(v)) + 1 - digits)) if v > 0 else by_decimals for v in values
    ]


def numbers(text: str, count: int | None, where: str) -> Array:
    """The numbers of an attribute; raises DescriptionError where they are none, not finite, or not `count` of them."""
    try:
        out = np.array([float(w) for w in text.split()])
    except ValueError:
        raise DescriptionError(f'{where}: "{text}" is not a list of numbers') from None
    if not np.isfinite(out).all() or (count is not None and len(out) != count):
        raise DescriptionError(f'{where}: "{text}" should be {count or "some"} finite numbers')
    return out


def unit(vector: Array, where: str) -> Array:
    """The vector divided by its length; raises DescriptionError where that is zero."""
    length = np.linalg.norm(vector)
    if length < 1e-12:
        raise DescriptionError(f"{where}: an axis of length zero has no direction")
    return vector / length
