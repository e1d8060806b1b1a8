"""Proof of a joint that is no plain hinge: recorded markers against the compiled files' kinematics, on recordings that
took no part.

Palm pose and angles of every frame are fitted with the file's own chain (nothing else could say where the palm was);
what the markers then leave, averaged over a few frames, is compared. Both files are compared on the same readings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...identify.chain import Chain, ChainData, propagate
from ...identify.likelihood import OUTLIER_LIMIT, fit_poses
from ..locate.angles import FARTHEST_M
from ..locate.blocks import frames_of_block, passing
from ..locate.course import FingerCourses
from .replays import reduction

Array = NDArray[np.float64]

COMPILED = "mujoco: kinematics of the compiled file, palm and angles fitted to every frame"
OWN = "chain and course, palm and angles fitted to every frame"
LEAST_FRAMES = 0.75  # share of a block's that a mean needs
SPELL = 12  # means that are drawn together: neighbours are alike


@dataclass(frozen=True)
class Replayed:
    """A chain, and where its markers (n, m, 3) [m] are in the palm frame at angles (n, k) [rad]."""

    chain: Chain
    positions: Callable[[Array], Array]


def of_chain(chain: Chain, body: NDArray[np.int64]) -> Replayed:
    """A chain by this project's own kinematics."""
    return Replayed(chain, lambda angle: propagate(chain, body, angle)[0])


def of_folder(folder: Path, finger: str, labels: Sequence[str]) -> Replayed:
    """A compiled finger by MuJoCo's kinematics of its file; raises DescriptionError where it lacks one of the
    markers."""
    from ...description import read_description
    from ...engines import mujoco, ours
    from ...replay import chain_of

    description = read_description(folder)
    model = next(m for m in description.models if finger in m.fingers)
    chain = chain_of(description.hand, finger, labels)
    names, loaded = ours.load(model.mjcf).names, mujoco.load(model.mjcf)
    sites = [names.marker.get(("", label)) or names.marker[finger, label] for label in labels]
    joints = [names.joint[finger, j.name] for j in description.hand.finger(finger).joints]

    def positions(angle: Array) -> Array:
        found = mujoco.positions(loaded, {name: angle[:, k] for k, name in enumerate(joints)})
        return np.stack([found[site] for site in sites], axis=1)

    return Replayed(chain, positions)


def marker_fit(courses: FingerCourses, before: Replayed, after: Replayed, engine: str) -> dict[str, Any]:
    """`fit` of a finding: root mean square of what means over blocks of frames leave per coordinate [m], and their noise by
    differences of neighbours, on the recordings kept out (on all, where none is)."""
    records = courses.angles.records
    chosen = [i for i, r in enumerate(records) if r.trial.validate] or list(range(len(records)))
    left, right, noise, blocks = [], [], [], []
    for i in chosen:
        pair, steps, block = _left(courses, i, before, after)
        left.append(pair[0])
        right.append(pair[1])
        noise.append(steps)
        blocks.append(block)
    fit = reduction(left, right, blocks)
    floor = float(np.sqrt(0.5 * np.mean(np.concatenate(noise) ** 2)))
    return {
        "metric": "marker_rmse",
        "unit": "m",
        **fit,
        "noise_floor": floor,
        "engine": engine,
        "held_out": [records[i].trial.name for i in chosen if records[i].trial.validate],
    }


def _left(
    courses: FingerCourses, index: int, before: Replayed, after: Replayed
) -> tuple[tuple[Array, Array], Array, NDArray[np.int64]]:
    """Of one recording: what block means leave before and after (q,) [m], differences of neighbours after, and a number
    (q,) of their spell."""
    record, data, noise = courses.angles.records[index], courses.data[index], courses.angles.noise_m
    far = np.linalg.norm(_errors(data, after, noise), axis=-1) > OUTLIER_LIMIT * noise
    seen = np.isfinite(data.position_world[..., 0]) & ~passing(far, record.mocap.time_s) & ~record.ghost[:, None]
    clean = replace(data, position_world=np.where(seen[..., None], data.position_world, np.nan))
    one, other = (_errors(clean, file, FARTHEST_M / OUTLIER_LIMIT) for file in (before, after))
    seen &= (np.linalg.norm(one, axis=-1) < FARTHEST_M) & (np.linalg.norm(other, axis=-1) < FARTHEST_M)
    length = frames_of_block(record.mocap.time_s)
    one, other = _means(one, seen, length), _means(other, seen, length)
    both = np.isfinite(one) & np.isfinite(other)
    steps = np.diff(other, axis=0)
    spell = np.broadcast_to((np.arange(len(one)) // SPELL)[:, None, None], one.shape)
    return (one[both], other[both]), steps[np.isfinite(steps)], spell[both]


def _errors(data: ChainData, file: Replayed, noise_m: float) -> Array:
    """Recorded minus replayed (n, m, 3) [m] in the palm frame."""
    pose, _ = fit_poses(data, file.chain, noise_m)
    return pose.to_palm(data.position_world) - file.positions(pose.angle_rad)


def _means(errors: Array, seen: NDArray[np.bool_], length: int) -> Array:
    """Means (b, m, 3) over blocks of so many frames, nan where too few are seen."""
    count = len(errors) // length
    shown = seen[: count * length].reshape(count, length, -1)
    values = np.where(shown[..., None], errors[: count * length].reshape(count, length, -1, 3), 0.0)
    size = shown.sum(1)[..., None]
    return np.where(size >= LEAST_FRAMES * length, values.sum(1) / np.maximum(size, 1), np.nan)
