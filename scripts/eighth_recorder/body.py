"""Where the markers are: palm pose, segment rotations, noise and gaps."""

import numpy as np


def rotation(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rodrigues' formula for many angles; (n, 3, 3)."""
    angle = np.atleast_1d(np.asarray(angle, dtype=float))
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], 1 - np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + c * (cross @ cross)


def draw_pose(rng) -> tuple[np.ndarray, np.ndarray]:
    """The palm in the world: fingers roughly along the table."""
    base = (
        rotation(np.array([0, 0, 1.0]), rng.uniform(-0.6, 0.9))[0]
        @ rotation(np.array([1.0, 0, 0]), rng.uniform(-0.5, 0.5))[0]
    )
    base = base @ rotation(np.array([0, 1.0, 0]), rng.uniform(-0.5, 0.5))[0]
    return base, np.array([rng.uniform(290, 440), rng.uniform(-280, -140), rng.uniform(950, 1150)])


def palm_path(rng, pose, time):
    """Pose of the palm over time: a held hand that sways."""
    base, origin = pose
    sway = np.zeros((2, 3, len(time)))
    for size, row in ((0.008, sway[0]), (2.0, sway[1])):
        for axis in range(3):
            for _ in range(3):
                row[axis] += rng.normal(0, size) * np.sin(
                    2 * np.pi * rng.uniform(0.02, 0.18) * time + rng.uniform(0, 2 * np.pi)
                )
    turn = base
    for axis in range(3):
        turn = turn @ rotation(np.eye(3)[axis], sway[0, axis])
    return turn, origin + sway[1].T


def segment_poses(finger, proximal, distal, tilt, shift):
    """Rotation and centre of both segments in the palm frame."""
    _turn, _centre = [], []
    first = rotation(finger.axes[0], proximal)
    for axis, angle in tilt[0]:
        first = rotation(axis, angle) @ first
    root = finger.centres[0] + shift[0]
    second = rotation(finger.axes[1], distal)
    for axis, angle in tilt[1]:
        second = rotation(axis, angle) @ second
    joint = root + np.einsum("nij,nj->ni", first, finger.centres[1] - finger.centres[0] + shift[1])
    return (first, first @ second), (root, joint)


def finger_markers(run, time):
    """True marker positions in the palm frame, (n, 9, 3): palm, proximal, distal."""
    finger, hand, n = run.finger, run.hand, len(time)
    run.frame_time = time
    run.local = [np.repeat(m[None], n, axis=0) for m in (hand.palm_markers, finger.markers[0], finger.markers[1])]
    run.each("local")
    tilt = [[(axis, run.at(angle, time)) for axis, angle in joint] for joint in run.tilt]
    shift = [np.column_stack([run.at(s[:, j], time) for j in range(3)]) for s in run.shift]
    turns, centres = segment_poses(finger, run.at(run.proximal, time), run.at(run.distal, time), tilt, shift)
    parts = [run.local[0]]
    for turn, centre, local in zip(turns, centres, run.local[1:], strict=True):
        parts.append(np.einsum("nij,nkj->nki", turn, local) + centre[:, None])
    return np.concatenate(parts, axis=1)


def to_world(turn, origin, points):
    return np.einsum("nij,nkj->nki", turn, points) + origin[:, None]


def spoil(rng, points, noise, rate):
    """Camera noise and occlusions (NaN)."""
    points = points + rng.normal(0, noise, points.shape)
    n, markers, _ = points.shape
    for marker in range(markers):
        for _ in range(rng.poisson(n / rate / 36)):
            start = rng.integers(1, max(2, n - 20))
            points[start : start + rng.integers(3, 20), marker] = np.nan
    return points
