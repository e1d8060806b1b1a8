"""Encoder and linkage stations: joint angles from markers against encoder counts, and against each other.

The chain of each finger comes from `identify`; validation recordings are posed with that chain, never fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...errors import IdentificationError
from ...identify.chain import Chain, ChainData, Pose
from ...identify.finger import REST_S, observations, sound_frames
from ...identify.likelihood import OUTLIER_LIMIT, fit_chain, fit_poses
from ...identify.repair import Swap
from ...identify.start import start_chain
from ...session import Finger, Mocap, Session, Trial
from ..name.naming import Naming
from .drive import count_range
from .driver_angle import LogAtFrames, driver_angle, foresee, lasting
from .excursions import with_excursions
from .ghosts import ghosts
from .load import PassedOn, transmitted_loads, with_likelier_load
from .motion import estimate_motion, position_at, sure_acceleration, told_between

Array = NDArray[np.float64]

LEARN_FRAMES = 1500  # of each recording, evenly spaced: enough for a chain, all frames are posed with it
FIRST_SAMPLES, BEGUN = 5, 0.05  # of a recording, and the share of the range from which lost motion is closed
FARTHEST_M = 6e-3  # a residual beyond is a ghost or a wrong label, no slip
MOMENT_S = 0.2  # within which a step's moment is known
LEAST_TURN = np.deg2rad(6.0)  # of a joint: a finger that turns less is held, and its axis is noise


@dataclass(frozen=True)
class Step:
    """From time_s [s] of a record on, to the end of record `last`, an angle reads another value."""

    record: int
    time_s: float
    last: int

    def acts(self, record: int, time_s: Array) -> Array:
        """(n,) one while it lasts, at times [s] of a record, else zero."""
        if record == self.record:
            return (time_s >= self.time_s).astype(float)
        return np.full(len(time_s), float(self.record < record <= self.last))


@dataclass(frozen=True)
class FlexionAngles:
    """One flexion recording of one finger. angle_rad: (n, k), nan in frames that do not tell. swaps: labels put right.
    data: markers as recorded, labels put right. pose: of every frame, by the identified chain. ghost: (n,) frames in
    which a label sits on something else."""

    trial: Trial
    mocap: Mocap
    angle_rad: Array
    swaps: tuple[Swap, ...]
    data: ChainData
    pose: Pose
    ghost: NDArray[np.bool_]


@dataclass(frozen=True)
class FingerAngles:
    """One finger: its chain (angles zero at rest), the marker noise [m], and all its flexion recordings in session
    order."""

    finger: Finger
    chain: Chain
    noise_m: float
    records: tuple[FlexionAngles, ...]


def finger_angles(session: Session, finger: Finger, shape: Array) -> FingerAngles:
    """Chain of one finger from its training recordings as they are (nothing split or dropped: that is the diagnosis's
    part), and its angles in every flexion recording.

    shape: (3, 3) [m] palm markers (`identify.palm_shape`). Raises IdentificationError where no recording tells the
    chain, or none turns the first joint far enough to tell its axis.
    """
    trials = [t for t in session.select("flexion", finger.name) if t.mocap_path is not None]
    if not trials:
        raise IdentificationError(f'{session.path}: finger "{finger.name}" has no flexion trial with markers')
    mocaps = [t.mocap() for t in trials]
    observed = [observations(session, finger, mocap) for mocap in mocaps]
    recordings = [_Recording(*r) for r in zip(trials, mocaps, *zip(*observed, strict=True), strict=True)]
    data, still = _learned_from(recordings)
    angles = _posed(finger, recordings, start_chain(data, still, shape))
    first = [r.angle_rad[np.isfinite(r.angle_rad[:, 0]), 0] for r in angles.records]
    turned = max((float(np.ptp(np.percentile(q, (5, 95)))) for q in first if len(q)), default=0.0)
    if turned < LEAST_TURN:
        raise IdentificationError(
            f'{session.path}: finger "{finger.name}" turns by {np.rad2deg(turned):.1f} deg in its flexions; what holds it? Its '
            f"axes need {np.rad2deg(LEAST_TURN):.0f} deg at least"
        )
    return angles


def refitted(angles: FingerAngles, markers: Sequence[ChainData]) -> FingerAngles:
    """The same recordings with their markers (one ChainData each) put right: chain and poses anew."""
    recordings = [_Recording(r.trial, r.mocap, m, r.swaps) for r, m in zip(angles.records, markers, strict=True)]
    return _posed(angles.finger, recordings, angles.chain)


@dataclass(frozen=True)
class _Recording:
    trial: Trial
    mocap: Mocap
    markers: ChainData
    swaps: tuple[Swap, ...]

    @cached_property
    def ghost(self) -> NDArray[np.bool_]:
        """Frames (n,) in which a label sits on something else."""
        return ghosts(self.markers, self.mocap.time_s)


def _learned_from(recordings: Sequence[_Recording]) -> tuple[ChainData, NDArray[np.int64]]:
    """Thinned frames of the training recordings (of all, where none is for training), and which of them are at rest."""
    parts, rest, count = [], [], 0
    for recording in [r for r in recordings if not r.trial.validate] or recordings:
        frames = np.flatnonzero(~recording.ghost)
        frames = frames[:: max(1, len(frames) // LEARN_FRAMES)]
        parts.append(recording.markers.position_world[frames])
        rest.append(count + np.flatnonzero(recording.mocap.time_s[frames] < REST_S))
        count += len(parts[-1])
    first = recordings[0].markers
    return ChainData(np.concatenate(parts), first.body, first.labels), np.concatenate(rest)


def _posed(finger: Finger, recordings: Sequence[_Recording], start: Chain) -> FingerAngles:
    data, still = _learned_from(recordings)
    fit = fit_chain(data, start)
    chain = fit.chain.at(np.median(fit.pose.angle_rad[still], axis=0), data.body)
    records = []
    for r in recordings:
        pose, sound = _poses(r.markers, chain, fit.noise_m)
        angle = np.where((sound & ~r.ghost)[:, None], pose.angle_rad, np.nan)
        records.append(FlexionAngles(r.trial, r.mocap, angle, r.swaps, r.markers, pose, r.ghost))
    return FingerAngles(finger, chain, fit.noise_m, tuple(records))


def _poses(markers: ChainData, chain: Chain, noise_m: float) -> tuple[Pose, NDArray[np.bool_]]:
    """Poses of all frames, and which are sound. Frames that are not are posed by all their markers, within FARTHEST_M:
    a support that turned leaves the chain by more than noise, and is to be seen, not thrown away."""
    pose, weight = fit_poses(markers, chain, noise_m)
    sound = sound_frames(markers, weight)
    odd = np.flatnonzero(~sound)
    if len(odd):
        wide, _ = fit_poses(markers.take(odd), chain, max(noise_m, FARTHEST_M / OUTLIER_LIMIT))
        pose.put(odd, wide)
    return pose, sound


def linkage_states(
    angles: FingerAngles,
    joint: int = 1,
    steps: Sequence[Step] = (),
    expected: Mapping[str, tuple[Array, Array]] | None = None,
    logged: bool = True,
) -> tuple[DriveState, ...]:
    """Balance of a follower: its angle [deg] against a quartic of its driver's angle [deg], one state per recording.

    The driver's angle is smoothed (see `driver_angle`): noise in a regressor would bend the map and hide small departures.
    expected: trial -> times [s] and angles [deg] of the driver as its own station has it (`expected_angles`). logged:
    whether the logs' counts and clocks are believed; the markers tell alone otherwise.
    """
    states, told = [], []
    name = angles.finger.segments[joint].name
    scale = max(float(np.rad2deg(np.nanmax(np.abs(r.angle_rad[:, joint - 1])))) for r in angles.records)
    for index, record in enumerate(angles.records):
        good = np.isfinite(record.angle_rad).all(1)
        if good.sum() < 200:
            continue
        t, q = record.mocap.time_s[good], np.rad2deg(record.angle_rad[good])
        log = _at_frames(record, t) if logged else None
        course = None
        if log is not None:
            course = foresee(t, q[:, joint - 1], log, (expected or {}).get(record.trial.name))
        told.append((index, record, t, q, log, course))
    alike = lasting([(t, course) for _, _, t, _, _, course in told if course is not None])
    for index, record, t, q, log, course in told:
        driver, velocity, acceleration, sure = driver_angle(t, q[:, joint - 1], course, alike)
        stepped, more = _stepped(index, t, steps)
        declared = np.concatenate([np.stack([(driver / scale) ** k for k in range(5)], axis=-1), stepped], axis=1)
        follower = np.where(sure & _begun(driver) & ~_near(index, t, steps), q[:, joint], np.nan)
        extra = {
            "trial_index": np.full(len(t), float(index)),
            "scale": np.full(len(t), scale),
            "slope": _slope(driver, driver, q[:, joint], sure, 4),
            **({} if log is None else log.accounts),
        }
        states.append(
            DriveState(
                record.trial.name,
                f"{angles.finger.name}/{name}",
                t,
                driver,
                velocity,
                acceleration,
                follower,
                declared,
                "deg",
                "deg",
                extra,
                (*_names(4), *more),
                record.trial.validate,
            )
        )
    return with_likelier_load(states)


def encoder_states(angles: FingerAngles, low: float, high: float, steps: Sequence[Step] = ()) -> tuple[DriveState, ...]:
    """Balance of the encoder: proximal angle [deg] against a cubic of position [%], at the mocap's frames.

    low, high: counts at 0 and 100 %. Each recording has its own clock offset, as a column of the velocity; the clocks'
    rates are taken as equal (another rate is an effect).
    """
    records = [r for r in angles.records if r.trial.log_path is not None]
    states = []
    for index, record in enumerate(records):
        good = np.isfinite(record.angle_rad[:, 0])
        t, q = record.mocap.time_s[good], np.rad2deg(record.angle_rad[good, 0])
        log = _at_frames(record, t, drifting=False)
        if log is None:
            continue
        x, velocity = 100 * (log.counts - low) / (high - low), 100 * log.speed / (high - low)
        slope = _slope(x, x, q, log.inside, 3)
        offsets = np.zeros((len(t), len(records)))
        offsets[:, index] = slope * velocity
        stepped, more = _stepped(index, t, steps)
        declared = np.concatenate([np.stack([(x / 100) ** k for k in range(4)], axis=-1), offsets, stepped], axis=1)
        extra = {
            "trial_index": np.full(len(t), float(index)),
            "scale": np.full(len(t), 100.0),
            "slope": slope,
            **log.accounts,
        }
        states.append(
            DriveState(
                record.trial.name,
                angles.finger.name,
                t,
                x,
                velocity,
                100 * log.acceleration / (high - low),
                np.where(log.inside & _begun(x) & ~_near(index, t, steps), q, np.nan),
                declared,
                "%",
                "deg",
                extra,
                (*_names(3), *(f"offset_{i}" for i in range(len(records))), *more),
                record.trial.validate,
            )
        )
    return with_excursions(with_likelier_load(states))


def _at_frames(record: FlexionAngles, time_s: Array, drifting: bool = True) -> LogAtFrames | None:
    """The log of a recording at mocap times (n,) [s]; None without a log. drifting: with the clock's own rate, where it
    has one."""
    from ...identify.clock import align

    if record.trial.log_path is None:
        return None
    log = record.trial.log()
    seen = np.isfinite(log.column("position")) & np.r_[True, np.diff(log.time_s) > 0]
    at, counts = log.time_s[seen], log.column("position")[seen]
    clock = align(record.mocap.time_s, record.angle_rad[:, 0], at, counts, record.trial.name)
    then = clock.log_time(time_s)
    if not drifting:
        middle = 0.5 * (time_s[0] + time_s[-1])
        then = time_s + float(clock.log_time(np.array([middle]))[0]) - middle
    motion = estimate_motion(at, counts, uneven=log.uneven)
    current = log.columns.get("current")
    loads: tuple[PassedOn, ...] = ()
    if current is not None and np.isfinite(current[seen]).sum() > 20:
        known = np.isfinite(current[seen])
        passed = transmitted_loads(at, np.interp(at, at[known], current[seen][known]), motion)
        loads = tuple(PassedOn(np.interp(then, at, p.load), np.interp(then, at, p.drag)) for p in passed)
    v, a = (np.interp(then, at, y) for y in (motion.velocity, sure_acceleration(motion)))
    return LogAtFrames(position_at(motion, at, then), v, a, loads, told_between(motion, at, counts, then))


def expected_angles(naming: Naming) -> dict[str, tuple[Array, Array]]:
    """Trial -> times [s] and angles [deg] that an encoder station's final model predicts, named effects included."""
    return naming.balance.by_recording(naming.fit.prediction)


def _stepped(record: int, time_s: Array, steps: Sequence[Step]) -> tuple[Array, tuple[str, ...]]:
    """Columns (n, s) that are one while a step lasts, and their names."""
    columns = [step.acts(record, time_s) for step in steps]
    names = tuple(f"step_{i}" for i in range(len(steps)))
    return np.stack(columns, axis=-1) if columns else np.zeros((len(time_s), 0)), names


def _begun(driver: Array) -> NDArray[np.bool_]:
    """Samples (n,) from the first motion on: nobody knows on which side lost motion lay before, or whether it lay
    between."""
    moved = np.abs(driver - np.nanmedian(driver[:FIRST_SAMPLES])) > BEGUN * np.ptp(driver[np.isfinite(driver)])
    return np.maximum.accumulate(moved)


def _near(record: int, time_s: Array, steps: Sequence[Step]) -> NDArray[np.bool_]:
    """Samples (n,) too close to a step for its moment to be known."""
    close = [np.abs(time_s - step.time_s) < MOMENT_S for step in steps if step.record == record]
    return np.any(close, axis=0) if close else np.zeros(len(time_s), bool)


def _slope(at: Array, driver: Array, follower: Array, use: NDArray[np.bool_], order: int) -> Array:
    """Slope (n,) at `at` of the polynomial that maps driver to follower."""
    from numpy.polynomial import Polynomial

    return Polynomial.fit(driver[use], follower[use], order).deriv()(at)


def _names(order: int) -> tuple[str, ...]:
    return tuple(f"power_{k}" for k in range(order + 1))


def ranges_of_counts(session: Session) -> dict[str, tuple[float, float]]:
    """Actuator -> counts at 0 and 100 %, as the drive balance has them."""
    from .drive import drive_trials

    return {a: count_range([t.log() for t in trials]) for a, trials in drive_trials(session).items()}
