"""The base frames of two descriptions, one over the other."""

from __future__ import annotations

import numpy as np

from ..rotation import kabsch
from .coincidence import line_cost, robust
from .features import Features
from .lines import foot, rotation_angle
from .tree import Array, pose, transformed

SLIGHT_RAD, SLIGHT_M = 0.2, 0.01
"""Below these, two base frames are meant to be the same: conventions differ by whole frames."""


def base_transform(f: Features) -> Array:
    """The one transform (4, 4) from b's base frame to a's: none, if the first joints agree under it; else the best
    supported.

    Hypotheses come from pairs of lines (RANSAC, Fischler & Bolles 1981, here exhaustive); lines at the base count
    first.
    """
    roots = f.children.get(-1, [])
    fixed = f.frames.get(-1, [])[1:]
    plain = line_cost(f, np.eye(4), roots)
    points = sum(float(robust(np.linalg.norm(x[:3, 3] - y[:3, 3]))) for x, y, *_ in fixed)
    if 2 * int((plain < 15.5).sum()) >= len(roots) or (len(roots) == 1 and f.parent != f.parent_b):
        return np.eye(4)
    everything = list(range(len(f.names)))

    def price(carry: Array) -> float:
        near = sum(float(robust(np.linalg.norm(x[:3, 3] - transformed(carry, y[:3, 3])))) for x, y, *_ in fixed)
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
        and rotation_angle(carry[:3, :3]) < SLIGHT_RAD
        and np.linalg.norm(carry[:3, 3]) < SLIGHT_M
    )
    return np.eye(4) if slight else carry


def _from_two_lines(f: Features, i: int, j: int) -> list[Array]:
    """Transforms that lay lines i and j of b on those of a, for either direction of each."""
    out = []
    u, v = f.axes_a[i], f.axes_a[j]
    normal, (p, q) = np.cross(u, v), (f.points_a[i], f.points_a[j])
    parallel = np.linalg.norm(normal) < 0.02
    third = foot(q - p, u) if parallel else normal
    for s in (1, -1):
        for t in (1, -1):
            x, y = s * f.axes_b[i], t * f.axes_b[j]
            gap = f.points_b[j] - f.points_b[i]
            other = foot(gap, x) if parallel else np.cross(x, y)
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
