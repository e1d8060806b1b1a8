"""What the cameras see: palm that is never quite still, marker noise, gaps, ghosts; and the probe trials."""

import numpy as np

from fifth_recorder.finger import SCREW, Finger
from fifth_recorder.lab import Lab
from fifth_recorder.plan import Plan
from fifth_recorder.simulate import Happening, frame_times, palm_frames, turn

PROBE = {"T1": (0.0, 0.0, 0.085), "T2": (0.0, 0.0, 0.125), "T3": (0.034, 0.0, 0.11), "T4": (-0.026, 0.008, 0.118)}


def random_turn(rng: np.random.Generator, size: float) -> np.ndarray:
    """A rotation about a random axis by a normal angle of `size` rad."""
    axis = rng.normal(size=3)
    return turn(axis / np.linalg.norm(axis), np.array([rng.normal(0, size)]))[0]


def palm_motion(
    t: np.ndarray, pose: np.ndarray, place: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (n, 3, 3) and position (n, 3) of a held hand: a few slow sways of millimetres and degrees."""
    f, ph = rng.uniform(0.03, 0.45, (2, 3, 3)), rng.uniform(0, 2 * np.pi, (2, 3, 3))
    size = np.stack([np.full((3, 3), 0.0014), np.full((3, 3), 0.0050)])
    sway = (rng.normal(0, 1, (2, 3, 3)) * size)[..., None] * np.sin(2 * np.pi * f[..., None] * t + ph[..., None])
    way, angle = sway.sum(2).transpose(0, 2, 1)
    norm = np.linalg.norm(angle, axis=1)
    k = np.zeros((len(t), 3, 3))
    k[:, 0, 1], k[:, 0, 2], k[:, 1, 2] = -angle[:, 2], angle[:, 1], -angle[:, 0]
    k -= k.transpose(0, 2, 1)
    q = np.maximum(norm, 1e-12)[:, None, None]
    small = np.eye(3) + np.sin(q) / q * k + (1 - np.cos(q)) / q**2 * (k @ k)
    return small @ pose, place + way


def _gaps(points: np.ndarray, lab: Lab, rng: np.random.Generator) -> None:
    n = len(points)
    for marker in range(points.shape[1]):
        for _ in range(rng.poisson(lab.gap_rate * n / lab.mocap_rate)):
            start, length = rng.integers(0, n), int(rng.integers(3, 20) * lab.mocap_rate / 100.0) + 1
            points[start : start + length, marker] = np.nan


def _ghost(points: np.ndarray, lab: Lab, rng: np.random.Generator) -> None:
    if rng.random() < lab.ghosts:
        start, marker = rng.integers(0, len(points) - 20), rng.integers(3, points.shape[1])
        points[start : start + int(rng.integers(4, 15)), marker] += rng.normal(0, 0.03, 3)


def flexion(plan: Plan, palm: np.ndarray, happening: Happening, place: np.ndarray) -> np.ndarray:
    """World marker positions (frames, 9, 3) m of a flexion trial, NaN where occluded."""
    trial, lab = happening.trial, plan.lab
    t = frame_times(plan, trial)
    frames = palm_frames(plan, palm, happening, t)
    rng = trial.rng(4)
    r, p = palm_motion(t, trial.pose, place, rng)
    frames.points = np.einsum("tij,tnj->tni", r, frames.points) + p[:, None]
    frames.points += rng.normal(0, lab.marker_noise * 1e-3, frames.points.shape)
    for hook in plan.world:
        hook(frames)
    _gaps(frames.points, lab, rng)
    _ghost(frames.points, lab, rng)
    return frames.points


def probe(
    lab: Lab,
    palm: np.ndarray,
    tip: np.ndarray,
    pose: np.ndarray,
    place: np.ndarray,
    seconds: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """World positions (frames, 7, 3) m of palm and probe while its tip rests on `tip` (palm frame), swung about."""
    t = np.arange(int(seconds * lab.mocap_rate)) / lab.mocap_rate
    r, p = palm_motion(t, pose, place, rng)
    hold = random_turn(rng, 0.5)
    swing, _ = palm_motion(t * 10.0, hold, np.zeros(3), rng)
    tool = np.einsum("tij,nj->tni", swing, np.array(list(PROBE.values()))) + tip
    points = np.concatenate([np.broadcast_to(palm, (len(t), 3, 3)), tool], axis=1)
    points = np.einsum("tij,tnj->tni", r, points) + p[:, None]
    return points + rng.normal(0, lab.marker_noise * 1e-3, points.shape)


def screw_heads(finger: Finger) -> dict[tuple[str, str], np.ndarray]:
    """(joint, side) -> screw head (m, palm frame, hand open)."""
    return {
        (joint, side): finger.centres[j] + sign * SCREW * finger.axes[j]
        for j, joint in enumerate(("proximal", "distal"))
        for side, sign in (("medial", 1.0), ("lateral", -1.0))
    }


def trial_pose(base: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The pose of the hand in one trial: nearly the session's."""
    return random_turn(rng, 0.01) @ base


def far_pose(rng: np.random.Generator) -> np.ndarray:
    """A hand held any way a mount allows."""
    return random_turn(rng, 1.2)


def session_pose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Pose and place (m) of the hand in the mocap world."""
    return random_turn(rng, 0.5), np.array([0.38, -0.21, 1.08]) + rng.normal(0, [0.03, 0.03, 0.05])
