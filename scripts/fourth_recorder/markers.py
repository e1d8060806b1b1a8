"""Markers of a trial in the landmark frame, with everything that happened to them, before the cameras see them."""

from __future__ import annotations

import numpy as np

from .geometry import Array, rotation, unit
from .hidden import MarkerSlip, SupportSlip
from .kinematics import finger_markers, joint_angles
from .session import Session
from .trial import Trial


def slip_marker(slip: MarkerSlip, share: Array, segments: tuple[Array, Array], turned: tuple[Array, Array]) -> None:
    """Shift one marker from a share of the trial on."""
    shift = np.array(slip.shift)
    if slip.frame != "palm":
        shift = np.einsum("nij,j->ni", turned[slip.segment], shift)
    segments[slip.segment][:, slip.index] += (share >= slip.begin)[:, None] * shift


def slip_support(
    slip: SupportSlip, places: Array, share: Array, segments: tuple[Array, Array], turned: tuple[Array, Array]
) -> None:
    """Turn a segment's markers, at places [mm] from its joint, from a share of the trial on."""
    pivot = places.mean(0) - np.array([0, 0, 14.0])
    moved = (places - pivot) @ rotation(slip.axis, slip.angle)[0].T + pivot - places
    after = share >= slip.begin
    segments[slip.segment][after] += np.einsum("nij,kj->nki", turned[slip.segment][after], moved)


def occlude(session: Session, trial: Trial, times: Array, points: Array) -> None:
    """Shift markers now and then, as when some of the cameras do not see them."""
    shift, share = trial.markers.occlusion
    rng = np.random.default_rng([session.seed, 77, len(times)])
    for k in range(points.shape[1]):
        for begin in rng.uniform(0, trial.duration_s, max(1, int(trial.duration_s * share / 2))):
            inside = (times > begin) & (times < begin + rng.uniform(0.5, 3))
            points[inside, k] += unit(rng.normal(0, 1, 3)) * shift


def trial_markers(session: Session, trial: Trial, times: Array) -> Array:
    """Three markers of the palm and six of the finger (n, 9, 3) [mm] at times [s]."""
    finger, faults = trial.finger, trial.markers
    angles = joint_angles(finger, trial.motor, trial.trace, trial.linkage)
    proximal, distal = (np.interp(times, trial.trace.time, each) for each in angles)
    segments, turned = finger_markers(finger, proximal, distal, trial.linkage)
    palm = np.broadcast_to(session.hand.palm, (len(times), 3, 3)).copy()
    share = times / trial.duration_s
    if faults.slip:
        slip_marker(faults.slip, share, segments, turned)
    if faults.support:
        slip_support(faults.support, finger.markers[faults.support.segment], share, segments, turned)
    if faults.palm:
        palm[share >= faults.palm.begin, faults.palm.index] += np.array(faults.palm.shift)
    points = np.concatenate(segments, 1)
    if faults.swap:
        swap = faults.swap
        inside = (share >= swap.begin) & (share < swap.begin + swap.length)
        order = list(range(6))
        order[swap.first], order[swap.second] = swap.second, swap.first
        points[inside] = points[inside][:, order]
    points = np.concatenate([palm, points], 1)
    if faults.scale_drift:
        points = points * (1 + faults.scale_drift * share)[:, None, None]
    if faults.occlusion:
        occlude(session, trial, times, points)
    return points
