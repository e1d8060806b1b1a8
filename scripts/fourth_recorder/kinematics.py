"""From the motor's position to joint angles and markers of a finger."""

from __future__ import annotations

import numpy as np

from .geometry import Array, across, rotation
from .hand import Finger
from .hidden import LinkageFaults, MovingCentre, Wobble
from .motor import Motor, Trace


def play(angles: Array, half_gap: float, start: float | None = None) -> Array:
    """Lost motion: what follows `angles` [rad] only once they have crossed the gap; start: where it stands first."""
    if half_gap == 0:
        return angles
    held = angles[0] if start is None else start
    out = []
    for angle in angles.tolist():
        if angle - held > half_gap:
            held = angle - half_gap
        elif held - angle > half_gap:
            held = angle + half_gap
        out.append(held)
    return np.array(out)


def proximal_angle(finger: Finger, share: Array) -> Array:
    """[rad] at a share of the motor's range."""
    a, b = finger.curve[:2]
    return finger.full_angles[0] * (a * share + b * share**2 + (1 - a - b) * share**3)


def distal_angle(finger: Finger, proximal: Array) -> Array:
    """[rad] at an angle [rad] of the proximal joint."""
    a, b = finger.curve[2:]
    share = proximal / finger.full_angles[0]
    return finger.full_angles[1] * (a * share + b * share**2 + (1 - a - b) * share**3)


def joint_angles(finger: Finger, motor: Motor, trace: Trace, faults: LinkageFaults) -> tuple[Array, Array]:
    """Proximal and distal joint [rad] at every row of a trace."""
    proximal = proximal_angle(finger, trace.position / 100)
    time = trace.time
    if faults.lost_angle:
        below, width = faults.lost_below, faults.lost_width
        proximal = proximal + faults.lost_angle * np.log1p(np.exp((below - trace.position) / width)) * width / below
    if faults.rest_jump:
        begin, angle = faults.rest_jump
        proximal = proximal + angle * (time > begin * time[-1])
    if faults.drive_play:
        proximal = play(proximal, faults.drive_play)
    if faults.drive_compliance:
        load = trace.load + 0.4 * trace.friction + 0.3 * motor.viscous * trace.speed - motor.preload
        proximal = proximal - faults.drive_compliance * load
    follows = proximal
    if faults.linkage_play:
        follows = play(follows, faults.linkage_play, 0.0)
    if faults.linkage_compliance:
        load = 0.5 * trace.load + 0.5 * trace.friction + 0.4 * motor.viscous * trace.speed - 0.5 * motor.preload
        follows = follows - faults.linkage_compliance * load
    if faults.deadband:
        follows = np.maximum(follows - faults.deadband, 0)
    distal = distal_angle(finger, follows)
    if faults.distal_limit:
        distal = np.minimum(distal, faults.distal_limit * finger.full_angles[1])
    if faults.touch:
        touch = faults.touch
        there = (time >= touch.begin) & (time <= touch.end)
        distal = distal - there * touch.give * np.maximum(trace.position - touch.place, 0)
    return proximal, distal


def travel(finger: Finger, centre: MovingCentre, angles: Array) -> Array:
    """Way (n, 3) [mm] of a joint's centre that moves."""
    share = (angles / finger.full_angles[centre.joint])[:, None]
    turned = np.pi * angles / finger.full_angles[centre.joint]
    first, second = across(finger.axes[centre.joint])
    cosine, sine = np.cos(centre.direction), np.sin(centre.direction)
    along = cosine * first + sine * second
    aside = -sine * first + cosine * second
    return centre.distance * (share * along + centre.bow * np.sin(turned)[:, None] * aside)


def tilt(finger: Finger, wobble: Wobble, angles: Array) -> Array:
    """Matrices (n, 3, 3) of a wobbling joint."""
    first, second = across(finger.axes[wobble.joint])
    axis = np.cos(wobble.direction) * first + np.sin(wobble.direction) * second
    return rotation(axis, wobble.angle * (np.sin(wobble.waves * angles + wobble.phase) - np.sin(wobble.phase)))


def finger_markers(
    finger: Finger, proximal: Array, distal: Array, faults: LinkageFaults
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Markers (n, 3, 3) [mm] of both segments in the landmark frame, and the segments' turns (n, 3, 3), at joint angles
    (n,) [rad]."""
    angles = (proximal, distal)
    count = len(proximal)
    centres = [np.broadcast_to(centre, (count, 3)).copy() for centre in finger.centres]
    rotations = [rotation(finger.axes[joint], angles[joint]) for joint in (0, 1)]
    if faults.moving_centre:
        joint = faults.moving_centre.joint
        centres[joint] += travel(finger, faults.moving_centre, angles[joint])
    if faults.wobble:
        joint = faults.wobble.joint
        rotations[joint] = rotations[joint] @ tilt(finger, faults.wobble, angles[joint])
    near = rotations[0]
    far = near @ rotations[1]
    first = centres[0][:, None] + np.einsum("nij,kj->nki", near, finger.markers[0])
    joint_at = centres[0] + np.einsum("nij,nj->ni", near, centres[1] - finger.centres[0])
    second = joint_at[:, None] + np.einsum("nij,kj->nki", far, finger.markers[1])
    return (first, second), (near, far)
