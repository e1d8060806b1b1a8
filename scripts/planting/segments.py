"""What joints and linkage do otherwise: segments turned about their joints. Angles in rad, lengths in m."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .plant import Array, Draw, Motor, Plant, Seen, about, turned_over

BRISTLE = 0.6  # [%] in which dry friction turns over, either way


def turned(seen: Seen, proximal: Array, distal: Array) -> Array:
    """Markers (n, m, 3) of a finger whose joints have turned by so much (n,) more."""
    out = seen.position.copy()
    upper, lower = seen.segments
    for rows, joint, angle in ((lower, 1, distal), (np.concatenate([upper, lower]), 0, proximal)):
        out[:, rows] = about(out[:, rows], seen.axis[joint] * angle[:, None], seen.centre[joint])
    return out


def play(values: Array, half: float) -> Array:
    """Values (n,) behind a gap of twice `half`."""
    out = np.zeros(len(values))
    out[0] = values[0] + half
    for k in range(1, len(values)):
        out[k] = min(max(out[k - 1], values[k] - half), values[k] + half)
    return out


def _both(seen: Seen, lost: Array) -> Array:
    """The proximal joint turned by so much (n,), and the distal one as it follows it."""
    coupled = _coupled(seen)
    return turned(seen, lost, coupled(seen.angle[0] + lost) - coupled(seen.angle[0]))


def _coupled(seen: Seen) -> Callable[[Array], Array]:
    known = np.isfinite(seen.angle[0]) & np.isfinite(seen.angle[1])
    return np.polynomial.Polynomial.fit(seen.angle[0][known], seen.angle[1][known], 2)


def _load(seen: Seen, motor: Motor) -> Array:
    """What the drive bears (n,) [raw] as the proximal joint moves."""
    place = 100 * seen.angle[0] / motor.full_rad
    speed = np.gradient(place, seen.time_s)
    friction = motor.coulomb * turned_over(place, BRISTLE) + motor.viscous * speed
    return motor.stiffness * place + motor.preload + friction + seen.load


def drive_backlash(rng: Draw, size: float, motor: Motor) -> Plant:
    """A gap between motor and proximal joint."""
    half = size * rng.uniform(0.012, 0.028)
    return Plant(markers=lambda s: _both(s, play(s.angle[0], half) - s.angle[0]), figures={"half_gap": half})


def series_elasticity(rng: Draw, size: float, motor: Motor) -> Plant:
    """A drive that yields under load."""
    give = size * rng.uniform(0.0003, 0.0006)
    return Plant(markers=lambda s: _both(s, -give * _load(s, motor)), figures={"give": give})


def linkage_backlash(rng: Draw, size: float, motor: Motor) -> Plant:
    """A gap between proximal and distal joint."""
    half = size * rng.uniform(0.012, 0.03)
    return Plant(
        markers=lambda s: turned(s, 0 * s.angle[0], play(s.angle[1], half) - s.angle[1]), figures={"half_gap": half}
    )


def linkage_compliance(rng: Draw, size: float, motor: Motor) -> Plant:
    """A linkage that yields under load."""
    give = size * rng.uniform(0.0004, 0.0007)
    return Plant(markers=lambda s: turned(s, 0 * s.angle[0], -give * _load(s, motor)), figures={"give": give})


def coupling_deadband(rng: Draw, size: float, motor: Motor) -> Plant:
    """A distal joint that starts late."""
    band = size * rng.uniform(0.1, 0.22)

    def late(s: Seen) -> Array:
        coupled = _coupled(s)
        return turned(s, 0 * s.angle[0], coupled(np.maximum(s.angle[0] - band, 0.0)) - coupled(s.angle[0]))

    return Plant(markers=late, figures={"band": band})


def distal_stop(rng: Draw, size: float, motor: Motor) -> Plant:
    """A distal joint that stops early."""
    share = 1 - size * rng.uniform(0.1, 0.22)

    def stopped(s: Seen) -> Array:
        limit = share * float(np.nanpercentile(s.angle[1], 99))
        return turned(s, 0 * s.angle[0], np.minimum(s.angle[1], limit) - s.angle[1])

    return Plant(markers=stopped, figures={"share": share})


def joint_wobble(rng: Draw, size: float, motor: Motor) -> Plant:
    """A joint whose axis tilts to and fro."""
    joint, tilt, waves = int(rng.integers(2)), size * rng.uniform(0.025, 0.06), rng.uniform(2.0, 6.0)
    phase, way = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)

    def tilted(s: Seen) -> Array:
        return _moved(s, joint, way, lambda angle: (tilt * np.sin(waves * angle + phase), 0 * angle))

    return Plant(markers=tilted, figures={"joint": joint, "tilt": tilt, "waves": waves})


def moving_centre(rng: Draw, size: float, motor: Motor) -> Plant:
    """A joint whose centre travels."""
    joint, travel = int(rng.integers(2)), size * rng.choice([-1, 1]) * 1e-3 * rng.uniform(1.2, 2.8)
    way = rng.uniform(0, 2 * np.pi)

    def travelled(s: Seen) -> Array:
        return _moved(s, joint, way, lambda angle: (0 * angle, travel * angle / np.nanmax(angle)))

    return Plant(markers=travelled, figures={"joint": joint, "travel": travel})


def _moved(s: Seen, joint: int, way: float, how: Callable[[Array], tuple[Array, Array]]) -> Array:
    """Segments from a joint on tilted (n,) about a direction across its axis that is fixed in what bears it, and shifted
    (n,) along that."""
    bearing = (s.palm_turn, s.proximal_turn)[joint]
    axis = np.einsum("nij,ni->nj", bearing, s.axis[joint]).mean(0)
    first = np.cross(axis, [0.3, 0.1, 0.9])
    first /= np.linalg.norm(first)
    across = bearing @ (np.cos(way) * first + np.sin(way) * np.cross(axis, first))
    tilt, shift = how(s.angle[joint])
    rows = np.concatenate(s.segments[joint:])
    out = s.position.copy()
    out[:, rows] = about(out[:, rows], across * tilt[:, None], s.centre[joint]) + (across * shift[:, None])[:, None]
    return out


SEGMENTS = (
    drive_backlash,
    series_elasticity,
    linkage_backlash,
    linkage_compliance,
    coupling_deadband,
    distal_stop,
    joint_wobble,
    moving_centre,
)
