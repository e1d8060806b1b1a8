"""How one joint of a description lies against its partner: another line, another zero, another place along the axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .coincidence import LEVER, SCALE, frame_cost, line_cost, robust
from .features import Features
from .lines import about, foot, line_distance, turn_between
from .tree import Array, pose, transformed


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


def fit_joint(f: Features, k: int, up: Array, conventions: list[Array], frame_weight: float) -> Fit:
    """Fit paired joint k, given the transform `up` (4, 4) from b to a of the link before it.

    conventions: transforms (4, 4) that link frames of this hand differ by so far; frame_weight: how much they count.
    """
    axis, point = f.axes_a[k], f.points_a[k]
    axis_b, point_b = f.axes_b[k] @ up[:3, :3].T, transformed(up, f.points_b[k])
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
        return out + sum(w * float(robust(np.linalg.norm(x - transformed(carry, y)), scale)) for x, y, w in points)

    def cost(carry: Array) -> float:
        return farther(carry) + frame_weight * sum(frame_cost(conventions, x, y, carry, scale) for x, y in frames)

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
            found += [turn_between(axis, v, u), turn_between(axis, -v, u)]
        p, q = f.points_a[j], transformed(carry, f.points_b[j])
        if not f.slide[j]:
            found.append(turn_between(axis, foot(q - point, v), foot(p - point, u)))
    found += [turn_between(axis, transformed(carry, q) - point, p - point) for p, q, _ in points]
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


def _advances(f: Features, axis, carry, direct, points, frames) -> list[float]:
    found = []
    for j in direct:
        u = f.axes_a[j]
        across = axis - (axis @ u) * u
        size = across @ across
        if size > 0.01 and not f.slide[j]:
            found.append(float((f.points_a[j] - transformed(carry, f.points_b[j])) @ across / size))
    found += [float((p - transformed(carry, q)) @ axis) for p, q, _ in points]
    found += [float((x[:3, 3] - transformed(carry, y[:3, 3])) @ axis) for x, y in frames]
    return [h for h in _distinct(found) if abs(h) > 1e-9]
