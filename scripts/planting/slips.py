"""What markers do that their segments do not. Lengths in m, angles in rad, times as shares of a trial."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from .plant import Array, Draw, Motor, Plant, Seen, about


def _direction(rng: Draw) -> Array:
    way = rng.standard_normal(3)
    return way / np.linalg.norm(way)


def _since(seen: Seen, begin: float) -> Array:
    return (seen.time_s > begin * seen.time_s[-1]).astype(float)


def _turns(seen: Seen, segment: int) -> Array:
    """Orientation (n, 3, 3) of a segment in the world."""
    if segment == 0:
        return seen.proximal_turn
    spin = Rotation.from_rotvec(seen.axis[1] * seen.angle[1][:, None]).as_matrix()
    return spin @ seen.proximal_turn


def marker_slip(rng: Draw, size: float, motor: Motor) -> Plant:
    """A marker that shifts on its segment during each trial."""
    segment, index, begin = int(rng.integers(2)), int(rng.integers(3)), rng.uniform(0.2, 0.7)
    shift = size * 1e-3 * rng.uniform(1.0, 2.2) * _direction(rng)

    def slipped(s: Seen) -> Array:
        out = s.position.copy()
        out[:, s.segments[segment][index]] += (_turns(s, segment) @ shift) * _since(s, begin)[:, None]
        return out

    return Plant(markers=slipped, figures={"segment": segment, "index": index, "begin": begin})


def support_slip(rng: Draw, size: float, motor: Motor) -> Plant:
    """A markers' support that turns on its segment during each trial."""
    segment, begin = int(rng.integers(2)), rng.uniform(0.2, 0.7)
    way = size * rng.choice([-1, 1]) * rng.uniform(0.03, 0.08) * _direction(rng)

    def slipped(s: Seen) -> Array:
        rows, out = s.segments[segment], s.position.copy()
        vector = _turns(s, segment) @ way * _since(s, begin)[:, None]
        out[:, rows] = about(out[:, rows], vector, s.centre[segment])
        return out

    return Plant(markers=slipped, figures={"segment": segment, "begin": begin})


def palm_marker_slip(rng: Draw, size: float, motor: Motor) -> Plant:
    """A marker of the palm that shifts during each trial."""
    index, begin = int(rng.integers(3)), rng.uniform(0.2, 0.7)
    shift = size * 1e-3 * rng.uniform(1.0, 2.5) * _direction(rng)

    def slipped(s: Seen) -> Array:
        out = s.position.copy()
        out[:, s.palm[index]] += (s.palm_turn @ shift) * _since(s, begin)[:, None]
        return out

    return Plant(markers=slipped, figures={"index": index, "begin": begin})


def marker_swap(rng: Draw, size: float, motor: Motor) -> Plant:
    """Two of a segment's markers that are taken for each other for a while."""
    segment, begin, length = int(rng.integers(2)), rng.uniform(0.15, 0.7), size * rng.uniform(0.04, 0.15)
    one, other = (int(i) for i in rng.permutation(3)[:2])

    def swapped(s: Seen) -> Array:
        out, share = s.position.copy(), s.time_s / s.time_s[-1]
        now = (share > begin) & (share < begin + length)
        a, b = s.segments[segment][one], s.segments[segment][other]
        out[np.ix_(now, [a, b])] = out[np.ix_(now, [b, a])]
        return out

    return Plant(markers=swapped, figures={"segment": segment, "begin": begin, "length": length})


SLIPS = (marker_slip, support_slip, palm_marker_slip, marker_swap)
