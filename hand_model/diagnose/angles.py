"""Encoder and linkage stations: joint angles from markers against encoder counts, and against each other.

The chain of each finger comes from `identify`; validation recordings are posed with that chain, never fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..effects.base import DriveState
from ..errors import IdentificationError
from ..identify.chain import Chain, ChainData, Pose
from ..identify.finger import REST_S, observations, sound_frames
from ..identify.likelihood import fit_chain, fit_poses
from ..identify.repair import Swap
from ..identify.start import start_chain
from ..session import Finger, Mocap, Session, Trial
from .drive import count_range
from .motion import estimate_motion, local_quadratic

Array = NDArray[np.float64]

LEARN_FRAMES = 1500  # of each recording, evenly spaced: enough for a chain, all frames are posed with it


@dataclass(frozen=True)
class FlexionAngles:
    """One flexion recording of one finger. angle_rad: (n, k), nan in frames that do not tell. swaps: labels put right.
    data: markers as recorded, labels put right. pose: of every frame, by the identified chain."""

    trial: Trial
    mocap: Mocap
    angle_rad: Array
    swaps: tuple[Swap, ...]
    data: ChainData
    pose: Pose


@dataclass(frozen=True)
class FingerAngles:
    """One finger: its chain (angles zero at rest), the marker noise [m], and all its flexion recordings in session order."""

    finger: Finger
    chain: Chain
    noise_m: float
    records: tuple[FlexionAngles, ...]


def finger_angles(session: Session, finger: Finger, shape: Array) -> FingerAngles:
    """Chain of one finger from its training recordings as they are (nothing split or dropped: that is the diagnosis's
    part), and its angles in every flexion recording.

    shape: (3, 3) [m] palm markers (`identify.palm_shape`). Raises IdentificationError where no recording tells the chain.
    """
    trials = [t for t in session.select("flexion", finger.name) if t.mocap_path is not None]
    if not trials:
        raise IdentificationError(f'{session.path}: finger "{finger.name}" has no flexion trial with markers')
    seen = [(t, t.mocap()) for t in trials]
    observed = [observations(session, finger, mocap) for _, mocap in seen]
    learn = [i for i, (t, _) in enumerate(seen) if not t.validate] or list(range(len(seen)))
    parts, rest, count = [], [], 0
    for i in learn:
        step = max(1, len(seen[i][1].time_s) // LEARN_FRAMES)
        parts.append(observed[i][0].position_world[::step])
        rest.append(count + np.flatnonzero(seen[i][1].time_s[::step] < REST_S))
        count += len(parts[-1])
    data = ChainData(np.concatenate(parts), observed[0][0].body, observed[0][0].labels)
    still = np.concatenate(rest)
    fit = fit_chain(data, start_chain(data, still, shape))
    zero = np.median(fit.pose.angle_rad[still], axis=0)
    chain = fit.chain.at(zero, data.body)
    records = []
    for (trial, mocap), (markers, swaps) in zip(seen, observed, strict=True):
        pose, weight = fit_poses(markers, chain, fit.noise_m)
        angle = np.where(sound_frames(markers, weight)[:, None], pose.angle_rad, np.nan)
        records.append(FlexionAngles(trial, mocap, angle, swaps, markers, pose))
    return FingerAngles(finger, chain, fit.noise_m, tuple(records))


def linkage_states(angles: FingerAngles, joint: int = 1, steps: Sequence[tuple[int, float]] = ()) -> tuple[DriveState, ...]:
    """Balance of a follower: its angle [deg] against a quartic of its driver's angle [deg], one state per recording."""
    states = []
    name = angles.finger.segments[joint].name
    scale = max(float(np.rad2deg(np.nanmax(np.abs(r.angle_rad[:, joint - 1])))) for r in angles.records)
    for index, record in enumerate(angles.records):
        good = np.isfinite(record.angle_rad).all(1)
        if good.sum() < 200:
            continue
        t, q = record.mocap.time_s[good], np.rad2deg(record.angle_rad[good])
        motion = estimate_motion(t, q[:, joint - 1])
        # The declared columns take the angle as it was read, so that its noise stays white; at rest that noise is all there
        # is to see, and regressing on it would show a slope that is not there.
        raw = q[:, joint - 1]
        stepped, more = _stepped(index, t, steps)
        declared = np.concatenate([np.stack([(raw / scale) ** k for k in range(5)], axis=-1), stepped], axis=1)
        follower = np.where(motion.moving, q[:, joint], np.nan)
        extra = {"trial_index": np.full(len(t), float(index)), "load": _load(record, t)}
        extra["slope"] = _slope(motion.position, raw, q[:, joint], motion.moving, 4)
        states.append(DriveState(record.trial.name, f"{angles.finger.name}/{name}", t, motion.position, motion.velocity,
                                 motion.acceleration, follower, declared, "deg", "deg", _known(extra), (*_names(4), *more), record.trial.validate))
    return tuple(states)


def encoder_states(
    angles: FingerAngles, low: float, high: float, steps: Sequence[tuple[int, float]] = ()
) -> tuple[DriveState, ...]:
    """Balance of the encoder: proximal angle [deg] against a cubic of position [%], at the log's samples.

    low, high: counts at 0 and 100 %. Each recording has its own clock offset, as a column of the velocity; the clocks'
    rates are taken as equal (another rate is an effect).
    """
    from ..identify.clock import align

    records = [r for r in angles.records if r.trial.log_path is not None]
    states = []
    for index, record in enumerate(records):
        log = record.trial.log()
        clock = align(record.mocap.time_s, record.angle_rad[:, 0], log.time_s, log.column("position"), record.trial.name)
        middle = 0.5 * (log.time_s[0] + log.time_s[-1])
        shift = float(np.interp(middle, clock.log_time(record.mocap.time_s), record.mocap.time_s)) - middle
        seen = np.isfinite(log.column("position")) & np.r_[True, np.diff(log.time_s) > 0]
        t = log.time_s[seen]
        motion = estimate_motion(t, 100 * (log.column("position")[seen] - low) / (high - low))
        good = np.isfinite(record.angle_rad[:, 0])
        at = t + shift
        q = np.interp(at, record.mocap.time_s[good], np.rad2deg(record.angle_rad[good, 0]))
        near = np.interp(at, record.mocap.time_s, good.astype(float)) > 0.999
        inside = (at > record.mocap.time_s[0]) & (at < record.mocap.time_s[-1]) & near
        x = motion.position / 100
        offsets = np.zeros((len(t), len(records)))
        offsets[:, index] = motion.velocity
        declared = np.concatenate([np.stack([x**k for k in range(4)], axis=-1), offsets], axis=1)
        stepped, more = _stepped(index, at, steps)
        declared = np.concatenate([declared, stepped], axis=1)
        current = log.columns.get("current")
        extra = {"trial_index": np.full(len(t), float(index)), "clock_s": t - middle}
        if current is not None and np.isfinite(current).all():
            extra["load"] = local_quadratic(t, current[seen], 0.05)[0]
        effort = np.where(inside, q, np.nan)
        extra["slope"] = _slope(motion.position, motion.position, q, inside, 3)
        states.append(DriveState(record.trial.name, angles.finger.name, t, motion.position, motion.velocity, motion.acceleration,
                                 effort, declared, "%", "deg", extra,
                                 (*_names(3), *(f"offset_{i}" for i in range(len(records))), *more), record.trial.validate))
    return tuple(states)


def _stepped(record: int, time_s: Array, steps: Sequence[tuple[int, float]]) -> tuple[Array, tuple[str, ...]]:
    """Columns (n, s) that are one from a moment of a record on, in the records after it too, and their names."""
    columns = [np.full(len(time_s), float(record > r)) if record != r else (time_s >= at).astype(float) for r, at in steps]
    names = tuple(f"step_{i}" for i in range(len(steps)))
    return np.stack(columns, axis=-1) if columns else np.zeros((len(time_s), 0)), names


def _slope(at: Array, driver: Array, follower: Array, use: NDArray[np.bool_], order: int) -> Array:
    """Slope (n,) at `at` of the polynomial that maps driver to follower."""
    from numpy.polynomial import Polynomial

    return Polynomial.fit(driver[use], follower[use], order).deriv()(at)


def _names(order: int) -> tuple[str, ...]:
    return tuple(f"power_{k}" for k in range(order + 1))


def _known(extra: dict[str, Array | None]) -> dict[str, Array]:
    return {name: values for name, values in extra.items() if values is not None}


def _load(record: FlexionAngles, time_s: Array) -> Array | None:
    """Smoothed motor current at mocap times, where a log with current is there."""
    from ..identify.clock import align

    if record.trial.log_path is None:
        return None
    log = record.trial.log()
    current = log.columns.get("current")
    if current is None or not np.isfinite(current).all() or not np.isfinite(log.column("position")).all():
        return None
    clock = align(record.mocap.time_s, record.angle_rad[:, 0], log.time_s, log.column("position"), record.trial.name)
    return np.interp(clock.log_time(time_s), log.time_s, local_quadratic(log.time_s, current, 0.05)[0])


def ranges_of_counts(session: Session) -> dict[str, tuple[float, float]]:
    """Actuator -> counts at 0 and 100 %, as the drive balance has them."""
    from .drive import drive_trials

    return {a: count_range([t.log() for t in trials]) for a, trials in drive_trials(session).items()}
