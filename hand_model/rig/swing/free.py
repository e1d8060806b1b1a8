"""Free swings of a session, run side by side by their half swings."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .friction import dry_friction
from .halves import FARTHEST, MOST, Forces, amplitude, motion, tabulated
from .simulation import Swing, constants, instants, vector

Array = NDArray[np.float64]
SAMPLES_AT_ONCE = 300_000
NEWTON_STEPS, LEAST_PULL = 8, 1e-2  # to where a swing rests; of its weight


@lru_cache(maxsize=64)
def swings_free(swing: Swing) -> bool:
    """Whether all that moves the joint is its weight, and it turns round: then half swings are known by themselves."""
    if swing.driven or not (swing.sine or swing.cosine):
        return False
    theta = np.repeat(vector(swing.initial)[None], len(swing.lanes), 0)
    forces = _forces(swing, theta, np.arange(len(swing.lanes)))
    far = [np.abs(lane.position - r).max() for lane, r in zip(swing.lanes, forces.rest, strict=True)]
    q, v = np.array([lane.start for lane in swing.lanes]).T
    return bool(max(*far, *amplitude(forces, q, v)) < FARTHEST)


def free_errors(swing: Swing, theta: Array, lanes: Array, starts: Array | None = None) -> Array:
    """Simulated minus recorded position (steps, L), zero where nothing was recorded, of L runs: run l is stretch
    lanes[l] under theta[l], (L, len(PARAMETERS)), from starts[l] = (angle, velocity), (L, 2) (None: the stretch's own).
    Runs of one law go fastest side by side."""
    starts = np.array([swing.lanes[i].start for i in lanes]) if starts is None else starts
    out = np.zeros((max(len(swing.lanes[i].position) for i in lanes), len(lanes)))
    size = np.cumsum([len(swing.lanes[i].position) for i in lanes]) // SAMPLES_AT_ONCE
    for part in np.split(np.arange(len(lanes)), 1 + np.flatnonzero(np.diff(size))):
        for k, run in zip(part, _runs(swing, theta[part], lanes[part], starts[part]), strict=True):
            lane = swing.lanes[lanes[k]]
            left = np.nan_to_num(run - lane.position, nan=1e1, posinf=1e1, neginf=-1e1)
            out[: len(run), k] = np.clip(left, -1e1, 1e1) * lane.used
    return out


def _runs(swing: Swing, theta: Array, lanes: Array, starts: Array) -> list[Array]:
    """Positions of runs at their stretches' samples."""
    chosen = [swing.lanes[i] for i in lanes]
    own = np.array([(c.coulomb_scale, c.more_inertia, *(c.weight or (swing.sine, swing.cosine))) for c in chosen])
    every = np.concatenate([theta, own], 1)
    new = np.append(True, np.any(every[1:] != every[:-1], 1))
    law, first = np.cumsum(new) - 1, np.flatnonzero(new)
    forces = _forces(swing, theta[first], lanes[first])
    times = [instants(swing, c) for c in chosen]
    far = max(float(np.abs(c.position - r).max()) for c, r in zip(chosen, forces.rest[law], strict=True))
    largest = max(far, float(amplitude(forces.shaped(law), *starts.T).max()))
    most = int(MOST * 2.0 * max(t[-1] for t in times) / swing.period_s) + 8
    with np.errstate(all="ignore"):  # steps of a fit may lead where nothing swings
        return motion(forces, law, tabulated(forces, largest), tuple(starts.T), times, most)


def _forces(swing: Swing, theta: Array, lanes: Array) -> Forces:
    """What acts on runs side by side, (L,)."""
    p, has = constants(swing, theta, lanes)
    offset, weight, none = p["offset"], -p["weight"], np.zeros(len(lanes))
    inertia = swing.step_s / p["hi"]
    still = dry_friction(p, has, none, none, None) if has["dry"] else p["coulomb"]
    rest = np.arcsin(np.clip(offset / weight, -0.9, 0.9)) - p["phase"]
    usual = np.array([np.mean(swing.lanes[i].position) for i in lanes])
    rest, slope = rest + 2 * np.pi * np.round((usual - rest) / (2 * np.pi)), weight
    if has["stiffness"]:
        rest, slope = _beside_spring(weight, p["phase"], p["stiffness"], offset, rest)
    rate = np.sqrt(slope / inertia)
    return Forces(weight, p["phase"], offset, inertia, rest, still / slope, rate, swing.leapfrog_s, p, has)


def _beside_spring(weight: Array, phase: Array, stiffness: Array, offset: Array, rest: Array) -> tuple[Array, Array]:
    """Where weight, spring and offset balance (L,) [rad], by Newton's steps from rest (L,), and what pulls back there (L,)
    [N m/rad]: a step of a fit may ask for a spring that pushes harder than the weight pulls, and swings nowhere."""

    def pull(at: Array) -> Array:
        return np.maximum(weight * np.cos(at + phase) + stiffness, LEAST_PULL * weight)

    for _ in range(NEWTON_STEPS):
        left = offset - weight * np.sin(rest + phase) - stiffness * rest
        rest = rest + np.clip(left / pull(rest), -0.5, 0.5)
    return rest, pull(rest)


__all__ = ["free_errors", "swings_free"]
