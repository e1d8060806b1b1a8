"""What the engines share: angles by name into columns, and frames relative to the palm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DescriptionError, did_you_mean

Array = NDArray[np.float64]

ROOT = "palm"


def columns(joints: Sequence[str], joint_angles: Mapping[str, ArrayLike]) -> Array:
    """Angles (n, joints) [rad]; zero where a joint is not given, n = 1 where none is.

    Raises DescriptionError for a joint that the model has not, or arrays of different lengths.
    """
    for name in joint_angles:
        if name not in joints:
            raise DescriptionError(f'the model has no joint "{name}"; {did_you_mean(name, joints)}')
    given = {name: np.atleast_1d(np.asarray(angle, float)) for name, angle in joint_angles.items()}
    lengths = {angle.shape for angle in given.values()}
    if len(lengths) > 1 or any(len(shape) != 1 for shape in lengths):
        raise DescriptionError(f"joint angles need one length; these have shapes {sorted(lengths)}")
    n = lengths.pop()[0] if lengths else 1
    table = np.zeros((n, len(joints)))
    for name, angle in given.items():
        table[:, joints.index(name)] = angle
    return table


def relative(poses: Mapping[str, Array], points: Mapping[str, Array]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Link poses (n, 4, 4) and points (n, 3) [m] seen from the link `palm`, where there is one."""
    if ROOT not in poses:
        return dict(poses), dict(points)
    base = poses[ROOT]
    if np.array_equal(base, np.broadcast_to(np.eye(4), base.shape)):
        return dict(poses), dict(points)
    inverse = np.linalg.inv(base)
    moved = {name: (inverse[:, :3, :3] @ p[:, :, None])[..., 0] + inverse[:, :3, 3] for name, p in points.items()}
    return {name: inverse @ pose for name, pose in poses.items()}, moved


def homogeneous(rotation: Array, translation: Array) -> Array:
    """Transforms (n, 4, 4) of rotations (n, 3, 3) and translations (n, 3) [m]."""
    out = np.zeros((*rotation.shape[:-2], 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = rotation, translation, 1.0
    return out
