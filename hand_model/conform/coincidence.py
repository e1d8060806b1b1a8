"""Robust costs: whether features of two descriptions coincide, rather than how far apart they are."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .features import Features
from .lines import line_distance, rotation_angle
from .tree import Array, inverse, transformed

LEVER = 0.03
"""Length [m] by which angles are weighed against distances: a phalanx."""
SCALE = 1e-7
"""Distance [m] beyond which a feature counts as not coinciding."""


def line_cost(
    f: Features, carry: Array, wanted: list[int], other: list[int] | None = None, scale: float = SCALE
) -> Array:
    """Robust cost (k,) of b's lines `other`, carried over, against a's lines `wanted`."""
    other = wanted if other is None else other
    axes, points = f.axes_b[other] @ carry[:3, :3].T, transformed(carry, f.points_b[other])
    angle, gap = line_distance(f.axes_a[wanted], f.points_a[wanted], axes, points)
    distance = np.sqrt((gap * gap).sum(-1))
    if any(f.slide):
        distance = distance * ~np.array([f.slide[k] for k in wanted], bool)
    return robust(np.hypot(LEVER * angle, distance), scale)


def robust(distance: Array, scale: float = SCALE) -> Array:
    """Cost (...) of distances (...) [m]: nearly flat beyond the scale [m] (Geman & McClure 1985), so that features
    count by whether they coincide; a faint slope remains."""
    squared = (np.asarray(distance) / scale) ** 2
    return 10 * squared / (1 + squared) + 0.3 * np.log1p(squared)


def frame_cost(
    conventions: Iterable[Array], frame_a: Array, frame_b: Array, carry: Array, scale: float = SCALE
) -> float:
    """Cost of the link frame's constant transform being none of the conventions that this hand has used so far; all
    transforms (4, 4)."""
    actual = inverse(frame_a) @ carry @ frame_b
    best = np.inf
    for convention in conventions:
        best = min(best, differs(convention, actual))
    return float(robust(best, scale))


def differs(first: Array, second: Array) -> float:
    """Size [m] of the motion between two transforms (4, 4), angles weighed by LEVER."""
    rest = inverse(first) @ second
    return float(np.hypot(LEVER * rotation_angle(rest[:3, :3]), np.linalg.norm(rest[:3, 3])))
