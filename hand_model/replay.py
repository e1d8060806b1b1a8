"""A Description against a Session: where do the markers go, where did they go.

Three ways to drive the model: with the joint angles that the markers show, with the encoder counts alone, and as a
MuJoCo simulation in which only the proximal joint is driven and the equalities move the rest.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .background import Background
from .compile.course import with_courses, without_courses
from .description import Description, Model, read_description
from .errors import DescriptionError, IdentificationError, SessionError
from .hand import Finger, Hand
from .identify.chain import Chain, ChainData, Pose
from .identify.clock import Clock, align
from .identify.finger import observations, sound_frames
from .identify.likelihood import fit_poses
from .identify.mapping import counts_at
from .rotation import kabsch, skew
from .session import Finger as RecordedFinger
from .session import Session, Trial, read_session

Array = NDArray[np.float64]

ENGINES = ("ours", "mujoco", "pinocchio", "yourdfpy")
MODES = ("measured", "encoder", "simulated")
PHASES = ("open", "flexing", "closed", "extending")
# Poses at which the engines are held against each other, per file.
AGREEMENT_POSES = 500


@dataclass(frozen=True)
class TrialResiduals:
    """One flexion trial replayed.

    labels, segment: (m,) of the finger's markers. time_s: (n,) mocap time. counts: (n,), nan without a log. angle_rad:
    (n, k) as the markers show it. seen: (n, m) markers that took part. phase: (n,) of PHASES. residual_palm: mode ->
    (n, m, 3) [m], recorded minus replayed. noise_m: (n, m) what marker noise alone gives in the modes that use the palm
    markers only, as root mean square of the vector's length. held_out: whether the trial took no part in the fit.
    """

    trial: Trial
    finger: str
    labels: tuple[str, ...]
    segment: tuple[str, ...]
    held_out: bool
    time_s: Array
    counts: Array
    angle_rad: Array
    seen: NDArray[np.bool_]
    phase: NDArray[np.str_]
    clock: Clock | None
    residual_palm: Mapping[str, Array]
    noise_m: Array

    def distance_m(
        self, mode: str, segment: str | None = None, label: str | None = None, phase: str | None = None
    ) -> Array:
        """Lengths (q,) [m] of the residual vectors of one mode, optionally of one segment, marker or phase."""
        columns = [
            i
            for i, (s, name) in enumerate(zip(self.segment, self.labels, strict=True))
            if segment in (None, s) and label in (None, name)
        ]
        mask = self.seen[:, columns] & ((self.phase == phase)[:, None] if phase else True)
        return np.linalg.norm(self.residual_palm[mode][:, columns], axis=-1)[mask]

    def noise_ratio(self, mode: str) -> float:
        """Root mean square error over that which noise alone explains."""
        square = np.sum(self.residual_palm[mode] ** 2, axis=-1)[self.seen]
        return float(np.sqrt(square.mean() / np.mean(self.noise_m[self.seen] ** 2)))


@dataclass(frozen=True)
class Residuals:
    """A description replayed against a session. agreement_m: engine -> largest distance [m] from this project's own
    forward kinematics at any marker or tip, over AGREEMENT_POSES poses of every file. notes: what could not be
    replayed, and why."""

    description: Description
    session: Session
    trials: tuple[TrialResiduals, ...]
    agreement_m: Mapping[str, float]
    notes: tuple[str, ...]


def replay(
    description: Description | str | Path, session: Session | str | Path, say: Callable[[str], None] = lambda _: None
) -> Residuals:
    """Replay the flexion trials of a session that took no part in the fit (all of them, where none was kept back).

    Raises DescriptionError where the description and the session are not of one hand, SessionError and
    IdentificationError for recordings that cannot be used.
    """
    description = description if isinstance(description, Description) else read_description(description)
    session = session if isinstance(session, Session) else read_session(session)
    if session.rig is not None:
        raise SessionError(
            f"{session.path}: a rig session brings its own model; a compiled hand cannot be replayed against it"
        )
    agreement = engine_agreement(description)
    say("engines agree within " + ", ".join(f"{name} {value:.1e} m" for name, value in agreement.items()))
    notes: list[str] = []
    calls = []
    for finger in description.hand.fingers:
        recorded = next((f for f in session.fingers if f.name == finger.name), None)
        if recorded is None:
            notes.append(f"{finger.name}: the session does not record this finger")
            continue
        held_out = session.select("flexion", finger.name, validate=True)
        chosen = held_out or session.select("flexion", finger.name)
        if not held_out:
            notes.append(
                f"{finger.name}: no flexion trial is kept for validation; replayed on those that may have been fitted"
            )
        calls += [(description, session, finger, recorded, trial) for trial in chosen]
    if not calls:
        names = ", ".join(f.name for f in session.fingers)
        raise DescriptionError(
            f"{description.folder}: none of its fingers is recorded in {session.path} (recorded: {names or 'none'})"
        )
    trials = []
    for result, remarks in Background(replay_trial, calls).results():
        trials.append(result)
        notes += remarks
        say(f"{result.trial.name}: {summary(result)}")
    return Residuals(description, session, tuple(trials), agreement, tuple(notes))


def summary(trial: TrialResiduals) -> str:
    """One line: median marker error per mode."""
    parts = [f"{mode} {1e3 * np.median(trial.distance_m(mode)):.2f} mm" for mode in trial.residual_palm]
    return "median marker error " + ", ".join(parts)


def engine_agreement(description: Description, poses: int = AGREEMENT_POSES, seed: int = 0) -> dict[str, float]:
    """Largest distance [m] of each engine's marker and tip positions from this project's own, over random poses in the
    limits."""
    rng = np.random.default_rng(seed)
    worst: dict[str, float] = {}
    for model in description.models:
        own = importlib.import_module("hand_model.engines.ours")
        reference_model = own.load(model.mjcf)
        names = reference_model.names
        angles = {
            names.joint[finger.name, joint.name]: rng.uniform(*joint.range_rad, poses)
            for finger in reference_model.hand.fingers
            for joint in finger.joints
        }
        exact = own.positions(reference_model, angles)
        hand = reference_model.hand
        # a URDF holds no course
        plain = own.positions(own.of_hand(without_courses(hand)), angles) if with_courses(hand) else exact
        for engine, file in (
            ("mujoco", model.mjcf),
            ("mujoco (URDF)", model.urdf),
            ("pinocchio", model.urdf),
            ("yourdfpy", model.urdf),
        ):
            module = importlib.import_module(f"hand_model.engines.{engine.split()[0]}")
            found = module.positions(module.load(file), angles)
            reference = plain if file == model.urdf else exact
            off = max(float(np.abs(found[point] - reference[point]).max()) for point in reference if point in found)
            worst[engine] = max(worst.get(engine, 0.0), off)
    return worst


def hand_chain(hand: Hand, finger: Finger, recorded: RecordedFinger, palm_labels: tuple[str, ...]) -> Chain:
    """The finger as a chain with the session's markers, palm frame as in the hand.

    Raises DescriptionError where the hand does not know a marker of the session.
    """
    return chain_of(hand, finger.name, (*palm_labels, *recorded.labels))


def chain_of(hand: Hand, name: str, labels: Sequence[str]) -> Chain:
    """A finger as a chain with the markers `labels`, those of the palm first; raises DescriptionError where the hand
    lacks one."""
    finger = hand.finger(name)
    markers = dict(hand.palm_markers_palm)
    for joint in finger.joints:
        markers.update(joint.markers_palm)
    for label in labels:
        if label not in markers:
            raise DescriptionError(
                f'finger "{name}": the model has no marker "{label}"; it was identified with other markers'
            )
    courses = tuple(j.course for j in finger.joints)
    axes, centres = (np.stack([getattr(j, key) for j in finger.joints]) for key in ("axis_palm", "centre_palm"))
    return Chain(np.stack([markers[label] for label in labels]), axes, centres, courses if any(courses) else ())


def measure(hand: Hand, session: Session, recorded: RecordedFinger, trial: Trial) -> tuple[ChainData, Pose, Array]:
    """Palm pose and joint angles of a recording, the chain known: observations, poses, weights (n, m).

    Markers of a support that was taken off and put on again are placed anew by their own shape.
    """
    if session.palm is None:
        raise IdentificationError(f"{session.path}: the session has no palm markers")
    chain = hand_chain(hand, hand.finger(recorded.name), recorded, session.palm.labels)
    data, _ = observations(session, recorded, trial.mocap())
    pose, weight = fit_poses(data, chain, hand.noise_m)
    return data, pose, weight


def replay_trial(
    description: Description, session: Session, finger: Finger, recorded: RecordedFinger, trial: Trial
) -> tuple[TrialResiduals, tuple[str, ...]]:
    """Replay one flexion trial in all modes that its recording allows; what it does not, in sentences."""
    notes: list[str] = []
    data, pose, weight = measure(description.hand, session, recorded, trial)
    sound = sound_frames(data, weight)
    if sound.sum() < 20:
        raise IdentificationError(
            f"{trial.name}: {sound.sum()} frames fit this hand; are the markers where they were when it was identified?"
        )
    time = trial.mocap().time_s
    model = next(m for m in description.models if finger.name in m.fingers)
    counts, clock = _counts(trial, time, np.where(sound, pose.angle_rad[:, 0], np.nan))
    moving = data.body > 0
    paths = {"measured": pose.angle_rad}
    if finger.encoder_maps and clock is not None:
        proximal = finger.encoder_maps[0].angle_rad(counts)
        paths["encoder"] = _through_couplings(finger, proximal)
    else:
        notes.append(f"{trial.name}: no encoder log; replayed by measured angles only")
    palm_only = _palm_from_markers(description.hand, session, data)
    labels = tuple(np.array(data.labels)[moving])
    body = data.body[moving]
    residual = {}
    for mode, path in paths.items():
        base = pose if mode == "measured" else palm_only
        recorded_palm = base.to_palm(data.position_world[:, moving])
        residual[mode] = recorded_palm - _points(model, finger, labels, path)
    if "encoder" in paths:
        seen_palm = palm_only.to_palm(data.position_world[:, moving])
        residual["simulated"] = seen_palm - _simulated(model, finger, labels, time, paths["encoder"][:, 0])
    everywhere = np.all([np.isfinite(r[..., 0]) for r in residual.values()], axis=0)
    segments = tuple(finger.joints[k - 1].name for k in body)
    residuals = TrialResiduals(
        trial=trial,
        finger=finger.name,
        labels=labels,
        segment=segments,
        held_out=trial.validate,
        time_s=time,
        counts=counts,
        angle_rad=np.where(sound[:, None], pose.angle_rad, np.nan),
        seen=everywhere & (weight[:, moving] > 0.5) & sound[:, None],
        phase=phases(time, counts if clock is not None else pose.angle_rad[:, 0]),
        clock=clock,
        residual_palm=residual,
        noise_m=_noise_alone(description.hand, session, data.position_world[:, moving], palm_only),
    )
    return residuals, tuple(notes)


def phases(time_s: Array, drive: Array) -> NDArray[np.str_]:
    """Phase (n,) of each frame from counts or angle: at rest in the open or the closed half, flexing, extending."""
    filled = np.interp(time_s, time_s[np.isfinite(drive)], drive[np.isfinite(drive)])
    width = max(3, round(0.1 / float(np.median(np.diff(time_s)))))
    smooth = np.convolve(np.pad(filled, width, mode="edge"), np.ones(width) / width, mode="same")[width:-width]
    speed = np.gradient(smooth, time_s)
    low, high = np.quantile(smooth, [0.01, 0.99])
    slow = np.abs(speed) < 0.03 * np.quantile(np.abs(speed), 0.98)
    closed = smooth > (low + high) / 2
    return np.where(slow, np.where(closed, "closed", "open"), np.where(speed > 0, "flexing", "extending"))


def _counts(trial: Trial, time_s: Array, angle_rad: Array) -> tuple[Array, Clock | None]:
    if trial.log_path is None:
        return np.full(len(time_s), np.nan), None
    log = trial.log()
    clock = align(time_s, angle_rad, log.time_s, log.column("position"), trial.name)
    return counts_at(log.time_s, log.column("position"), clock.log_time(time_s)), clock


def _through_couplings(finger: Finger, proximal_rad: Array) -> Array:
    from .kinematics import finger_angles

    driver = {finger.joints[0].name: np.nan_to_num(proximal_rad)}
    return np.where(np.isfinite(proximal_rad)[:, None], finger_angles(finger, driver), np.nan)


def _points(model: Model, finger: Finger, labels: tuple[str, ...], path_rad: Array) -> Array:
    """Marker positions (n, m, 3) [m] in the palm frame by MuJoCo's kinematics of the compiled file."""
    from .engines import mujoco, ours

    names = ours.load(model.mjcf).names
    loaded = mujoco.load(model.mjcf)
    angles = {
        names.joint[finger.name, joint.name]: np.nan_to_num(path_rad[:, k]) for k, joint in enumerate(finger.joints)
    }
    found = mujoco.positions(loaded, angles)
    points = np.stack([found[names.marker[finger.name, label]] for label in labels], axis=1)
    return np.where(np.isfinite(path_rad).all(1)[:, None, None], points, np.nan)


def _simulated(model: Model, finger: Finger, labels: tuple[str, ...], time_s: Array, proximal_rad: Array) -> Array:
    """Marker positions (n, m, 3) [m] of a simulation in which the equality moves all but the proximal joint."""
    from .engines import mujoco, ours

    names = ours.load(model.mjcf).names
    known = np.isfinite(proximal_rad)
    path = np.interp(time_s, time_s[known], proximal_rad[known])
    found = mujoco.simulate(model.mjcf, time_s, {names.joint[finger.name, finger.joints[0].name]: path})
    points = np.stack([found.positions[names.marker[finger.name, label]] for label in labels], axis=1)
    return np.where(known[:, None, None], points, np.nan)


def _palm_from_markers(hand: Hand, session: Session, data: ChainData) -> Pose:
    """Palm pose from the palm markers alone (Kabsch), nan where one is hidden."""
    shape = np.stack([hand.palm_markers_palm[label] for label in session.palm.labels])
    seen = data.position_world[:, data.body == 0]
    rotation, translation = kabsch(shape, seen)
    shown = np.isfinite(seen).all((1, 2))
    return Pose(rotation, np.where(shown[:, None], translation, np.nan), np.zeros((len(seen), 0)))


def _noise_alone(hand: Hand, session: Session, position_world: Array, palm: Pose) -> Array:
    """(n, m) root mean square length [m] that marker noise alone gives: the marker's own and the palm pose's at that
    lever."""
    shape = np.stack([hand.palm_markers_palm[label] for label in session.palm.labels])
    by_pose = np.concatenate([np.broadcast_to(np.eye(3), (len(shape), 3, 3)), -skew(shape)], axis=2).reshape(-1, 6)
    covariance = np.linalg.inv(by_pose.T @ by_pose)
    x = palm.to_palm(position_world)
    by_marker = np.concatenate([np.broadcast_to(np.eye(3), (*x.shape[:2], 3, 3)), -skew(np.nan_to_num(x))], axis=3)
    lever = np.einsum("nmif,fg,nmig->nm", by_marker, covariance, by_marker)
    return hand.noise_m * np.sqrt(3 + lever)
