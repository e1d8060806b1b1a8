"""How the palm wanders before the cameras."""

from __future__ import annotations

import numpy as np

from .geometry import Array, turns
from .session import Session

SHIFT_HZ = (0.05, 0.16, 0.37)
TURN_HZ = (0.07, 0.19, 0.43)


def before_cameras(rng: np.random.Generator, session: Session, times: Array, points: Array) -> Array:
    """Points (n, k, 3) [mm] of the landmark frame in the cameras' frame, at times [s], with noise and gaps (NaN)."""
    turned, place = palm_poses(rng, session, times)
    return seen(rng, session, turned, place, points)


def palm_poses(rng: np.random.Generator, session: Session, times: Array) -> tuple[Array, Array]:
    """Turns (n, 3, 3) and places (n, 3) [mm] of the landmark frame at times [s]."""
    wander = session.laboratory.wander
    angles = np.zeros((len(times), 3))
    shifts = np.zeros((len(times), 3))
    for hertz in SHIFT_HZ:
        wave = np.sin(2 * np.pi * hertz * times + rng.uniform(0, 2 * np.pi))[:, None]
        shifts += wave * rng.normal(0, 2.0, 3) * wander
    for hertz in TURN_HZ:
        wave = np.sin(2 * np.pi * hertz * times + rng.uniform(0, 2 * np.pi))[:, None]
        angles += wave * np.radians(rng.normal(0, 0.5, 3)) * wander
    return turns(angles) @ session.hand.turned, session.hand.place + shifts


def seen(rng: np.random.Generator, session: Session, turned: Array, place: Array, points: Array) -> Array:
    """Points (n, k, 3) [mm] in the cameras' frame with noise, NaN in gaps of 3 to 19 frames."""
    laboratory = session.laboratory
    out = np.einsum("nij,nkj->nki", turned, points) + place[:, None]
    out = out + rng.normal(0, laboratory.marker_noise, points.shape)
    frames = len(out)
    for k in range(out.shape[1]):
        for _ in range(rng.poisson(laboratory.gap_rate * frames / laboratory.mocap_hz)):
            begin = int(rng.integers(0, frames))
            out[begin : begin + int(rng.integers(3, 20)), k] = np.nan
    return out
