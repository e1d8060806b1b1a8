"""The gain in the markers: healthy joints, rigid markers and a free pose of the palm in each frame against them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry import Array, unit
from ..hand import Finger
from ..hidden import LinkageFaults
from ..kinematics import finger_markers
from ..log_file import channels
from ..markers import trial_markers
from ..session import Session
from ..trial import Trial
from .gain import Gain

FRAMES = (260, 160)  # looked at of the first and every later flexion trial
# Figures of the healthy finger: proximal angle's cubic (4), distal angle's quartic (5), axes (4), centres [mm] (4),
# markers of both segments (18) and the palm (9) [mm], delay of the log in each of two trials [s].
SMALL, PLACES, COUNT = 13, 44, 46


@dataclass(frozen=True)
class Block:
    """Frames of one trial: times [s], points (n, 9, 3) [mm] without noise, recorded frames that each stands for."""

    number: int
    trial: Trial
    times: Array
    points: Array
    positions: Array  # [%] at every row of the trace, as logged
    weight: float
    pose: Array  # (n, 27, 6) orthonormal: how a turn and a shift of the palm move the points


def pose_directions(points: Array) -> Array:
    """Orthonormal directions (n, 27, 6) of the palm's pose."""
    directions = np.zeros((len(points), 27, 6))
    centred = points - points.mean(1, keepdims=True)
    for axis in range(3):
        directions[:, axis::3, axis] = 1
        turned = np.cross(np.broadcast_to(np.eye(3)[axis], centred.shape), centred)
        directions[:, :, 3 + axis] = turned.reshape(len(points), 27) / 30
    return np.linalg.qr(directions)[0]


def blocks_of(session: Session, trials: Sequence[Trial]) -> list[Block]:
    """Of the flexion trials."""
    out = []
    for number, trial in enumerate(each for each in trials if each.planned.kind == "flexion"):
        frames = FRAMES[min(number, 1)]
        times = (np.arange(frames) + 0.5) / frames * trial.duration_s
        points = trial_markers(session, trial, times)
        weight = trial.duration_s * session.laboratory.mocap_hz / frames
        out.append(Block(number, trial, times, points, channels(trial)[0], weight, pose_directions(points)))
    return out


def first_guess(finger: Finger) -> Array:
    """The healthy finger's figures as they are."""
    guess = np.zeros(COUNT)
    a, b, c, d = finger.curve
    near, far = finger.full_angles
    guess[1:4] = near * np.array([a, b, 1 - a - b])
    guess[5:8] = far * np.array([c / near, d / near**2, (1 - c - d) / near**3])
    return guess


def healthy_points(session: Session, finger: Finger, figures: Array, block: Block) -> Array:
    """Points (n, 9, 3) [mm] of a healthy finger."""
    trace, skew = block.trial.trace, block.trial.log.skew
    log_times = block.times / skew + figures[PLACES + block.number]
    share = np.interp(log_times, trace.time, block.positions) / 100
    proximal = figures[0] + figures[1] * share + figures[2] * share**2 + figures[3] * share**3
    distal = figures[4] + figures[5] * proximal + figures[6] * proximal**2 + figures[7] * proximal**3
    distal = distal + figures[8] * proximal**4
    shaped = replace(
        finger,
        axes=tuple(unit(finger.axes[j] + np.array([figures[9 + 2 * j], 0, figures[10 + 2 * j]])) for j in (0, 1)),
        centres=tuple(finger.centres[j] + np.array([figures[13 + 2 * j], 0, figures[14 + 2 * j]]) for j in (0, 1)),
        markers=tuple(finger.markers[j] + figures[17 + 9 * j : 26 + 9 * j].reshape(3, 3) for j in (0, 1)),
    )
    segments, _ = finger_markers(shaped, proximal, distal, LinkageFaults())
    palm = np.broadcast_to(session.hand.palm + figures[35:44].reshape(3, 3), (len(share), 3, 3))
    return np.concatenate([palm, *segments], 1)


def residuals(session: Session, finger: Finger, figures: Array, blocks: Sequence[Block]) -> Array:
    """In units of the noise, weighted."""
    parts = []
    for block in blocks:
        errors = block.points - healthy_points(session, finger, figures, block)
        parts.append((errors.reshape(len(errors), -1) * np.sqrt(block.weight)).ravel())
    return np.concatenate(parts) / session.laboratory.marker_noise


def without_pose(columns: Array, blocks: Sequence[Block]) -> Array:
    """Residuals, one set per column, less what a pose of the palm explains in each frame."""
    parts, row = [], 0
    for block in blocks:
        rows = columns[row : row + 27 * len(block.times)].reshape(-1, 27, columns.shape[1])
        along = np.einsum("nji,njk->nik", block.pose, rows)
        parts.append((rows - np.einsum("nij,njk->nik", block.pose, along)).reshape(-1, columns.shape[1]))
        row += 27 * len(block.times)
    return np.concatenate(parts)


def marker_gain(session: Session, trials: Sequence[Trial]) -> Gain:
    """Of the flexion trials of one finger: two Gauss-Newton steps from the healthy finger."""
    finger = trials[0].finger
    blocks = blocks_of(session, trials)
    figures, best = first_guess(finger), np.inf
    for _ in range(2):
        now = residuals(session, finger, figures, blocks)
        columns = np.empty((len(now), COUNT))
        for i in range(COUNT):
            step = 1e-4 if i < SMALL or i >= PLACES else 1e-2
            moved = figures.copy()
            moved[i] += step
            columns[:, i] = (residuals(session, finger, moved, blocks) - now) / step
        free = without_pose(now[:, None], blocks)[:, 0]
        columns = without_pose(columns, blocks)
        scale = np.linalg.norm(columns, axis=0) + 1e-9
        change, *_ = np.linalg.lstsq(columns / scale, -free, rcond=1e-9)
        best = min(best, ((free + (columns / scale) @ change) ** 2).sum())
        figures = figures + np.clip(change / scale, -2, 2)
    values = sum(block.weight * len(block.times) for block in blocks) * 21
    return Gain(float(0.5 * best), float(np.sqrt(1 + best / values) - 1))
