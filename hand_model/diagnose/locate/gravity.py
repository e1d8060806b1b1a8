"""Gravity as a finger sees it: in the plane of its first joint, while the palm turns in the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...errors import IdentificationError, SessionError
from ...identify.chain import Chain, palm_pose
from ...identify.clock import align
from ...identify.finger import observations
from ...session import Session, Trial
from .angles import FingerAngles
from .motion import local_quadratic

Array = NDArray[np.float64]

SMOOTH_S = 0.1  # the palm turns slowly
TURNED = 0.12  # spread of gravity's direction below which a weight is as good as a function of position: seven degrees


def with_gravity(
    session: Session, fingers: Mapping[str, FingerAngles], states: tuple[DriveState, ...]
) -> tuple[DriveState, ...]:
    """The states with `gravity_along` and `gravity_across` [m/s^2] in `extra`: gravity along the open finger and across
    it, and `sweep` [rad], the angles that the finger's first joint and all together turn through over the range,
    where a flexion shows them.

    fingers: by name. Recordings with markers have `pose_seen`; those without get `pose_unseen` instead, their number
    from 0. Unchanged where the session names no gravity, where no recording shows the palm, or where it never turned.
    """
    seen, sweep = _seen(session, fingers, states)
    if not _turned(session, seen):
        return states
    out, unseen = [], 0
    for state in states:
        extra: dict[str, Array] = {**state.extra, **_swept(state, sweep)}
        if state.trial in seen:
            extra["gravity_along"], extra["gravity_across"] = seen[state.trial].T
            extra["pose_seen"] = np.ones(len(state.time_s))
        else:
            extra["pose_unseen"] = np.full(len(state.time_s), float(unseen))
            unseen += 1
        out.append(replace(state, extra=extra))
    return tuple(out)


def in_one_pose(
    session: Session, fingers: Mapping[str, FingerAngles], states: tuple[DriveState, ...]
) -> tuple[DriveState, ...] | None:
    """The states with gravity as `with_gravity` has it, taken to be the same in all recordings, those without markers
    too; None where the palm was never seen, or turned."""
    seen, sweep = _seen(session, fingers, states)
    if not seen or _turned(session, seen):
        return None
    along, across = np.concatenate(list(seen.values())).mean(0)

    def posed(state: DriveState) -> DriveState:
        one = np.ones(len(state.time_s))
        gravity = {"gravity_along": along * one, "gravity_across": across * one, "pose_seen": one}
        return replace(state, extra={**state.extra, **gravity, **_swept(state, sweep)})

    return tuple(posed(s) for s in states)


def _seen(
    session: Session, fingers: Mapping[str, FingerAngles], states: tuple[DriveState, ...]
) -> tuple[dict[str, Array], Array | None]:
    """Trial -> gravity (n, 2) in the finger's plane, of the recordings that show the palm, and the angles (2,) [rad] over
    the range of positions, of the first joint and of all."""
    if session.gravity_world is None:
        return {}, None
    trials = {t.name: t for t in session.trials}
    found = {s.trial: f for s in states if (f := _in_finger(session, fingers, trials[s.trial], s)) is not None}
    sweeps = [sweep for _, sweep in found.values() if sweep is not None]
    return {trial: gravity for trial, (gravity, _) in found.items()}, np.median(sweeps, axis=0) if sweeps else None


def _swept(state: DriveState, sweep: Array | None) -> dict[str, Array]:
    return {} if sweep is None else {"sweep": np.tile(sweep, (len(state.time_s), 1))}


def _turned(session: Session, seen: Mapping[str, Array]) -> bool:
    if not seen:
        return False
    everything = np.concatenate(list(seen.values()))
    return float(np.linalg.norm(everything.std(0))) >= TURNED * float(np.linalg.norm(session.gravity_world))


def _in_finger(
    session: Session, fingers: Mapping[str, FingerAngles], trial: Trial, state: DriveState
) -> tuple[Array, Array | None] | None:
    """Gravity (n, 2) in the finger's plane at the state's samples, and the angles (2,) [rad] over the range of positions
    where the finger flexed; None without markers or with clocks that do not align."""
    if trial.mocap_path is None or trial.finger not in fingers:
        return None
    angles = fingers[trial.finger]
    mocap, chain = trial.mocap(), angles.chain
    data, _ = observations(session, angles.finger, mocap)
    record = next((r for r in angles.records if r.trial.name == trial.name), None)
    if record is not None:
        time_s, flexed = record.mocap.time_s, record.angle_rad[:, 0]
    else:
        tip, base = (np.nanmean(data.position_world[:, data.body == k], axis=1) for k in (data.body.max(), 0))
        # a finger's reach shrinks as it flexes, a thumb's may grow
        time_s, flexed = mocap.time_s, -np.linalg.norm(tip - base, axis=1)
    good = np.isfinite(flexed)
    clock = None
    for course in (flexed, -flexed) if record is None else (flexed,):
        try:
            clock = align(time_s[good], course[good], state.time_s, state.position, trial.name)
            break
        except (IdentificationError, SessionError):
            continue
    if clock is None:
        return None
    gravity_palm = np.einsum("nij,i->nj", palm_pose(chain, data).rotation, session.gravity_world)
    smooth = np.stack(
        [local_quadratic(mocap.time_s, g, SMOOTH_S)[0] for g in (gravity_palm @ plane(chain).T).T], axis=-1
    )
    at = clock.log_time(mocap.time_s)
    gravity = np.stack([np.interp(state.time_s, at, g) for g in smooth.T], axis=-1)
    if record is None:
        return gravity, None
    position = np.interp(clock.log_time(time_s[good]), state.time_s, state.position)
    turned = np.stack([flexed, record.angle_rad.sum(1)], axis=-1)[good]
    known = np.isfinite(turned).all(1)
    return gravity, 100 * np.polyfit(position[known], turned[known], 1)[0] if known.any() else None


def plane(chain: Chain) -> Array:
    """Unit vectors (2, 3) in the palm, in the plane of the first joint: along the open finger, and where flexion takes
    it."""
    axis = chain.axis_palm[0]
    arm = (chain.centre_palm[1] if len(chain.centre_palm) > 1 else chain.marker_palm[-1]) - chain.centre_palm[0]
    along = arm - axis * (axis @ arm)
    along = along / np.linalg.norm(along)
    return np.stack([along, np.cross(axis, along)])
