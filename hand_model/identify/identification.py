"""Session -> Hand: palm frame, fingers, joints probed, encoder maps and linkages."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..background import Background, single_threaded
from ..errors import IdentificationError
from ..hand import Finger, Hand, Joint, Motor
from ..rotation import angle_between, kabsch, skew
from ..session import Session, check_session, read_session
from .centre import project_on_line
from .finger import FingerFit, axis_sd_deg, identify_finger
from .frames import palm_frame
from .hinge import hinge_note
from .mapping import aligned, couplings, encoder_maps, ranges
from .motor import identify_motors
from .probe import ProbedPoint, calibrated_probe, probed_point
from .published import dominant_joint, published_joint
from .screws import Screws, probe_screws
from .start import cluster_shape
from .surface import identify_surfaces, with_surfaces

Array = NDArray[np.float64]

LANDMARKS = ("origin", "medial", "lateral")
# An axis known worse than this [deg] is reported as not determined by the recorded arc.
DEGENERATE_DEG = 3.0


@dataclass(frozen=True)
class Identification:
    """A hand with what it was found from. palm_shape: (3, 3) [m] palm markers in their own frame, the frame of
    `fingers`."""

    hand: Hand
    session: Session
    palm_shape: Array
    fingers: tuple[FingerFit, ...]


def identify(session: Session | str | Path, say: Callable[[str], None] = lambda _: None, compared: bool = True) -> Hand:
    """Identify the kinematics of a recorded hand: axes, centres, encoder maps, linkages, each with its uncertainty.

    session: a session or its folder. say: called with one line per step. compared: with what the published method gives
    on the same markers, too. Raises SessionError and IdentificationError.
    """
    return identify_all(session, say, compared).hand


@single_threaded()
def identify_all(
    session: Session | str | Path, say: Callable[[str], None] = lambda _: None, compared: bool = True
) -> Identification:
    """As `identify`, keeping poses, residuals and clocks for a report or a diagnosis."""
    session = session if isinstance(session, Session) else read_session(session)
    if session.rig is not None:
        raise IdentificationError(
            f'{session.path}: a rig brings its own model; "replay" and "diagnose" take it, "identify" takes a hand'
        )
    if session.palm is None or not session.fingers:
        raise IdentificationError(f"{session.path}: a hand needs palm markers and at least one finger")
    notes = list(check_session(session))
    shape = palm_shape(session)
    motors = Background(identify_motors, [(replace(session, actuators=(actuator,)),) for actuator in session.actuators])
    fits = []
    with ThreadPoolExecutor(max_workers=2) as pool:  # most of the time is spent in numpy, which lets other threads run
        for fit in pool.map(lambda finger: identify_finger(session, finger, shape), session.fingers):
            fits.append(fit)
            say(f"{fit.finger.name}: {_finger_line(fit)}")
    probe = calibrated_probe(session)
    landmarks = (
        {t.landmark: probed_point(t, session, probe, shape) for t in session.select("landmark", validate=False)}
        if probe
        else {}
    )
    screws = probe_screws(session, probe, shape, fits)
    placement = screws.placement_m
    frame = _repeatable_frame(session, shape, landmarks, placement)
    if not landmarks:
        notes.append("no landmark trials: the palm frame is that of the palm markers, not the repeatable one")
    fingers, published = [], {}
    for fit in fits:
        finger, table = _finger(fit, shape, frame, screws, notes, compared)
        fingers.append(finger)
        published |= {finger.name: table} if compared else {}
    found_motors = _motors(session, motors, notes)
    say(_motor_line(found_motors))
    rotation, origin = frame[0], frame[1]
    hand = Hand(
        name=session.hand,
        side=session.side,
        palm_markers_palm=dict(zip(session.palm.labels, (shape - origin) @ rotation, strict=True)),
        landmarks_palm={name: (p.position_palm - origin) @ rotation for name, p in landmarks.items()},
        fingers=tuple(fingers),
        noise_m=float(np.sqrt(np.mean([fit.fit.noise_m**2 for fit in fits]))),
        provenance=_hashes(session),
        motors=found_motors,
        notes=tuple(notes),
        extra={
            "placement_m": placement,
            # Of the palm frame's own turn [rad] and shift [m], shared by every joint's covariance.
            "frame_covariance": (np.kron(np.eye(2), rotation.T) @ frame[2] @ np.kron(np.eye(2), rotation)).tolist(),
            "clock": {r.trial.name: _clock(r.clock) for fit in fits for r in fit.records if r.clock is not None},
            "repairs": _repairs(fits),
            "published_method": published,
        },
    )
    if probe is not None:
        hand = with_surfaces(hand, identify_surfaces(session, hand))
    return Identification(hand, session, shape, tuple(fits))


def palm_shape(session: Session) -> Array:
    """Palm markers (3, 3) [m] as one rigid shape in their own palm frame, from all recordings that show them."""
    if session.palm is None:
        raise IdentificationError(f"{session.path}: the session has no palm markers")
    tracks = []
    for trial in session.trials:
        if trial.mocap_path is not None and not trial.validate and trial.kind != "pivot":
            track = trial.mocap().markers(session.palm.labels)
            tracks.append(track[:: max(1, len(track) // 500)])
    if not tracks:
        raise IdentificationError(f"{session.path}: no trial has marker trajectories")
    try:
        shape = cluster_shape(np.concatenate(tracks))
        rotation, origin = palm_frame(shape, session.side)
    except IdentificationError as error:
        raise IdentificationError(f"{session.path}: palm markers {', '.join(session.palm.labels)}: {error}") from None
    return (shape - origin) @ rotation


def _repeatable_frame(
    session: Session, shape: Array, landmarks: dict[str | None, ProbedPoint], placement: float
) -> tuple[Array, Array, Array]:
    """Rotation, origin of the landmark frame in the palm-marker frame, and its covariance (6, 6) of turn and shift."""
    if not landmarks:
        return np.eye(3), np.zeros(3), np.zeros((6, 6))
    missing = [name for name in LANDMARKS if name not in landmarks]
    if missing:
        raise IdentificationError(
            f"{session.path}: no landmark trial named {', '.join(missing)}; origin, medial and lateral make the frame"
        )
    points = np.stack([landmarks[name].position_palm for name in LANDMARKS])
    rotation, origin = palm_frame(points, session.side)

    def outcome(step: Array) -> Array:
        turned, moved = palm_frame(points + step.reshape(3, 3), session.side)
        turn = turned @ rotation.T
        return (
            np.concatenate(
                [[turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]], 2 * (moved - origin)]
            )
            / 2
        )

    derivative = np.stack([(outcome(e) - outcome(-e)) / 2e-6 for e in 1e-6 * np.eye(9)], axis=1)
    spread = np.zeros((9, 9))
    for i, name in enumerate(LANDMARKS):
        spread[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = landmarks[name].covariance + placement**2 * np.eye(3)
    return rotation, origin, derivative @ spread @ derivative.T


def _finger(
    fit: FingerFit,
    shape: Array,
    frame: tuple[Array, Array, Array],
    screws: Screws,
    notes: list[str],
    compared: bool,
) -> tuple[Finger, dict[str, Any]]:
    data = aligned(fit)
    maps = encoder_maps(fit, data)
    links = couplings(fit, data, maps)
    limits = ranges(data, maps, links)
    rotation, origin, frame_covariance = frame
    turn, move = _onto_reference(fit, shape)
    joints, published = [], {}
    for k, segment in enumerate(fit.finger.segments):
        axis, line = turn @ fit.fit.chain.axis_palm[k], turn @ fit.fit.chain.centre_palm[k] + move
        near, along_sd, remark = screws.middle(fit.finger.name, segment.name, axis, line)
        if near is None:
            near = _middle(fit, k) @ turn.T + move
        notes += [f"{fit.finger.name} {segment.name}: {text}" for text in (remark, hinge_note(fit.fit, k)) if text]
        centre = project_on_line(near, axis, line)
        covariance = _moved_covariance(fit, k, turn, move, near, along_sd)
        degenerate = axis_sd_deg(covariance) > DEGENERATE_DEG
        arc = np.rad2deg(np.ptp(np.quantile(fit.fit.pose.angle_rad[fit.good, k], [0.01, 0.99])))
        if degenerate:
            sd = axis_sd_deg(covariance)
            notes.append(
                f"{fit.finger.name} {segment.name}: the recorded arc ({arc:.0f} deg) does not determine the "
                f"axis (sd {sd:.1f} deg)"
            )
        columns = np.flatnonzero(fit.fit.data.body == k + 1)
        markers = {
            fit.fit.data.labels[j]: (turn @ fit.fit.chain.marker_palm[j] + move - origin) @ rotation
            for j in columns[::-1]
        }
        joints.append(
            Joint(
                name=segment.name,
                axis_palm=_unit(axis @ rotation),
                centre_palm=(centre - origin) @ rotation,
                covariance=_in_frame(covariance, axis, centre, rotation, origin, frame_covariance),
                range_rad=limits[k],
                markers_palm=dict(sorted(markers.items())),
                degenerate=degenerate,
            )
        )
        published |= {segment.name: _published(fit, k, covariance, arc)} if compared else {}
    return Finger(fit.finger.name, fit.finger.actuator, tuple(joints), maps, links), published


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _middle(fit: FingerFit, joint: int) -> Array:
    chain = fit.fit.chain
    return chain.marker_palm[fit.fit.data.body == joint + 1].mean(0)


def _onto_reference(fit: FingerFit, shape: Array) -> tuple[Array, Array]:
    """From the finger's palm markers to the session's palm shape; markers that slipped count where they were first."""
    order = [
        j for j in np.flatnonzero(fit.fit.data.body == 0) if fit.fit.data.labels.index(fit.fit.data.labels[j]) == j
    ]
    return kabsch(fit.fit.chain.marker_palm[order], shape)


def _moved_covariance(fit: FingerFit, joint: int, turn: Array, move: Array, near: Array, along_sd: float) -> Array:
    """Covariance of axis and of the centre as the point of the axis nearest to the probed one, in the palm-marker
    frame."""
    axis, line = fit.fit.chain.axis_palm[joint], fit.fit.chain.centre_palm[joint]
    lever = float(axis @ (turn.T @ (near - move) - line))  # from the chain's centre to the probed one, along the axis
    across = np.eye(3) - np.outer(axis, axis)
    derivative = np.zeros((6, 6))
    derivative[:3, :3] = across
    derivative[3:, 3:] = across
    derivative[3:, :3] = lever * across
    covariance = derivative @ fit.joint_covariance(joint) @ derivative.T
    covariance[3:, 3:] += along_sd**2 * np.outer(axis, axis)
    both = np.kron(np.eye(2), turn)
    return both @ covariance @ both.T


def _in_frame(covariance: Array, axis: Array, centre: Array, rotation: Array, origin: Array, frame: Array) -> Array:
    """The same in the repeatable frame, whose own turn and shift are uncertain."""
    by_frame = np.zeros((6, 6))
    by_frame[:3, :3] = skew(axis)
    by_frame[3:, :3] = skew(centre - origin)
    by_frame[3:, 3:] = -np.eye(3)
    both = np.kron(np.eye(2), rotation.T)
    total = both @ (covariance + by_frame @ frame @ by_frame.T) @ both.T
    return (total + total.T) / 2


def _published(fit: FingerFit, joint: int, covariance: Array, arc_deg: float) -> dict[str, Any]:
    """What the published method gives on the same markers, as its distance from the likelihood's axis."""
    row: dict[str, Any] = {
        "arc_deg": float(arc_deg),
        "axis_sd_deg": axis_sd_deg(covariance),
        "centre_sd_m": float(np.sqrt(max(np.linalg.eigvalsh(covariance[3:, 3:])[-1], 0.0))),
    }
    try:
        old_axis, old_centre = published_joint(fit.fit.data, fit.fit.chain, joint, None)
    except (IdentificationError, np.linalg.LinAlgError) as error:
        return {**row, "failed": str(error)}
    now_axis, now_centre = fit.fit.chain.axis_palm[joint], fit.fit.chain.centre_palm[joint]
    arm = old_centre - now_centre
    row["axis_off_deg"] = float(np.rad2deg(angle_between(old_axis, now_axis)))
    row["centre_off_m"] = float(np.linalg.norm(arm - now_axis * (arm @ now_axis)))
    dominant = dominant_joint(fit.fit.data, fit.fit.chain, joint)[0]
    row["dominant_axis_off_deg"] = float(np.rad2deg(angle_between(dominant, now_axis, undirected=True)))
    return row


def _repairs(fits: list[FingerFit]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for fit in fits:
        for record in fit.records:
            for swap in record.swaps:
                time = record.mocap.time_s[[swap.start, swap.stop]]
                found.append(
                    {
                        "kind": "swap",
                        "trial": record.trial.name,
                        "markers": list(swap.labels),
                        "from_s": float(time[0]),
                        "to_s": float(time[1]),
                    }
                )
        for slip in fit.slips:
            record = next(r for r in fit.records if r.frames.start <= slip.frame < r.frames.stop)
            at = float(record.mocap.time_s[slip.frame - record.frames.start])
            found.append(
                {
                    "kind": "slip",
                    "trial": record.trial.name,
                    "markers": [slip.label],
                    "at_s": at,
                    "shift_m": float(np.linalg.norm(slip.shift_palm)),
                }
            )
    return found


def _clock(clock: Any) -> dict[str, float]:
    return {
        "offset_s": clock.offset_s,
        "rate": clock.rate,
        "offset_sd_s": clock.offset_sd_s,
        "rate_free": clock.rate_free,
        "rate_sd": clock.rate_sd,
        "explained": clock.explained,
    }


def _finger_line(fit: FingerFit) -> str:
    frames, noise = len(fit.fit.pose.angle_rad), 1e3 * fit.fit.noise_m
    arcs = np.rad2deg(np.ptp(np.quantile(fit.fit.pose.angle_rad[fit.good], [0.01, 0.99], axis=0), axis=0))
    return f"{frames} frames, marker noise {noise:.3f} mm, arcs " + ", ".join(f"{arc:.0f}" for arc in arcs) + " deg"


def _motors(session: Session, under_way: Background, notes: list[str]) -> tuple[Motor, ...]:
    found: dict[str, Motor] = {}
    for motors, remarks in under_way.results():
        found |= {motor.actuator: motor for motor in motors}
        notes += remarks
    return tuple(found[actuator.name] for actuator in session.actuators if actuator.name in found)


def _motor_line(motors: tuple[Motor, ...]) -> str:
    parts = [
        f"{m.actuator} (Coulomb {m.parameters['coulomb'].value:.1f}, noise {m.current_noise_raw:.1f} raw)"
        for m in motors
    ]
    return "motors: " + (", ".join(parts) or "none")


def _hashes(session: Session) -> dict[str, str]:
    files = {session.path / "session.toml"}
    for trial in session.trials:
        if not trial.validate:
            files |= {path for path in (trial.mocap_path, trial.log_path) if path is not None}
    for folder in [path for path in files if path.is_dir()]:  # a rosbag2 folder
        files |= set(folder.rglob("*"))
    table = {}
    for file in sorted(files):
        if file.is_file():
            table[file.relative_to(session.path).as_posix()] = hashlib.sha256(file.read_bytes()).hexdigest()
    return table
