"""Proof of a finding: the compiled files, as they were and as patched, replayed on recordings that took no part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...background import Background
from ...effects import effect
from ...effects.base import DriveState
from ...effects.path import strokes
from ..findings import Finding
from ..name.reread import of_recording
from ..name.samples import SETTLED
from ..reduction import reduction

Array = NDArray[np.float64]
Place = tuple[str, str | None, str | None, str | None]  # signal, finger, joint, actuator of a station
Errors = Mapping[tuple[Place, str], tuple[Array | None, Array | None]]  # before and after, by station and recording

INVERSE = "mujoco: mj_inverse of the compiled motor along the recorded motion"
FORWARD = "mujoco: the compiled finger simulated, its driver on the recorded path"


@dataclass(frozen=True)
class Replay:
    """Residuals of two compiled files along the recordings kept out: position, velocity, before, after (n,), units,
    noise of a sample, names of the recordings."""

    finding: Finding
    position: Array
    velocity: Array
    before: Array
    after: Array
    position_unit: str
    unit: str
    noise: float
    trials: tuple[str, ...]


def untouched(finding: Finding, station: Any) -> tuple[DriveState, ...]:
    """The recordings on which a finding is proved by replay; none where it cannot be replayed. station: where it was
    named, or None."""
    kind = effect(finding.effect)
    if station is None or not kind.of_the_hand or kind.unwritten:
        return ()
    return kept_out(tuple(s for s in station.naming.balance.states if kind.told_by(s)))


def errors_along(wanted: Sequence[tuple[Any, Sequence[DriveState]]], before: Path, after: Path) -> Errors:
    """Recorded minus replayed (n,) by station and recording, of the folders `before` and `after`; two replays at a
    time.

    wanted: stations and recordings, each of which is replayed once, however many effects are named there.
    """
    once = {(_place(station), s.trial): (station, s) for station, states in wanted for s in states}
    calls = [
        (_place(station), folder, of_recording(fit, state), state)
        for station, state in once.values()
        for folder, fit in ((before, station.reading.declared), (after, station.reading.fit))
    ]
    errors = list(Background(_error, calls).results())
    return {key: (errors[2 * i], errors[2 * i + 1]) for i, key in enumerate(once)}


def proved(finding: Finding, station: Any, errors: Errors) -> tuple[dict[str, Any], Replay | None]:
    """`fit` of a finding from the errors of the compiled files along its recordings, and their replay; as it was,
    saying why, where they cannot be replayed.

    station: where it was named, None for what was read from events.
    """
    kind, states = effect(finding.effect), untouched(finding, station)
    if not states:
        return {**finding.fit, "note": kind.unwritten or "read from events, not from a balance"}, None
    pairs = [errors[_place(station), s.trial] for s in states]
    if any(e is None for pair in pairs for e in pair):
        return {**finding.fit, "note": "no compiled file has its motor or its joint"}, None
    every = bool(kind.warps or kind.replaces)
    used = [_used(s, every, station.naming.balance.sigma) for s in states]
    r0, r1 = ([pair[k][u] for pair, u in zip(pairs, used, strict=True)] for k in (0, 1))
    blocks = [_blocks(s)[u] for s, u in zip(states, used, strict=True)]
    granted = np.concatenate(
        [s.extra.get("sigma", np.zeros(len(s.time_s)))[u] for s, u in zip(states, used, strict=True)]
    )
    floor = float(np.hypot(station.naming.balance.sigma, np.sqrt(np.mean(granted**2))))
    fit = {
        **finding.fit,
        **reduction(r0, r1, blocks),
        "noise_floor": floor,
        "engine": INVERSE if station.signal == "current" else FORWARD,
        "held_out": [s.trial for s in states if s.validate],
    }
    x, v = (
        np.concatenate([getattr(s, k)[u] for s, u in zip(states, used, strict=True)]) for k in ("position", "velocity")
    )
    return fit, Replay(
        finding,
        x,
        v,
        np.concatenate(r0),
        np.concatenate(r1),
        states[0].position_unit,
        states[0].effort_unit,
        station.naming.balance.sigma,
        tuple(s.trial for s in states),
    )


def _place(station: Any) -> Place:
    return station.signal, station.finger, station.joint, station.actuator


def _error(place: Place, folder: Path, own: Array, state: DriveState) -> Array | None:
    """Recorded minus replayed (n,): current [raw] of the compiled motor, or angle [deg] of the compiled joint; less
    what belongs to the recording itself, `own` (n,). None where no file has the motor or the joint."""
    signal, finger, joint, actuator = place
    if signal == "current":
        from .inverse import current_along, read_motor

        motor = read_motor(folder, str(actuator))
        return None if motor is None else state.effort - own - current_along(motor, state)
    from .forward import follower_along

    where = {"finger": finger, "joint": joint, "actuator": actuator}
    moved = follower_along(folder, state, where, "encoder" if signal == "encoder" else "linkage")
    if moved is None:
        return None
    return state.effort - own - np.rad2deg(moved)


def kept_out(states: Sequence[DriveState]) -> tuple[DriveState, ...]:
    """The validation recordings, all recordings where there are none."""
    return tuple(s for s in states if s.validate) or tuple(states)


def _used(state: DriveState, every: bool, noise: float) -> NDArray[np.bool_]:
    """Samples (n,) that are compared: steady ones, as a balance of that noise has them, or every sliding one for what
    acts at starts and stops."""
    if every:
        return np.isfinite(state.effort) & (state.extra.get("slides", np.ones(len(state.time_s))) > 0)
    seen = np.isfinite(state.effort) & (state.extra.get("steady", np.ones(len(state.time_s))) > 0)
    return seen & (state.extra.get("sigma", np.zeros(len(seen))) <= SETTLED * noise)


def _blocks(state: DriveState) -> NDArray[np.int64]:
    """Number (n,) of the stroke that each sample belongs to."""
    out = np.zeros(len(state.time_s), int)
    for k, (a, b, _) in enumerate(strokes(state.position)):
        out[a:b] = k
    return out
