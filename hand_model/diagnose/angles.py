"""Encoder and linkage stations: joint angles from markers against encoder counts, and against each other.

The chain of each finger comes from `identify`; validation recordings are posed with that chain, never fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..effects.base import DriveState
from ..identify.chain import Chain, ChainData, Pose
from ..identify.finger import FingerFit, identify_finger, observations, sound_frames
from ..identify.identification import palm_shape
from ..identify.likelihood import fit_poses
from ..identify.repair import Swap
from ..session import Finger, Mocap, Session, Trial
from .drive import count_range
from .motion import estimate_motion, local_quadratic

Array = NDArray[np.float64]


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
    """One finger: the fit of its chain and all its flexion recordings, validation ones included."""

    finger: Finger
    fit: FingerFit
    records: tuple[FlexionAngles, ...]


def finger_angles(session: Session, finger: Finger, shape: Array | None = None) -> FingerAngles:
    """Angles of one finger in every flexion recording; raises IdentificationError as `identify_finger` does."""
    fit = identify_finger(session, finger, palm_shape(session) if shape is None else shape)
    records = []
    for record in fit.records:
        frames = np.arange(record.frames.start, record.frames.stop)
        good = sound_frames(fit.fit.data.take(frames), fit.fit.weight[frames])
        data, swaps = observations(session, finger, record.mocap)  # as recorded: the fit may have split or dropped a marker
        pose = fit.fit.pose.take(frames)
        angle = np.where(good[:, None], pose.angle_rad, np.nan)
        records.append(FlexionAngles(record.trial, record.mocap, angle, swaps, data, pose))
    for trial in session.select("flexion", finger.name, validate=True):
        if trial.mocap_path is None:
            continue
        mocap = trial.mocap()
        data, swaps = observations(session, finger, mocap)
        chain = plain_chain(fit, data.labels, latest=True)
        pose, weight = fit_poses(data, chain, fit.fit.noise_m)
        angle = np.where(sound_frames(data, weight)[:, None], pose.angle_rad, np.nan)
        records.append(FlexionAngles(trial, mocap, angle, swaps, data, pose))
    return FingerAngles(finger, fit, tuple(records))


def plain_chain(fit: FingerFit, labels: tuple[str, ...], latest: bool = False) -> Chain:
    """The chain with one column per label: a marker that slipped where it was seen most often (or last)."""
    seen = np.isfinite(fit.fit.data.position_world[..., 0]).sum(0)
    pick = []
    for label in labels:
        epochs = [j for j, name in enumerate(fit.fit.data.labels) if name == label and seen[j] > 0]
        pick.append(epochs[-1] if latest else max(epochs, key=lambda j: seen[j]))
    return Chain(fit.fit.chain.marker_palm[pick], fit.fit.chain.axis_palm, fit.fit.chain.centre_palm)


def linkage_states(angles: FingerAngles, joint: int = 1) -> tuple[DriveState, ...]:
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
        follower = np.where(motion.moving, q[:, joint], np.nan)
        extra = {"trial_index": np.full(len(t), float(index)), "load": _load(record, t)}
        extra["slope"] = _slope(motion.position, raw, q[:, joint], motion.moving, 4)
        states.append(DriveState(record.trial.name, f"{angles.finger.name}/{name}", t, motion.position, motion.velocity,
                                 motion.acceleration, follower, np.stack([(raw / scale) ** k for k in range(5)], axis=-1),
                                 "deg", "deg", _known(extra), _names(4), record.trial.validate))
    return tuple(states)


def encoder_states(angles: FingerAngles, low: float, high: float) -> tuple[DriveState, ...]:
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
        current = log.columns.get("current")
        extra = {"trial_index": np.full(len(t), float(index)), "clock_s": t - middle}
        if current is not None and np.isfinite(current).all():
            extra["load"] = local_quadratic(t, current[seen], 0.05)[0]
        effort = np.where(inside, q, np.nan)
        extra["slope"] = _slope(motion.position, motion.position, q, inside, 3)
        states.append(DriveState(record.trial.name, angles.finger.name, t, motion.position, motion.velocity, motion.acceleration,
                                 effort, declared, "%", "deg", extra,
                                 (*_names(3), *(f"offset_{i}" for i in range(len(records)))), record.trial.validate))
    return tuple(states)


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
