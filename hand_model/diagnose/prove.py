"""Proof of a finding: the compiled files, as they were and as patched, replayed on recordings that took no part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import effect
from ..effects.base import DriveState
from ..effects.path import strokes
from .findings import Finding

Array = NDArray[np.float64]

INVERSE = "mujoco: mj_inverse of the compiled motor along the recorded motion"
FORWARD = "mujoco: the compiled finger simulated, its driver on the recorded path"
RESAMPLES = 1000


@dataclass(frozen=True)
class Replay:
    """Residuals of two compiled files along the recordings kept out: position, velocity, before, after (n,), units, noise of a
    sample, names of the recordings."""

    finding: Finding
    position: Array
    velocity: Array
    before: Array
    after: Array
    position_unit: str
    unit: str
    noise: float
    trials: tuple[str, ...]


def proved(finding: Finding, station: Any, before: Path, after: Path) -> tuple[dict[str, Any], Replay | None]:
    """`fit` of a finding from the folders `before` and `after`, and their replay; as it was, saying why, where they cannot be
    replayed.

    station: where it was named, None for what was read from events.
    """
    kind = effect(finding.effect)
    if station is None or not kind.of_the_hand or kind.unwritten:
        return {**finding.fit, "note": kind.unwritten or "read from events, not from a balance"}, None
    states = kept_out(tuple(s for s in station.naming.balance.states if kind.told_by(s)))
    replay = _currents if station.signal == "current" else _angles
    errors = [replay(station, finding, folder, fit, states)
              for folder, fit in ((before, station.reading.declared), (after, station.reading.fit))]
    if errors[0] is None or errors[1] is None:
        return {**finding.fit, "note": "no compiled file has its motor or its joint"}, None
    every = bool(kind.warps or kind.replaces)
    used = [_used(s, every) for s in states]
    r0, r1 = ([e[u] for e, u in zip(error, used, strict=True)] for error in errors)
    blocks = [_blocks(s)[u] for s, u in zip(states, used, strict=True)]
    granted = np.concatenate([s.extra.get("sigma", np.zeros(len(s.time_s)))[u] for s, u in zip(states, used, strict=True)])
    floor = float(np.hypot(station.naming.balance.sigma, np.sqrt(np.mean(granted**2))))
    fit = {**finding.fit, **reduction(r0, r1, blocks), "noise_floor": floor, "engine": INVERSE if station.signal == "current" else FORWARD,
           "held_out": [s.trial for s in states if s.validate]}
    x, v = (np.concatenate([getattr(s, k)[u] for s, u in zip(states, used, strict=True)]) for k in ("position", "velocity"))
    return fit, Replay(finding, x, v, np.concatenate(r0), np.concatenate(r1), states[0].position_unit, states[0].effort_unit,
                       station.naming.balance.sigma, tuple(s.trial for s in states))


def _currents(station: Any, finding: Finding, folder: Path, fit: Any, states: Sequence[DriveState]) -> list[Array] | None:
    """Current recorded minus what the compiled motor needs (n,) [raw], per recording."""
    from .inverse import current_along, read_motor

    motor = read_motor(folder, station.actuator)
    return None if motor is None else [s.effort - current_along(motor, s) for s in states]


def _angles(station: Any, finding: Finding, folder: Path, fit: Any, states: Sequence[DriveState]) -> list[Array] | None:
    """Angle recorded minus that of the compiled joint (n,) [deg], per recording; less what belongs to the recording itself, its
    clock's offset and steps of slipped markers."""
    from .forward import follower_along

    out = []
    where = {"finger": station.finger, "joint": station.joint, "actuator": station.actuator}
    for state in states:
        moved = follower_along(folder, state, where, "encoder" if station.signal == "encoder" else "linkage")
        if moved is None:
            return None
        own = [i for i, name in enumerate(state.declared_names) if not name.startswith("power_")]
        nuisance = state.declared[:, own] @ np.array([fit.declared[state.declared_names[i]] for i in own])
        out.append(state.effort - nuisance - np.rad2deg(moved))
    return out


def kept_out(states: Sequence[DriveState]) -> tuple[DriveState, ...]:
    """The validation recordings, all recordings where there are none."""
    return tuple(s for s in states if s.validate) or tuple(states)


def _used(state: DriveState, every: bool) -> NDArray[np.bool_]:
    """Samples (n,) that are compared: steady ones, or every moving one for what acts at starts and stops."""
    steady = np.ones(len(state.time_s)) if every else state.extra.get("steady", np.ones(len(state.time_s)))
    return np.isfinite(state.effort) & (steady > 0)


def _blocks(state: DriveState) -> NDArray[np.int64]:
    """Number (n,) of the stroke that each sample belongs to."""
    out = np.zeros(len(state.time_s), int)
    for k, (a, b, _) in enumerate(strokes(state.position)):
        out[a:b] = k
    return out


def reduction(before: Sequence[Array], after: Sequence[Array], blocks: Sequence[NDArray[np.int64]], seed: int = 0) -> dict[str, Any]:
    """Root mean square error before and after, and the 95 % interval of its reduction by a bootstrap over blocks.

    before, after: errors (n,) of each recording; blocks: (n,) numbers of its blocks.
    """
    count = np.cumsum([0, *(int(b.max()) + 1 if len(b) else 0 for b in blocks)])
    block = np.concatenate([b + c for b, c in zip(blocks, count, strict=False)])
    _, block = np.unique(block, return_inverse=True)
    r0, r1 = np.concatenate(before) ** 2, np.concatenate(after) ** 2
    n, s0, s1 = (np.bincount(block, v) for v in (np.ones(len(block)), r0, r1))
    pick = np.random.default_rng(seed).integers(0, len(n), (RESAMPLES, len(n)))
    size = n[pick].sum(1)
    gain = np.sqrt(s0[pick].sum(1) / size) - np.sqrt(s1[pick].sum(1) / size)
    return {"before": float(np.sqrt(r0.mean())), "after": float(np.sqrt(r1.mean())),
            "ci95_reduction": np.percentile(gain, [2.5, 97.5]).tolist()}
