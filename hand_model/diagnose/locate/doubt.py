"""What is not known of a drive's effort where it starts and stops: when it did, and how its friction turns over.

Friction may hold anything up to its bound there; how far the recorded effort is from what is declared says how much of
that is so. A drive whose bristles and instants are as declared is as sure there as elsewhere.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...effects.path import from_rest
from .measurement import coefficients

Array = NDArray[np.float64]

START_DOUBT = 0.1  # of the Coulomb friction: what the give of other bristles than the session's would change
TOLD_S = 2e-3  # to which the instants of a simulated motion are known
FEWEST = 20  # samples of a drive in motion, of which anything can be said
REACH, BLURRED = 2.0, 6.0  # bristle lengths, and times the noise of the position, within which friction turns over
LONGER = 1.6  # times the bristles of one healthy drive, at most, another's are
LEAST_GIVE = 0.12  # [%] differences of bristles below this are within what starts tell
PARTS = (0.0, 0.125, 0.25, 0.5, 1.0)  # of that reach, within which departures are alike
FEW, SURE = 8, 2.0  # samples of a part, and standard errors by which its departures may be larger
ALIKE = 2.0  # times what departures are: at one start they all err together, which independent ones do not


def with_doubt(states: tuple[DriveState, ...]) -> tuple[DriveState, ...]:
    """Adds "slides", zero where a drive rests or has not left its place, and "sigma" [effort], zero in steady motion
    where that is smoothed.

    That is what timing means for the declared prediction (half a sample interval around starts and stops; TOLD_S all
    along a simulated motion), what is not known of friction while it turns over, and, within `REACH` of where a drive
    rests, what its effort departs from the declared one beyond noise, at most all that friction may hold.
    states: of one drive, with their "give" and "granted".
    """
    seen = [np.isfinite(s.effort) for s in states]
    if sum(int(m.sum()) for m in seen) < FEWEST:
        return states
    declared, effort = (
        np.concatenate([v[m] for v, m in zip(values, seen, strict=True)])
        for values in ([s.declared for s in states], [s.effort for s in states])
    )
    beta = coefficients(declared, effort)
    names = states[0].declared_names
    friction = float(beta[names.index("coulomb")])
    ways = [_from_rests(s, m) for s, m in zip(states, seen, strict=True)]
    departing = _departing(states, seen, effort - declared @ beta, ways, friction)
    out = []
    for state, far, near in zip(states, ways, departing, strict=True):
        held = far.min(0) < 1
        sigma = np.hypot(_of_timing(state, beta, friction), np.where(held, near, 0.0))
        out.append(replace(state, extra={**state.extra, "sigma": sigma, "slides": 1.0 - held}))
    return tuple(out)


def _of_timing(state: DriveState, beta: Array, friction: float) -> Array:
    """Standard deviation (n,) of the declared effort by its instants, and by how friction turns over."""
    step = float(np.median(np.diff(state.time_s)))
    slope = np.abs(np.gradient(state.declared @ beta, state.time_s))
    slope = np.maximum.reduce([np.roll(slope, k) for k in (-2, -1, 0, 1, 2)])
    turning = state.extra["steady"] <= 0
    timing = 0.5 * step * turning if state.extra["smoothed"][0] else TOLD_S
    return np.hypot(timing * slope, START_DOUBT * friction * turning)


def _from_rests(state: DriveState, seen: NDArray[np.bool_]) -> Array:
    """Distance (2, n) from where the drive rested last and to where it rests next, in reaches of its friction."""
    own = min(float(state.extra["granted"][0]), max(LONGER * float(state.extra["give"][0]), LEAST_GIVE))
    reach = max(REACH * own, BLURRED * float(state.extra["position_noise"][0]))
    return np.stack([from_rest(state.position, seen), from_rest(state.position[::-1], seen[::-1])[::-1]]) / reach


def _departing(
    states: tuple[DriveState, ...], seen: list[NDArray[np.bool_]], residual: Array, ways: list[Array], friction: float
) -> list[Array]:
    """How far the effort may be from the declared one (n,) by its distances from rests, for each recording: of samples
    alike in that, after starts and before stops apart. residual: of all samples in motion."""
    noise = _noise(states, seen, residual)
    out = [np.where(m, 0.0, friction) for m in seen]
    for which in (0, 1):
        far = np.concatenate([way[which][m] for way, m in zip(ways, seen, strict=True)])
        for low, high in pairwise(PARTS):
            own = residual[(far >= low) & (far < high)]
            above = np.mean(own**2) * (1 + SURE * np.sqrt(2 / len(own))) - noise**2 if len(own) >= FEW else np.inf
            most = min(ALIKE * float(np.sqrt(max(above, 0.0))), friction)
            for way, doubt in zip(ways, out, strict=True):
                part = (way[which] >= low) & (way[which] < high)
                doubt[part] = np.maximum(doubt[part], most)
    return out


def _noise(states: tuple[DriveState, ...], seen: list[NDArray[np.bool_]], residual: Array) -> float:
    """Standard deviation of the effort's noise, by neighbours in steady motion (von Neumann 1941); zero where there are
    too few."""
    steady = np.concatenate([s.extra["steady"][m] > 0 for s, m in zip(states, seen, strict=True)])
    together = np.concatenate([np.diff(np.flatnonzero(m), prepend=-2) == 1 for m in seen])
    pair = steady[1:] & steady[:-1] & together[1:]
    return float(np.sqrt(np.mean(np.diff(residual)[pair] ** 2) / 2)) if pair.sum() > FEWEST else 0.0
