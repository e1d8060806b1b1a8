"""Record a hand: simulate every trial, write a complete `hand-session/1` folder, return the truth."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import HandModelError
from .answer import answer_table
from .dirt import dirty_markers, log_columns, sample_times, unrest_terms
from .files import write_log, write_markers
from .geometry import rotate
from .influence import Active, Hidden, Influence, activate, merge_terms
from .kinematics import PalmPose, gravity_palm, joint_angles, palm_pose, probe_markers, segment_markers
from .manifest import manifest_text
from .motor import STEP_S, DriveNow, DriveTerms, Motion, simulate
from .schedule import Plan, TrialPlan, schedule
from .streams import stream
from .truth import HandTruth

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TrialTruth:
    """What truly happened in a trial. mocap_time_s (n,), angle_rad (n, 2), palm pose: rotation (n, 4) and position
    (n, 3) [m] in the world at the mocap's frames; log_time_s (k,) on the trial's time; motion: the drive at the
    simulation's steps.
    """

    plan: TrialPlan
    mocap_time_s: Array
    angle_rad: Array | None
    palm_rotation: Array | None
    palm_position_m: Array | None
    log_time_s: Array | None
    motion: Motion | None


@dataclass(frozen=True)
class Answer:
    """The truth of a session. table: what answer.json holds. trials: stem of the files -> TrialTruth."""

    path: Path
    table: Mapping[str, Any]
    trials: Mapping[str, TrialTruth]

    def save(self, path: str | Path) -> None:
        """Write the table as JSON, all digits."""
        Path(path).write_text(json.dumps(self.table, indent=1) + "\n")


def record(
    truth: HandTruth,
    folder: str | Path,
    seed: int,
    effects: Sequence[Hidden | str] = (),
    plan: Plan | None = None,
    mocap_format: str = "c3d",
) -> Answer:
    """Write a session of `truth` into `folder` (created; refused where it holds anything) and return its answer.

    effects: what to hide, by name or as Hidden. mocap_format: "c3d", "tsv", "trc" or "csv". The same arguments give
    the same bytes. Nothing of the answer is written. Raises HandModelError for what cannot be recorded.
    """
    target, plan = Path(folder), plan or Plan()
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise HandModelError(f"{target}: already exists and is not an empty folder; name a new or an empty one")
    hidden = tuple(Hidden(e) if isinstance(e, str) else e for e in effects)
    if any(h.effect == "gravity_load" for h in hidden):
        plan = replace(plan, mocap_excitation=True)  # without markers nobody could know how the palm was turned
    trials = schedule(truth, plan)
    active = tuple(activate(h, truth, trials, seed) for h in hidden)
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".recording-") as scratch:
        root = Path(scratch) / "session"
        for name in ("mocap", "log"):
            (root / name).mkdir(parents=True)
        done = {trial.name: _record_trial(truth, trial, active, root, seed, mocap_format) for trial in trials}
        (root / "session.toml").write_text(manifest_text(truth, trials, plan, mocap_format))
        if target.exists():
            target.rmdir()
        shutil.move(str(root), str(target))
    return Answer(target, answer_table(truth, trials, [a.answer for a in active], seed, _contacts(done, seed)), done)


def _contacts(trials: Mapping[str, TrialTruth], seed: int) -> dict[str, dict[str, Any]]:
    """Grasp trial -> object, stiffness [raw/%], where [%] and when [s of the trial] the finger first meets it."""
    out = {}
    for name, trial in trials.items():
        met = contact_percent(trial.plan, seed)
        if met is not None:
            touched = np.flatnonzero(trial.motion.position > met)
            when = float(trial.motion.time_s[touched[0]]) if len(touched) else None
            out[name] = {
                "object": trial.plan.object,
                "stiffness": trial.plan.stiffness,
                "at_percent": met,
                "contact_s": when,
            }
    return out


def _of(truth: HandTruth, active: Sequence[Active], finger: str | None) -> list[Influence]:
    """Influences on a finger: its own, and those in a drive that it shares (both thumb positions have one)."""
    if finger is None:
        return []
    actuator = truth.finger(finger).actuator
    shared = ("drive", "channel")
    return [
        a.influence
        for a in active
        if a.finger == finger or (a.answer["station"] in shared and a.answer["actuator"] == actuator)
    ]


def _record_trial(
    truth: HandTruth, trial: TrialPlan, active: Sequence[Active], root: Path, seed: int, mocap_format: str
) -> TrialTruth:
    noise = truth.mocap
    skew = noise.start_skew_s * float(stream(seed, "skew", trial.name).uniform()) if trial.program is not None else 0.0
    time_s = skew + np.arange(int((trial.duration_s - skew) * noise.rate_hz + 1e-9) + 1) / noise.rate_hz
    own = _of(truth, active, trial.finger)
    turns = any(a.influence.turns_palm for a in active) and trial.program is not None
    pose = palm_pose(noise, seed, trial.name, turns)
    motion = None
    if trial.program is not None:
        motion, angles = _move(truth, trial, own, pose, seed)
        _write_log(truth, trial, motion, own, active, root, seed)
    if not trial.mocap:
        return TrialTruth(trial, time_s, None, None, None, sample_times(truth.log, trial, seed), motion)
    palm = np.broadcast_to(np.stack(list(truth.palm_markers_palm.values())), (len(time_s), 3, 3))
    for a in active:
        palm = a.influence.palm(trial, time_s, palm) if a.influence.palm else palm
    markers = {label: palm[:, i] for i, label in enumerate(truth.palm_markers_palm)}
    angle_rad = log_time = None
    if motion is not None:
        angle_rad = np.stack([np.interp(time_s, motion.time_s, angles[:, i]) for i in range(2)], axis=1)
        log_time = sample_times(truth.log, trial, seed)
        markers |= segment_markers(truth.finger(trial.finger), angle_rad, own, trial, time_s)
    else:
        markers |= probe_markers(truth, trial, time_s, seed)
    rotation, position = pose.at(time_s)
    world = {label: rotate(rotation, points) + position for label, points in markers.items()}
    seen = dirty_markers(world, noise, seed, trial)
    for influence in own if motion is not None else ():
        seen = influence.world(trial, time_s, seen) if influence.world else seen
    write_markers(root / "mocap" / f"{trial.name}.{mocap_format}", seen, noise.rate_hz, noise.unit)
    return TrialTruth(trial, time_s, angle_rad, rotation, position, log_time, motion)


def _move(
    truth: HandTruth, trial: TrialPlan, influences: Sequence[Influence], pose: PalmPose, seed: int
) -> tuple[Motion, Array]:
    """Drive and angles (n, 2) [rad] at the simulation's steps."""
    motor = truth.motors[truth.finger(trial.finger).actuator]
    for influence in influences:
        if influence.start:
            influence.start(trial)
    parts = [i.terms for i in influences if i.terms is not None]
    if motor.unrest > 0:
        parts.append(unrest_terms(motor, trial, seed))
    met = contact_percent(trial, seed)
    if met is not None:
        parts.append(grasp_terms(trial, met))
    gravity = None
    if any(i.turns_palm for i in influences):
        gravity = gravity_palm(pose, truth, np.arange(round(trial.duration_s / STEP_S) + 1) * STEP_S)
    motion = simulate(motor, trial.program, merge_terms(parts), trial.start_s, gravity)
    return motion, joint_angles(truth.finger(trial.finger), motion, influences)


def contact_percent(trial: TrialPlan, seed: int) -> float | None:
    """Where the object of a grasp is met [%]; None in other trials."""
    return None if trial.stiffness is None else float(stream(seed, "object", trial.name).uniform(40.0, 70.0))


def grasp_terms(trial: TrialPlan, at_percent: float) -> DriveTerms:
    """The object of a grasp: a one-sided spring from `at_percent` on, with a little damping while it is pressed."""
    stiffness = float(trial.stiffness or 0.0)

    def contact(now: DriveNow) -> float:
        depth = now.position - at_percent
        return max(0.0, stiffness * depth + 0.02 * stiffness * now.velocity) if depth > 0 else 0.0

    return DriveTerms(load=(contact,))


def _write_log(
    truth: HandTruth,
    trial: TrialPlan,
    motion: Motion,
    own: Sequence[Influence],
    active: Sequence[Active],
    root: Path,
    seed: int,
) -> None:
    motor = truth.motors[truth.finger(trial.finger).actuator]
    percent, current = motion.position, motion.current
    rate = 1.0
    for influence in own:
        percent = influence.encoder(motion, percent) if influence.encoder else percent
        current = influence.current(motion, current) if influence.current else current
    for a in active:
        rate *= a.influence.clock_rate  # one log clock for the whole hand
    columns = log_columns(truth, motor, trial, motion, percent, current, seed, rate)
    for influence in own:
        columns = influence.log(trial, columns) if influence.log else columns
    write_log(root / "log" / f"{trial.name}.csv", columns)
