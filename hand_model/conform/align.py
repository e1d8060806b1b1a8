"""Lay one description's axes over the other's, joint by joint from the base outwards, so that each difference stays
local.

At zero every joint is a line in the base frame (product of exponentials, Brockett 1984): two descriptions move alike
exactly when these lines coincide up to one transform of the base. Comparing them directly would smear a difference at
the knuckle over the whole finger, so each link keeps its own transform from b to a, passed on to its children, and a
joint may change it:
by a turn about its own axis (another zero), or because the links beyond follow its displaced axis.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ..rotation import kabsch, rotation_about
from .pairing import Pairing
from .tree import Array, Tree, inverse, pose, zero_lines, zero_poses

LEVER = 0.03
"""Length [m] by which angles are weighed against distances: a phalanx."""
SCALE = 1e-7
"""Distance [m] beyond which a feature counts as not coinciding."""

SLIGHT_RAD, SLIGHT_M = 0.2, 0.01
"""Below these, two base frames are meant to be the same: conventions differ by whole frames."""


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


@dataclass(frozen=True)
class Fit:
    """How one joint of b lies against its partner in a, seen from the link before it.

    angle_rad: between the two lines (0 to pi/2). gap: (3,) [m] from b's line to a's at a's joint, in a's base frame.
    sign: -1 where b turns the other way. offset: a's coordinate is sign * b's - offset [rad or m]. advance: [m] that
    the links beyond sit further along the axis in a. follows: the links beyond keep their place relative to the
    displaced axis.
    carry: (4, 4) from b's base frame to a's for the link that the joint moves. reach: [m] to the farthest thing it
    carries.
    seen: offset and advance show in axes or points farther out, not only in how the link's own frame lies.
    """

    angle_rad: float
    gap: Array
    sign: int
    offset: float
    advance: float
    follows: bool
    carry: Array
    reach: float
    seen: bool

    @property
    def shift(self) -> float:
        """Distance between the two lines [m]."""
        return float(np.linalg.norm(self.gap))


@dataclass(frozen=True)
class Alignment:
    """base: (4, 4) from b's base frame to a's. fits: one per paired joint. cost: the less, the more coincides."""

    base: Array
    fits: tuple[Fit, ...]
    cost: float


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
            coms[k] = (_apply(poses_a[i], com_a), _apply(poses_b[j], com_b))
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


def _apply(transform: Array, points: Array) -> Array:
    return points @ transform[:3, :3].T + transform[:3, 3]


def line_distance(axis_a: Array, point_a: Array, axis_b: Array, point_b: Array) -> tuple[Array, Array]:
    """Angle [rad] (0 to pi/2) between lines (..., 3), and the vector (..., 3) [m] from line b to point_a, across line
    b."""
    next_, last = [1, 2, 0], [2, 0, 1]  # np.cross spends most of its time on checks
    cross = axis_a[..., next_] * axis_b[..., last] - axis_a[..., last] * axis_b[..., next_]
    angle = np.arctan2(np.sqrt((cross * cross).sum(-1)), np.abs((axis_a * axis_b).sum(-1)))
    gap = point_a - point_b
    return angle, gap - (gap * axis_b).sum(-1, keepdims=True) * axis_b


def line_cost(
    f: Features, carry: Array, wanted: list[int], other: list[int] | None = None, scale: float = SCALE
) -> Array:
    """Robust cost (k,) of b's lines `other`, carried over, against a's lines `wanted`."""
    other = wanted if other is None else other
    axes, points = f.axes_b[other] @ carry[:3, :3].T, _apply(carry, f.points_b[other])
    angle, gap = line_distance(f.axes_a[wanted], f.points_a[wanted], axes, points)
    distance = np.sqrt((gap * gap).sum(-1))
    if any(f.slide):
        distance = distance * ~np.array([f.slide[k] for k in wanted], bool)
    return _robust(np.hypot(LEVER * angle, distance), scale)


def _robust(distance: Array, scale: float = SCALE) -> Array:
    """Nearly flat beyond the scale [m] (Geman & McClure 1985), so that features count by whether they coincide; a faint
    slope remains."""
    squared = (np.asarray(distance) / scale) ** 2
    return 10 * squared / (1 + squared) + 0.3 * np.log1p(squared)


def _turn(frame: Array) -> float:
    return float(np.arctan2(np.linalg.norm(frame - frame.T) / np.sqrt(8), (np.trace(frame) - 1) / 2))


def _frame_cost(
    conventions: Iterable[Array], frame_a: Array, frame_b: Array, carry: Array, scale: float = SCALE
) -> float:
    """Cost of the link frame's constant transform being none of the conventions that this hand has used so far."""
    actual = inverse(frame_a) @ carry @ frame_b
    best = np.inf
    for convention in conventions:
        best = min(best, _differs(convention, actual))
    return float(_robust(best, scale))


def _differs(first: Array, second: Array) -> float:
    """Size [m] of the motion between two transforms, angles weighed by LEVER."""
    rest = inverse(first) @ second
    return float(np.hypot(LEVER * _turn(rest[:3, :3]), np.linalg.norm(rest[:3, 3])))


def align(f: Features, base: Array | None = None) -> Alignment:
    """Align b with a under their pairing. base: (4, 4) from b's base frame to a's, estimated where it is not given."""
    base = base_transform(f) if base is None else base
    carries: dict[int, Array] = {-1: base}
    conventions: dict[int, Array] = {}
    conventions[-1] = _convention(f, -1, base)
    fits, total = [], 0.0
    for k in range(len(f.names)):
        before = f.parent[k]
        up, held = carries[before], conventions[before]
        # A link frame is evidence only where this hand's frames follow a rule: none is turned, or all alike.
        rule = any(
            _differs(held, other) < 1e-4 for other in (np.eye(4), conventions[f.parent[before] if before >= 0 else -1])
        )
        fit = _fit(f, k, up, [np.eye(4), held], 0.5 if rule else 0.1)
        fits.append(fit)
        carries[k], conventions[k] = fit.carry, _convention(f, k, fit.carry)
        total += float(line_cost(f, up, [k])[0]) + 2.0 * (abs(fit.offset) > 1e-9) + (fit.sign < 0)
        total += 0.3 * sum(
            _frame_cost([np.eye(4), conventions[f.parent[k]]], *frame[:2], fit.carry) for frame in f.frames.get(k, [])
        )
    return Alignment(base, tuple(fits), total)


def _convention(f: Features, k: int, carry: Array) -> Array:
    own = next((frame for frame in f.frames.get(k, []) if frame[4]), None)
    return np.eye(4) if own is None else inverse(own[0]) @ carry @ own[1]


def _fit(f: Features, k: int, up: Array, conventions: list[Array], frame_weight: float) -> Fit:
    axis, point = f.axes_a[k], f.points_a[k]
    axis_b, point_b = f.axes_b[k] @ up[:3, :3].T, _apply(up, f.points_b[k])
    angle, gap = line_distance(axis, point, axis_b, point_b)
    sign = -1 if axis @ axis_b < 0 else 1
    if f.slide[k]:
        gap = np.zeros(3)
    starts = [(up, False)]
    if angle > 1e-12 or np.linalg.norm(gap) > 1e-12:
        starts.append((_follow(axis, axis_b * sign, point_b, gap) @ up, True))
    points = [(x[:3, 3], y[:3, 3], 1.0) for x, y, _, _, own in f.frames.get(k, []) if not own]
    points += [(*f.coms[k], 0.5)] if k in f.coms else []
    frames = [(x, y) for x, y, _, _, own in f.frames.get(k, []) if own]
    direct = f.children.get(k, [])
    deeper = [j for j in f.below(k) if j not in direct]

    scale = _scale(f, [k, *direct])

    def farther(carry: Array) -> float:
        out = float(line_cost(f, carry, direct, scale=scale).sum()) if direct else 0.0
        out += 0.2 * float(line_cost(f, carry, deeper, scale=scale).sum()) if deeper else 0.0
        return out + sum(w * float(_robust(np.linalg.norm(x - _apply(carry, y)), scale)) for x, y, w in points)

    def cost(carry: Array) -> float:
        return farther(carry) + frame_weight * sum(_frame_cost(conventions, x, y, carry, scale) for x, y in frames)

    best = None
    if farther(up) + (cost(up) - farther(up)) * (frame_weight > 0.1) < 0.5:  # everything beyond is in place
        best, starts = (0.0, up, 0.0, 0.0, False, False), []
    for start, follows in starts:
        offsets = [0.0] if f.slide[k] else [0.0, *_offsets(f, axis, point, start, direct, points, frames)]
        for offset in offsets:
            turned = about(axis, point, offset) @ start if offset else start
            for advance in [0.0, *_advances(f, axis, turned, direct, points, frames)]:
                moved = pose(np.eye(3), advance * axis) @ turned if advance else turned
                price = cost(moved) + 4.0 * (offset != 0) + 5.0 * (advance != 0) + 0.1 * follows
                if best is None or price < best[0] - 1e-9:
                    best = (price, moved, offset, advance, follows, farther(start) > farther(moved) + 2.0)
    _, carry, offset, advance, follows, seen = best
    if f.slide[k]:
        offset, advance = -advance, 0.0
    return Fit(float(angle), gap, sign, float(offset), float(advance), follows, carry, _reach(f, k), seen)


def _scale(f: Features, joints: list[int]) -> float:
    """Distance [m] within which features coincide, given the last digits that both files write at these joints."""
    slack = (f.slack_a + f.slack_b)[joints] @ [1.0, LEVER]
    return float(np.clip(3 * slack.max(), SCALE, 1e-5))


def _reach(f: Features, k: int) -> float:
    ends = [f.points_a[j] for j in f.below(k)] + [x[:3, 3] for x, *_ in f.frames.get(k, [])]
    return max([LEVER, *(float(np.linalg.norm(e - f.points_a[k])) for e in ends)])


def about(axis: Array, point: Array, angle: float) -> Array:
    """Transform (4, 4) that turns by angle [rad] about the line through point (3,) [m] along the unit axis (3,)."""
    rotation = rotation_about(axis, angle)
    return pose(rotation, point - rotation @ point)


def _follow(axis: Array, axis_b: Array, point_b: Array, gap: Array) -> Array:
    """The smallest motion that lays b's line on a's: a tilt about their common normal and a shift across."""
    normal = np.cross(axis_b, axis)
    length = np.linalg.norm(normal)
    tilt = np.eye(4)
    if length > 1e-12:
        tilt = about(normal / length, point_b, float(np.arctan2(length, axis_b @ axis)))
    return pose(np.eye(3), gap - (gap @ axis) * axis) @ tilt


def _offsets(f: Features, axis, point, carry, direct, points, frames) -> list[float]:
    """Turns about the axis that lay one feature of the link beyond on its partner."""
    found = []
    for j in direct:
        u, v = f.axes_a[j], carry[:3, :3] @ f.axes_b[j]
        if np.linalg.norm(np.cross(axis, u)) > 0.05:
            found += [_turn_between(axis, v, u), _turn_between(axis, -v, u)]
        p, q = f.points_a[j], _apply(carry, f.points_b[j])
        if not f.slide[j]:
            found.append(_turn_between(axis, _foot(q - point, v), _foot(p - point, u)))
    found += [_turn_between(axis, _apply(carry, q) - point, p - point) for p, q, _ in points]
    for x, y in frames:
        difference = x[:3, :3] @ (carry @ y)[:3, :3].T
        skew = np.array(
            [
                difference[2, 1] - difference[1, 2],
                difference[0, 2] - difference[2, 0],
                difference[1, 0] - difference[0, 1],
            ]
        )
        found.append(float(np.arctan2(skew @ axis / 2, (np.trace(difference) - axis @ difference @ axis) / 2)))
    return [o for o in _distinct(found) if abs(o) > 1e-9]


def _distinct(values: list[float]) -> list[float]:
    out: list[float] = []
    for v in values:
        if np.isfinite(v) and all(abs(v - o) > 1e-10 for o in out):
            out.append(v)
    return out


def _foot(vector: Array, direction: Array) -> Array:
    """The vector from a point to the nearest point of a line, given one to any of its points."""
    return vector - (vector @ direction) * direction


def _turn_between(axis: Array, start: Array, end: Array) -> float:
    s, e = start - (start @ axis) * axis, end - (end @ axis) * axis
    if min(np.linalg.norm(s), np.linalg.norm(e)) < 1e-6:
        return 0.0
    return float(np.arctan2(axis @ np.cross(s, e), s @ e))


def _advances(f: Features, axis, carry, direct, points, frames) -> list[float]:
    found = []
    for j in direct:
        u = f.axes_a[j]
        across = axis - (axis @ u) * u
        size = across @ across
        if size > 0.01 and not f.slide[j]:
            found.append(float((f.points_a[j] - _apply(carry, f.points_b[j])) @ across / size))
    found += [float((p - _apply(carry, q)) @ axis) for p, q, _ in points]
    found += [float((x[:3, 3] - _apply(carry, y[:3, 3])) @ axis) for x, y in frames]
    return [h for h in _distinct(found) if abs(h) > 1e-9]


def base_transform(f: Features) -> Array:
    """The one transform (4, 4) from b's base frame to a's: none, if the first joints agree under it; else the best
    supported.

    Hypotheses come from pairs of lines (RANSAC, Fischler & Bolles 1981, here exhaustive); lines at the base count
    first.
    """
    roots = f.children.get(-1, [])
    fixed = f.frames.get(-1, [])[1:]
    plain = line_cost(f, np.eye(4), roots)
    points = sum(float(_robust(np.linalg.norm(x[:3, 3] - y[:3, 3]))) for x, y, *_ in fixed)
    if 2 * int((plain < 15.5).sum()) >= len(roots) or (len(roots) == 1 and f.parent != f.parent_b):
        return np.eye(4)
    everything = list(range(len(f.names)))

    def price(carry: Array) -> float:
        near = sum(float(_robust(np.linalg.norm(x[:3, 3] - _apply(carry, y[:3, 3])))) for x, y, *_ in fixed)
        return float(line_cost(f, carry, roots).sum()) + 0.2 * float(line_cost(f, carry, everything).sum()) + near

    best = (float(plain.sum()) + 0.2 * float(line_cost(f, np.eye(4), everything).sum()) + points - 2.0, np.eye(4))
    pool = roots if len(roots) > 2 else everything
    for n, i in enumerate(pool):
        for j in pool[n + 1 :]:
            for carry in _from_two_lines(f, i, j):
                if (cost := price(carry)) < best[0] - 1e-9:
                    best = (cost, carry)
                if best[0] < 0.01:  # everything coincides: no other hypothesis does better
                    return _unless_slight(f, best[1])
    return _unless_slight(f, best[1])


def _unless_slight(f: Features, carry: Array) -> Array:
    """With one joint at the base nothing tells its change from a base frame's; a slight one is a change, not a
    convention."""
    slight = (
        len(f.children.get(-1, [])) == 1
        and _turn(carry[:3, :3]) < SLIGHT_RAD
        and np.linalg.norm(carry[:3, 3]) < SLIGHT_M
    )
    return np.eye(4) if slight else carry


def _from_two_lines(f: Features, i: int, j: int) -> list[Array]:
    """Transforms that lay lines i and j of b on those of a, for either direction of each."""
    out = []
    u, v = f.axes_a[i], f.axes_a[j]
    normal, (p, q) = np.cross(u, v), (f.points_a[i], f.points_a[j])
    parallel = np.linalg.norm(normal) < 0.02
    third = _foot(q - p, u) if parallel else normal
    for s in (1, -1):
        for t in (1, -1):
            x, y = s * f.axes_b[i], t * f.axes_b[j]
            gap = f.points_b[j] - f.points_b[i]
            other = _foot(gap, x) if parallel else np.cross(x, y)
            if min(np.linalg.norm(third), np.linalg.norm(other)) < 1e-6:
                continue
            a = np.stack([u, third / np.linalg.norm(third), np.zeros(3) if parallel else v])
            b = np.stack([x, other / np.linalg.norm(other), np.zeros(3) if parallel else y])
            rotation, _ = kabsch(b, a)
            across = [np.eye(3) - np.outer(w, w) for w in (u, v)]
            matrix = np.concatenate(across)
            right = np.concatenate(
                [c @ (g - rotation @ h) for c, g, h in zip(across, (p, q), f.points_b[[i, j]], strict=True)]
            )
            out.append(pose(rotation, np.linalg.lstsq(matrix, right, rcond=1e-9)[0]))
    return out


def mirrored(f: Features) -> Features:
    """The same features with b reflected in its xz plane (axes are axial vectors, so they turn over as well)."""
    flip = np.diag([1.0, -1.0, 1.0])
    return Features(
        f.names, f.axes_a, f.points_a, -f.axes_b @ flip, f.points_b @ flip, f.parent, f.parent_b, f.slide,
        {-1: f.frames[-1][:1]}, {}, f.slack_a, f.slack_b, f.children,
    )  # fmt: skip
