"""What only the recordings themselves can tell: every file of a session read once and held against the manifest."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError, did_you_mean
from .log import COLUMNS, Log
from .mocap import Mocap
from .session import Session, Trial

Array = NDArray[np.float64]

PROBED = ("landmark", "joint_probe", "surface")
# What a hand, or a limb in its place, can measure across all its markers [m]. A wrong unit is off by 1000.
EXTENT_M = (0.005, 3.0)
# Lengths that must agree (a palm in two files, a probe and its declaration) and do not by this ratio are in other
# units.
UNIT_RATIO = 1.5
# A rigid body does not show its turns about a line that its markers are this near to: a share of its length, or the
# noise of a coordinate this many times over, for then a frame's turn is known to a third of a radian.
FLATNESS = 0.01
OFF_LINE_OVER_NOISE = 3.0
# times what the noise of distances lets markers on a line seem to be off it: a second principal length goes with the
# square root of what the first one's square is wrong by
CHANCE = 1.5
# Fewer frames than this show no flexion.
FLEXION_FRAMES = 10
# The longest sampling interval [s] of a log whose `time` can be in seconds.
INTERVAL_S = 2.0
# Motion stands out of the noise: range of a channel over the noise of one sample.
MOTION_OVER_NOISE = 10.0


def check_session(session: Session, dead: bool = False) -> tuple[str, ...]:
    """Read every recording of a session once and check it for identification; readings are kept for later use.

    dead: whether an encoder that never moves is let through, for a diagnosis to name, and a finger with markers on one
    line, for it to leave out.

    Returns notes: what was mended or ignored, one sentence each, the session's own included. Raises SessionError for
    the first recording that lacks a marker or column, has one that is never seen, markers on one line, a length or time
    that cannot be in the unit stated, or no motion where motion is needed.
    """
    notes = list(session.notes)
    palm_sizes: dict[str, float] = {}
    unknown: set[str] = set()
    for finger in session.fingers:
        if all(trial.validate for trial in session.select("flexion", finger.name)):
            raise SessionError(
                f'{session.path}: every flexion trial of finger "{finger.name}" has purpose = "validate"; '
                "one without is needed to fit it"
            )
    for trial in session.trials:
        if trial.mocap_path is not None:
            mocap = trial.mocap()
            notes += [f"{_place(session, mocap)}: {note}" for note in mocap.notes]
            notes += check_mocap(session, trial, mocap, dead)
            if session.palm and all(label in mocap.labels for label in session.palm.labels):
                palm_sizes[str(trial.mocap_path)] = _size(mocap.markers(session.palm.labels))
        if trial.log_path is not None:
            log = trial.log()
            notes += [f"{_place(session, log)}: {note}" for note in log.notes]
            notes += check_log(session, trial, log, dead)
            unknown |= set(log.columns) - set(COLUMNS)
        if trial.mocap_path is not None and trial.log_path is not None:
            _check_durations(mocap, log)
    _check_palm_sizes(palm_sizes)
    if unknown and session.rig is None:
        notes.append(f"log columns that the format does not name were ignored: {', '.join(sorted(unknown))}")
    return tuple(dict.fromkeys(notes))


def _place(session: Session, recording: Mocap | Log) -> str:
    """The file relative to its session: notes are kept with the hand and must not depend on where the folder lies."""
    return recording.path.relative_to(session.path).as_posix()


def check_mocap(session: Session, trial: Trial, mocap: Mocap, dead: bool = False) -> list[str]:
    """Markers of one trial: labelled, seen, of a possible size, and off a line (`dead`: those of a finger noted where
    they are not). Returns notes; raises SessionError."""
    bodies, notes = _bodies(session, trial), list[str]()
    if trial.kind not in (*PROBED, "flexion", "pivot"):
        missing = [label for labels in bodies.values() for label in labels if label not in mocap.labels]
        return [
            f"{_place(session, mocap)}: not every marker is here, and the file was ignored ({', '.join(missing)})"
        ] * bool(missing)
    for body, labels in bodies.items():
        position = mocap.markers(labels)
        seen = np.isfinite(position[..., 0])
        hidden = [label for label, ever in zip(labels, seen.any(axis=0), strict=True) if not ever and body != "probe"]
        if hidden and (len(labels) - len(hidden) < 3 or not _seen_elsewhere(session, trial, hidden)):
            raise SessionError(
                f'{mocap.path}: marker "{hidden[0]}" ({body}) is occluded in every frame; it must be seen'
            )
        notes += [f'{_place(session, mocap)}: marker "{label}" ({body}) is never seen' for label in hidden]
        together = int((seen.sum(axis=1) >= min(3, len(labels))).sum())
        needed = FLEXION_FRAMES if trial.kind == "flexion" else 1
        if together < needed:
            listed = ", ".join(labels)
            raise SessionError(
                f"{mocap.path}: three of the markers {listed} ({body}) are seen together in {together} of {len(seen)} "
                f"frames; {needed} or more are needed"
            )
        hinged = body not in ("palm", "probe")
        if (
            len(labels) >= 3
            and on_a_line(position, hinged)
            and not (body == "probe" and session.probe.position_probe is not None)
        ):
            said = f"the markers {', '.join(labels)} ({body}) lie on one line; three that do not are needed"
            if not (dead and hinged):
                raise SessionError(f"{mocap.path}: {said}")
            notes.append(f"{_place(session, mocap)}: {said}, and nothing was read from the markers of this finger")
    check_extent(mocap, [label for labels in bodies.values() for label in labels])
    if "probe" in bodies and session.probe.position_probe is not None:
        _check_probe_size(session, mocap)
    return notes


def _seen_elsewhere(session: Session, trial: Trial, labels: Sequence[str]) -> bool:
    """Whether markers that one trial never shows are seen in another flexion of its finger that is fitted."""
    others = [
        t.mocap().markers(labels)
        for t in session.select("flexion", trial.finger)
        if t.name != trial.name and not t.validate and all(label in t.mocap().labels for label in labels)
    ]
    return any(np.isfinite(position[..., 0]).any(axis=0).all() for position in others)


def _bodies(session: Session, trial: Trial) -> dict[str, tuple[str, ...]]:
    """The rigid bodies whose markers a trial needs, with their labels."""
    bodies: dict[str, tuple[str, ...]] = {}
    if session.palm and trial.kind != "pivot":
        bodies["palm"] = session.palm.labels
    if session.probe and trial.kind in (*PROBED, "pivot"):
        bodies["probe"] = session.probe.labels
    if trial.finger and trial.kind not in PROBED:
        bodies |= {
            f"{trial.finger}/{segment.name}": segment.markers for segment in session.finger(trial.finger).segments
        }
    return bodies


def check_extent(mocap: Mocap, labels: Sequence[str]) -> float:
    """How far apart the named markers are [m], the median over the frames; raises SessionError where no hand can be
    so."""
    position = mocap.markers(labels)
    seen = np.isfinite(position[..., 0]).sum(axis=1) >= 2
    if not seen.any():
        return float("nan")
    size = np.nanmax(position[seen], axis=1) - np.nanmin(position[seen], axis=1)
    extent_m = float(np.median(np.linalg.norm(size, axis=1)))
    if not EXTENT_M[0] <= extent_m <= EXTENT_M[1]:
        raise SessionError(
            f"{mocap.path}: the markers of the hand are {extent_m:.3g} m apart, which cannot be; "
            "the length unit in the file must be the one of its numbers (none stated: millimetres)"
        )
    return extent_m


def _distances(position: Array) -> tuple[Array, Array]:
    """Distances (k, k) [m] between markers (n, k, 3), as far as they are rigid, free of the bias by the noise, and the
    noise (k, k) [m] of a coordinate that each shows.

    A distance measured with noise is too long: E[d]^2 - d0^2 = 4 s^2 and var d = 2 s^2 for noise s in each coordinate.
    The noise is what changes from frame to frame: a marker that slips or is swapped makes no noise.
    """
    k = position.shape[1]
    distances, noise = np.zeros((k, k)), np.zeros((k, k))
    for i, j in combinations(range(k), 2):
        length = np.linalg.norm(position[:, i] - position[:, j], axis=1)
        length = length[np.isfinite(length)]
        middle = np.median(length) if len(length) else np.nan
        step = np.median(np.abs(np.diff(length))) if len(length) > 1 else 0.0
        noise[i, j] = noise[j, i] = 1.4826 * step / 2.0
        distances[i, j] = distances[j, i] = np.sqrt(max(middle**2 - 4.0 * noise[i, j] ** 2, 0.0))
    return distances, noise


def flatness(position: Array) -> float:
    """Second over first principal length [-] of a rigid body with markers (n, k, 3): 0 for markers on one line;
    infinite where two of the markers are never seen together."""
    first, second, _ = _principal(position)
    return second / first if first > 0 else 0.0


def on_a_line(position: Array, hinged: bool = False) -> bool:
    """Whether markers (n, k, 3) [m] of a rigid body lie on one line, as far as a frame of them shows; of a body that a
    hinge carries, whose turns need not be read frame by frame, as far as all frames together show."""
    first, second, noise = _principal(position)
    by_chance = CHANCE * np.sqrt(first * noise) / len(position) ** 0.25 if hinged else np.inf
    return bool(second <= max(FLATNESS * first, min(by_chance, OFF_LINE_OVER_NOISE * noise)))


def _principal(position: Array) -> tuple[float, float, float]:
    """First and second principal length [m] of a rigid body with markers (n, k, 3), and a coordinate's noise [m].

    From the distances between its markers (classical scaling, Torgerson 1952), so that it holds while the body moves;
    the second is infinite where two of the markers are never seen together.
    """
    distances, noise = _distances(position)
    if not np.isfinite(distances).all():
        return 1.0, float("inf"), 0.0
    centre = np.eye(len(distances)) - 1.0 / len(distances)
    lengths = np.sqrt(np.clip(np.linalg.eigvalsh(-0.5 * centre @ distances**2 @ centre)[::-1], 0.0, None))
    return float(lengths[0]), float(lengths[1]), float(np.median(noise[np.triu_indices(len(noise), 1)]))


def _size(position: Array) -> float:
    """Mean distance [m] between the markers of a rigid body, whichever labels are exchanged."""
    distances, _ = _distances(position)
    return float(np.mean(distances[np.triu_indices(len(distances), 1)]))


def _check_probe_size(session: Session, mocap: Mocap) -> None:
    measured, declared = _size(mocap.markers(session.probe.labels)), _size(session.probe.position_probe[None])
    if np.isfinite(measured) and not 1 / UNIT_RATIO < measured / declared < UNIT_RATIO:
        raise SessionError(
            f"{mocap.path}: the probe's markers {', '.join(session.probe.labels)} are {measured:.3g} m apart, "
            f"and {declared:.3g} m in [probe]; file and manifest must agree (manifest in metres, "
            "the file in its stated unit)"
        )


def _check_palm_sizes(sizes: dict[str, float]) -> None:
    sizes = {file: size for file, size in sizes.items() if np.isfinite(size)}
    usual = float(np.median(list(sizes.values()))) if sizes else 0.0
    for file, size in sizes.items():
        if not usual / UNIT_RATIO <= size <= usual * UNIT_RATIO:
            raise SessionError(
                f"{file}: the palm markers are {size:.3g} m apart, and {usual:.3g} m in the other files; "
                "one palm is needed, in the unit that each file states"
            )


def check_interval(log: Log, longest_s: float = INTERVAL_S) -> None:
    """Raise SessionError where rows are so far apart [s] that the `time` of a log cannot be in seconds."""
    interval_s = float(np.median(np.diff(log.time_s)))
    if interval_s > longest_s:
        raise SessionError(f"{log.path}: samples are {interval_s:.3g} s apart by `time`; `time` in seconds is needed")


def check_log(session: Session, trial: Trial, log: Log, dead: bool = False) -> list[str]:
    """Columns of one log: there, not empty, in seconds, and moving where they must (unless `dead`). Returns notes;
    raises SessionError."""
    check_interval(log)
    if session.rig is not None:
        return _check_signals(session, log)
    if trial.kind not in ("flexion", "excitation", "grasp"):
        return []
    notes = []
    for name in ("position", "current"):
        lost = float(np.mean(np.isnan(log.column(name))))
        if lost == 1.0:
            raise SessionError(f'{log.path}: the column "{name}" has no sample; a log with it is needed')
        if lost > 0.1:
            notes.append(f"{_place(session, log)}: {100 * lost:.0f} % of the samples of {name} are lost")
    if trial.kind != "grasp" and not dead and not moves(log.column("position")):
        raise SessionError(
            f'{log.path}: the column "position" does not move; a {trial.kind} trial needs the finger to move'
        )
    return notes


def missing_direction(values: Array) -> str:
    """ "flexion" or "extension", where a channel (n,) that increases with flexion never goes that way by a tenth of its
    range; "" where it goes both ways."""
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return ""
    way = 0.1 * float(np.ptp(values))
    if float(np.max(values - np.minimum.accumulate(values))) <= way:
        return "flexion"
    return "extension" if float(np.max(np.maximum.accumulate(values) - values)) <= way else ""


def moves(values: Array) -> bool:
    """Whether a channel (n,) moves, rather than flicker by noise or by its last digit.

    The noise of one sample is judged from second differences, in which motion nearly cancels.
    """
    values = values[np.isfinite(values)]
    if len(values) < 4:
        return False
    steps = np.abs(np.diff(values))
    digit = float(steps[steps > 0].min()) if (steps > 0).any() else 0.0
    noise = 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6.0)
    low, high = np.percentile(values, [1, 99])
    return bool(high - low > MOTION_OVER_NOISE * max(noise, digit))


def _check_signals(session: Session, log: Log) -> list[str]:
    notes = []
    for name, target in session.rig.signals.items():
        if name in log.columns:
            if np.isnan(log.columns[name]).all():
                notes.append(f'{_place(session, log)}: the column "{name}" has no sample')
        elif target.endswith((":velocity", ":setpoint")):
            notes.append(f'{_place(session, log)}: no column "{name}", which [signals] names')
        else:
            raise SessionError(
                f'{log.path}: no column "{name}", which [signals] names; {did_you_mean(name, log.columns)}'
            )
    return notes


def _check_durations(mocap: Mocap, log: Log) -> None:
    """Refuse a pair of recordings whose lengths no two clocks explain (a `time` in milliseconds, say)."""
    lengths_s = [float(t[-1] - t[0]) for t in (mocap.time_s, log.time_s)]
    if min(lengths_s) * 20.0 < max(lengths_s):
        if missing := missing_direction(log.column("position")):
            raise SessionError(
                f"{log.path}: the log holds no {missing} (in {lengths_s[1]:.3g} s, "
                f"of the {lengths_s[0]:.3g} s in {mocap.path.name}); motion in both directions is needed"
            )
        raise SessionError(
            f"{log.path}: the log lasts {lengths_s[1]:.3g} s and {mocap.path.name} {lengths_s[0]:.3g} s; "
            "recordings of one motion are needed, `time` in seconds"
        )
