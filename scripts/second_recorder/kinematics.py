"""Joint angles and marker positions of one finger, with whatever is hidden in `kin` and `marker`."""

from __future__ import annotations

from typing import Any

import numpy as np

from .hand import Array, Finger, unit
from .motor import Trace

LOAD_UNIT = 100.0  # raw current at which a compliance is quoted
SUPPORT_FOOT = 0.7  # a support turns about its foot, nearer to the joint than its markers


def rotations(axis: Array, angle: Array) -> Array:
    """Rotation matrices (n, 3, 3) about a unit axis."""
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1.0 - c) * (K @ K)


def play(values: Array, half: float) -> Array:
    """Lost motion: the output rests while the input moves inside a gap of plus or minus `half`."""
    out = np.empty_like(values)
    state = float(values[0])
    for i, value in enumerate(values.tolist()):
        state = min(max(state, value - half), value + half)
        out[i] = state
    return out


def lowpass(values: Array, tau: float, dt: float) -> Array:
    """First-order lag."""
    out = np.empty_like(values)
    state, gain = float(values[0]), min(1.0, dt / tau)
    for i, value in enumerate(values.tolist()):
        state += gain * (value - state)
        out[i] = state
    return out


def bump(time: Array, duration: float, windows: list[list[float]]) -> Array:
    """Half sines in [start, end] fractions of the trial."""
    out = np.zeros_like(time)
    for start, end in windows:
        phase = (time / duration - start) / (end - start)
        out = np.maximum(out, np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)), 0.0))
    return out


def joint_angles(finger: Finger, kin: dict[str, Any], trace: Trace) -> tuple[Array, Array]:
    """Proximal and distal angle [rad] at every simulation step."""
    full_p, full_d = finger.angle_full
    c0, c1, d0, d1 = finger.coef
    dt = float(trace.time[1] - trace.time[0])
    u = trace.position / 100.0
    load = trace.current / LOAD_UNIT
    if "series_give" in kin:
        u = u - kin["series_give"] / full_p * load
    if "drive_play" in kin:
        u = play(u, kin["drive_play"] / full_p)
    p = full_p * (c0 * u + c1 * u**2 + (1.0 - c0 - c1) * u**3)
    if "lift_windows" in kin:  # somebody flexes the finger: it can only be ahead of its drive
        push = bump(trace.time, float(trace.time[-1]), kin["lift_windows"])
        p = np.maximum(p, np.where(push > 0, kin["lift_angle"] * push, p))
    if "hang_angle" in kin:
        p = np.maximum(p, kin["hang_angle"])
    s = p / full_p
    if "deadband" in kin:
        s = np.maximum(0.0, s - kin["deadband"]) / (1.0 - kin["deadband"])
    if "linkage_give" in kin:
        s = s - kin["linkage_give"] / full_d * load
    if "linkage_play" in kin:
        s = play(s, kin["linkage_play"] / full_d)
    q = full_d * (d0 * s + d1 * s**2 + (1.0 - d0 - d1) * s**3)
    if "linkage_lag" in kin:
        q = lowpass(q, kin["linkage_lag"], dt)
    if "distal_stop" in kin:
        q = np.minimum(q, kin["distal_stop"] * full_d)
    return p, q


def joint_pose(finger: Finger, kin: dict[str, Any], joint: int, angle: Array) -> tuple[Array, Array]:
    """Rotation (n, 3, 3) of the joint and its centre (n, 3), hand open to now, in the parent's open frame."""
    axis, centre = finger.axes[joint], finger.centres[joint]
    turn = rotations(axis, angle)
    share = angle / finger.angle_full[joint]
    if kin.get("wobble_joint") == joint:
        across = unit(np.cross(axis, np.array(kin["wobble_direction"])))
        turn = turn @ rotations(across, kin["wobble_amp"] * np.sin(np.pi * kin["wobble_waves"] * share))
    centres = np.repeat(centre[None], len(angle), axis=0)
    if kin.get("travel_joint") == joint:
        centres = centres + share[:, None] * np.array(kin["travel"])
    return turn, centres


def swing(markers: Array, rate: float, hertz: float, damping: float, gain: float) -> Array:
    """Soft tissue: displacement of each marker, an oscillator driven by its own acceleration."""
    omega, dt, sub = 2.0 * np.pi * hertz, 1.0 / rate, 4
    acceleration = np.gradient(np.gradient(markers, dt, axis=0), dt, axis=0)
    shift = np.zeros_like(markers)
    d, v = np.zeros(markers.shape[1:]), np.zeros(markers.shape[1:])
    for i in range(len(markers)):
        for _ in range(sub):
            v = v + (-gain * acceleration[i] - 2 * damping * omega * v - omega**2 * d) * dt / sub
            d = d + v * dt / sub
        shift[i] = d
    return shift


def finger_markers(finger: Finger, kin: dict[str, Any], marker: dict[str, Any], trace: Trace, times: Array) -> Array:
    """Marker positions (n, 6, 3) [m] in the landmark frame at the frame times."""
    p_all, q_all = joint_angles(finger, kin, trace)
    p, q = np.interp(times, trace.time, p_all), np.interp(times, trace.time, q_all)
    local = np.repeat(finger.markers[None], len(times), axis=0)
    share = np.arange(len(times)) / len(times)
    if "support" in marker:
        segment, moment, rotvec = marker["support"]
        turn = rotations(unit(np.array(rotvec)), np.array([np.linalg.norm(rotvec)]))[0]
        base = finger.markers[segment].mean(axis=0) * SUPPORT_FOOT
        late = share >= moment
        local[late, segment] = (local[late, segment] - base) @ turn.T + base
    if "creep" in marker:
        segment, rotvec = marker["creep"]
        base = finger.markers[segment].mean(axis=0) * SUPPORT_FOOT
        turns = rotations(unit(np.array(rotvec)), np.linalg.norm(rotvec) * share)
        local[:, segment] = np.einsum("nij,nkj->nki", turns, local[:, segment] - base) + base
    if "slip" in marker and marker["slip_frame"] == "segment":
        segment, index, moment, vector = marker["slip"]
        local[share >= moment, segment, index] += np.array(vector)
    turn_p, centre_p = joint_pose(finger, kin, 0, p)
    turn_d, centre_d = joint_pose(finger, kin, 1, q)
    proximal = np.einsum("nij,nkj->nki", turn_p, local[:, 0]) + centre_p[:, None]
    distal = np.einsum("nij,nkj->nki", turn_d, local[:, 1]) + (centre_d - finger.centres[0])[:, None]
    distal = np.einsum("nij,nkj->nki", turn_p, distal) + centre_p[:, None]
    if "slip" in marker and marker["slip_frame"] == "palm":
        segment, index, moment, vector = marker["slip"]
        (proximal if segment == 0 else distal)[share >= moment, index] += np.array(vector)
    if "swing_gain" in marker:
        rate = 1.0 / float(times[1] - times[0])
        distal = distal + swing(distal, rate, marker["swing_hz"], marker["swing_damping"], marker["swing_gain"])
    return np.concatenate([proximal, distal], axis=1)
