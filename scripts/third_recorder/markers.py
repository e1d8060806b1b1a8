"""Where the markers of palm and finger are while it moves, and what the cameras make of it. Lengths in mm."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from .geometry import Array, rotation, turn
from .hand import Finger, Session
from .hidden import Lens, Ringing
from .kinematics import Linkage, joint_angles
from .motor import ROW_S, Trace
from .trial import Trial

LAG = ([0.02], [1, -0.98])  # filter of 50 rows
GAP_S = 0.12


def finger_markers(session: Session, trial: Trial, time: Array) -> Array:
    """Markers (n, 6, 3) in the landmark frame at trial times [s]."""
    finger, trace, linkage = trial.finger, trial.trace, trial.finger.linkage
    angles = [np.interp(time, trial.time, angle) for angle in joint_angles(linkage, finger.motor, trace)]
    turned = np.broadcast_to(np.eye(3), (len(time), 3, 3))
    moved = np.zeros((len(time), 3))  # a point x of the segments so far goes to turned x + moved
    segments = []
    for joint in range(2):
        centre = linkage.centres[joint]
        share = angles[joint] / linkage.full[joint]
        own = rotation(linkage.axes[joint], angles[joint])
        if linkage.wobble and linkage.wobble.joint == joint:
            own = own @ wobble(linkage, trial, time, share)
        step = centre - np.einsum("nij,j->ni", own, centre) + centre_travel(linkage, joint, share)
        moved = np.einsum("nij,nj->ni", turned, step) + moved
        turned = turned @ own
        points = segment_points(session, finger, joint, trial.start_s + time)
        ringing = finger.faults.ringing
        if ringing and ringing.joint == joint:
            swing = ring(ringing, trace, session.laboratory.top_speed)
            points = points + np.interp(time, trial.time, swing)[:, None, None] * linkage.frame(joint)[1]
        segments.append(np.einsum("nij,nkj->nki", turned, points) + moved[:, None])
    points = np.concatenate(segments, 1)
    bend = finger.faults.palm_bend
    if bend:
        current = np.interp(time, trial.time, lfilter(*LAG, trace.current))
        points = np.einsum("nij,nkj->nki", rotation(bend.axis, bend.rad_per_raw * current), points)
    return points


def wobble(linkage: Linkage, trial: Trial, time: Array, share: Array) -> Array:
    """Turns of a segment about a direction across its axis."""
    fault = linkage.wobble
    along, dorsal = linkage.frame(fault.joint)
    across = np.cos(fault.across) * along + np.sin(fault.across) * dorsal
    if fault.follows == "angle":
        tilt = fault.amplitude * np.sin(2 * np.pi * fault.waves * share + fault.phase)
    else:
        direction = np.clip(lfilter(*LAG, np.tanh(trial.trace.speed / 2)), -1, 1)
        tilt = fault.amplitude * np.interp(time, trial.time, direction)
    return rotation(across, tilt)


def centre_travel(linkage: Linkage, joint: int, share: Array) -> Array:
    """How far (n, 3) a joint's centre has travelled at shares of its full angle."""
    fault = linkage.moving_centre
    if fault is None or fault.joint != joint:
        return np.zeros((len(share), 3))
    along, dorsal = linkage.frame(joint)
    power = np.clip(share, 0, 2) ** fault.power
    up = np.sin(fault.towards) * power + 0.3 * np.sin(np.pi * share)
    return fault.path_mm * (np.cos(fault.towards) * power)[:, None] * along + fault.path_mm * up[:, None] * dorsal


def segment_points(session: Session, finger: Finger, joint: int, session_s: Array) -> Array:
    """Markers (n, 3, 3) of a segment, hand open, at session times: shifted once something slipped."""
    points = np.broadcast_to(finger.markers[joint], (len(session_s), 3, 3)).copy()
    for slip in session.faults.slips:
        if slip.finger != finger.name or slip.joint != joint:
            continue
        after = session_s >= slip.session_s
        if slip.what == "marker":
            points[after, slip.marker] += slip.shift
        elif slip.what == "support":
            middle = points[0].mean(0)
            points[after] = (points[after] - middle) @ turn(slip.turn).T + middle + slip.shift
    return points


def ring(ringing: Ringing, trace: Trace, top_speed: float) -> Array:
    """Swing of a marker support behind the acceleration of its motor, at the rows of a trace."""
    angle = 2 * np.pi * ringing.hz
    shaken = np.gradient(trace.speed, ROW_S) / top_speed
    decay = np.exp(-ringing.damping * angle * ROW_S)
    swing = lfilter([1e-6], [1, -2 * decay * np.cos(angle * ROW_S), decay * decay], shaken)
    return swing / (np.percentile(np.abs(swing), 99) + 1e-12) * ringing.peak_mm


def palm_markers(session: Session, session_s: Array) -> Array:
    """Markers (n, 3, 3) of the palm in the landmark frame."""
    points = np.broadcast_to(session.palm, (len(session_s), 3, 3)).copy()
    for slip in session.faults.slips:
        if slip.what == "palm":
            points[session_s >= slip.session_s, slip.marker] += slip.shift
    return points


def to_world(points: Array, turned: Array, origin: Array) -> Array:
    """Points (n, k, 3) of the landmark frame in the world."""
    return np.einsum("nij,nkj->nki", turned, points) + origin[:, None]


def observe(rng: np.random.Generator, session: Session, points: Array, dropout: bool = True) -> Array:
    """World positions (n, k, 3) as the cameras give them: lens, noise and, with dropout, gaps and ghosts."""
    laboratory = session.laboratory
    if session.faults.lens is not None:
        points = points + distortion(session.faults.lens, points - (session.world[1] + session.faults.lens.centre))
    seen = points + rng.normal(size=points.shape) * laboratory.marker_noise * laboratory.noise_factor
    if not dropout:
        return seen
    frames, count, _ = points.shape
    gap = GAP_S * laboratory.mocap_hz
    for i in range(count):
        gaps = int(rng.poisson(laboratory.gap_share * frames / gap))
        for begin in rng.integers(0, frames, gaps):
            seen[begin : begin + 1 + int(rng.exponential(gap)), i] = np.nan
    if laboratory.ghosts and frames > 600:
        for _ in range(int(rng.integers(1, 4))):
            begin = int(rng.integers(frames))
            end = begin + int(rng.integers(1, 4))
            marker = int(rng.integers(count))
            seen[begin:end, marker] += rng.normal(size=3) * 25
    return seen


def distortion(lens: Lens, away: Array) -> Array:
    """Displacement by a lens model of two forms at places away from its centre."""
    d = away / 100
    if lens.form == 0:
        return lens.size / 100 * 20 * d * (d[..., :2] ** 2).sum(-1, keepdims=True) * 0.3
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return lens.size / 100 * 30 * np.stack([x * y, x**2 - z**2 * 0.5, y * z], -1) * 0.3
