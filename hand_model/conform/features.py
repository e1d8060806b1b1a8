"""What two descriptions are compared by: joint lines, link frames and centres of mass at zero (product of exponentials,
Brockett 1984)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .pairing import Pairing
from .tree import Array, Tree, transformed, zero_lines, zero_poses


@dataclass(frozen=True)
class Features:
    """What is compared, at zero, in each file's own base frame.

    axes_*, points_* (k, 3): the paired joints' lines. parent (k,): index of the nearest paired joint towards the base,
    or -1.
    frames: joint index (-1: base) -> list of (pose in a, pose in b, name in a, name in b, is the joint's own link);
    coms: joint index -> (point in a, point in b). slide (k,): prismatic. slack_*: (k, 2) half units [m, rad] from the
    parent on.
    """

    names: tuple[tuple[str, str], ...]
    axes_a: Array
    points_a: Array
    axes_b: Array
    points_b: Array
    parent: tuple[int, ...]
    parent_b: tuple[int, ...]
    slide: tuple[bool, ...]
    frames: dict[int, list[tuple[Array, Array, str, str, bool]]]
    coms: dict[int, tuple[Array, Array]]
    slack_a: Array
    slack_b: Array
    children: dict[int, list[int]] = field(default_factory=dict)

    def below(self, joint: int) -> list[int]:
        """All joints that the joint carries."""
        direct = self.children.get(joint, [])
        return [*direct, *(k for c in direct for k in self.below(c))]


def features(a: Tree, b: Tree, pairing: Pairing) -> Features:
    """Collect the lines, frames and centres of mass of both files under a pairing."""
    base_a, base_b = a.node_of_link(pairing.base[0]), b.node_of_link(pairing.base[1])
    poses_a, poses_b = zero_poses(a, base_a), zero_poses(b, base_b)
    order = sorted(pairing.joints, key=lambda p: a.joint_node[p[0]])
    axes_a, points_a = zero_lines(a, base_a, [x for x, _ in order], poses_a)
    axes_b, points_b = zero_lines(b, base_b, [y for _, y in order], poses_b)
    index_a, index_b = {x: i for i, (x, _) in enumerate(order)}, {y: i for i, (_, y) in enumerate(order)}
    parents = tuple(_paired_ancestor(a, x, index_a) for x, _ in order)
    children: dict[int, list[int]] = {}
    for k, parent in enumerate(parents):
        children.setdefault(parent, []).append(k)
    frames: dict[int, list] = {-1: [(poses_a[base_a], poses_b[base_b], *pairing.base, True)]}
    coms: dict[int, tuple[Array, Array]] = {}
    for x, y in pairing.links:
        i, j = a.node_of_link(x), b.node_of_link(y)
        k = _nearest(a, i, index_a)
        own = k >= 0 and (a.joint_node[order[k][0]] == i or b.joint_node[order[k][1]] == j)
        if (x, y) == pairing.base or k != _nearest(b, j, index_b):
            continue
        frames.setdefault(k, []).insert(0 if own else len(frames.get(k, [])), (poses_a[i], poses_b[j], x, y, own))
        com_a, com_b = a.nodes[i].com, b.nodes[j].com
        if k >= 0 and own and com_a is not None and com_b is not None:
            coms[k] = (transformed(poses_a[i], com_a), transformed(poses_b[j], com_b))
    slack_a = np.array(
        [
            _slack(a, x, base_a if parents[k] < 0 else a.joint_node[order[parents[k]][0]])
            for k, (x, _) in enumerate(order)
        ]
    )
    slack_b = np.array(
        [
            _slack(b, y, base_b if parents[k] < 0 else b.joint_node[order[parents[k]][1]])
            for k, (_, y) in enumerate(order)
        ]
    )
    slide = tuple(a.joint(x).kind == "slide" for x, _ in order)
    parents_b = tuple(_paired_ancestor(b, y, index_b) for _, y in order)
    return Features(
        tuple(order),
        axes_a,
        points_a,
        axes_b,
        points_b,
        parents,
        parents_b,
        slide,
        frames,
        coms,
        slack_a,
        slack_b,
        children,
    )


def _nearest(tree: Tree, node: int, index: dict[str, int]) -> int:
    found = (
        index[tree.nodes[i].joint.name]
        for i in tree.ancestors(node)
        if tree.nodes[i].joint and tree.nodes[i].joint.name in index
    )
    return next(found, -1)


def _paired_ancestor(tree: Tree, name: str, index: dict[str, int]) -> int:
    parent = tree.nodes[tree.joint_node[name]].parent
    return _nearest(tree, parent, index) if parent >= 0 else -1


def _slack(tree: Tree, name: str, stop: int) -> tuple[float, float]:
    """Half units [m, rad] of all numbers between node `stop` and the joint."""
    path, above = tree.ancestors(tree.joint_node[name]), set(tree.ancestors(stop))
    chain = [tree.nodes[i] for i in path if i not in above]
    turned = sum(n.slack_rad for n in chain) + tree.joint(name).slack_rad
    return sum(n.slack_m for n in chain), turned


def mirrored(f: Features) -> Features:
    """The same features with b reflected in its xz plane (axes are axial vectors, so they turn over as well)."""
    flip = np.diag([1.0, -1.0, 1.0])
    return Features(
        f.names,
        f.axes_a,
        f.points_a,
        -f.axes_b @ flip,
        f.points_b @ flip,
        f.parent,
        f.parent_b,
        f.slide,
        {-1: f.frames[-1][:1]},
        {},
        f.slack_a,
        f.slack_b,
        f.children,
    )
