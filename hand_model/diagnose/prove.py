"""Proof of a finding: the compiled files, as they were and as patched, replayed on recordings that took no part."""

from __future__ import annotations

from collections.abc import Sequence
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
RESAMPLES = 1000


def proved(finding: Finding, station: Any, before: Path, after: Path) -> dict[str, Any]:
    """`fit` of a finding from the folders `before` and `after`; as it was, saying why, where they cannot be replayed.

    station: where it was named, None for what was read from events.
    """
    if station is None or station.signal != "current" or not effect(finding.effect).of_the_hand:
        return {**finding.fit, "note": effect(finding.effect).unwritten or "not replayed"}
    from .inverse import current_along, read_motor

    motors = [read_motor(folder, station.actuator) for folder in (before, after)]
    if None in motors:
        return {**finding.fit, "note": f'no compiled file has a motor "{station.actuator}"'}
    states = kept_out(station.naming.balance.states)
    every = effect(finding.effect).warps or effect(finding.effect).replaces
    errors: list[list[Array]] = []
    for motor in motors:
        errors.append([(s.effort - current_along(motor, s))[_used(s, bool(every))] for s in states])
    blocks = [_blocks(s)[_used(s, bool(every))] for s in states]
    return {**finding.fit, **reduction(errors[0], errors[1], blocks), "engine": INVERSE,
            "held_out": [s.trial for s in states if s.validate]}


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
