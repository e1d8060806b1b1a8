"""Blocks of frames of one finger's markers: residuals from the chain, what poses explain, what the chain could."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ...identify.chain import Chain, jacobians, propagate
from ...identify.likelihood import OUTLIER_LIMIT
from .angles import FARTHEST_M, FingerAngles

Array = NDArray[np.float64]

BLOCK, BLOCK_S = 8, 1 / 15  # frames averaged into one row block, at least, and how long they last
# blocks over which the noise is read, and the share of the usual variance from which it is louder
LOUD_BLOCKS, LOUD = 5, 0.6
TURNED = 0.02  # of a joint's range: over so much of it play changes sides
RESTING = 0.1  # of a joint's fast speeds: slower it is about to stand
LASTING_S = 2.0  # half of it is how long something must last that is no ghost


@dataclass(frozen=True)
class Blocks:
    """Block means of all flexion recordings of one finger, in order of time.

    residual: (b, m, 3) [m] observed minus chain, palm frame. weight: (b, m) share of its frames that a mean is of, times
    BLOCK. pose_basis: (b, 3m, 6+k) orthonormal basis of what poses explain. chain_columns: (b, 3m, s). rotation: (b, m,
    3, 3) body to palm. position: (b, m, 3). angle: (b, k). record, time_s: (b,). labels, body: of the markers. frames:
    of a block. palm: (b, 3, 3) palm to the cameras' frame.
    """

    residual: Array
    weight: Array
    pose_basis: Array
    chain_columns: Array
    rotation: Array
    position: Array
    axes: Array
    centres: Array
    angle: Array
    record: NDArray[np.int64]
    time_s: Array
    labels: tuple[str, ...]
    body: NDArray[np.int64]
    palm: Array
    frames: int = BLOCK


def frames_of_block(time_s: Array) -> int:
    """How many frames at times (n,) [s] one block is of."""
    return max(BLOCK, round(BLOCK_S / max(float(np.median(np.diff(time_s))), 1e-9)))


def blocks_of(angles: FingerAngles) -> Blocks:
    """Residuals, Jacobians and projections in blocks of frames."""
    labels, body = angles.records[0].data.labels, angles.records[0].data.body
    chain = angles.chain
    parts: list[tuple[Array, ...]] = []
    for index, record in enumerate(angles.records):
        observed = record.data.position_world
        residual = record.pose.to_palm(observed) - propagate(chain, body, record.pose.angle_rad)[0]
        size = np.linalg.norm(residual, axis=-1)
        sound = np.isfinite(record.angle_rad).all(1)
        far = ~(size < FARTHEST_M) | passing(size > OUTLIER_LIMIT * angles.noise_m, record.mocap.time_s)
        good = np.flatnonzero(~record.ghost & (sound | (~far.any(1) & ~passing(~sound, record.mocap.time_s))))
        length = frames_of_block(record.mocap.time_s)
        count = len(good) // length
        if count < 20:
            continue
        frames = good[: count * length].reshape(count, length)
        frames = frames[(frames[:, -1] - frames[:, 0]) < 3 * length]
        residual[far] = np.nan
        residual = residual[frames.ravel()]
        residual = residual.reshape(len(frames), length, len(labels), 3)
        weight = np.isfinite(residual[..., 0]).sum(1).astype(float)
        mean = np.nansum(residual, axis=1) / np.maximum(weight, 1)[..., None]
        weight *= _calm(residual - mean[:, None])[:, None] * BLOCK / length
        angle = record.pose.angle_rad[frames].mean(1)
        palm, when = record.pose.rotation[frames[:, length // 2]], record.mocap.time_s[frames].mean(1)
        parts.append((mean, weight, angle, palm, np.full(len(frames), index), when))
    residual, weight, angle, palm, record_index, time_s = (np.concatenate(p) for p in zip(*parts, strict=True))
    blocks = _assembled(chain, body, labels, residual, weight, angle, palm, record_index, time_s)
    return replace(blocks, frames=frames_of_block(angles.records[0].mocap.time_s))


def _calm(scatter: Array) -> Array:
    """Usual over present variance of the readings (b,) within blocks, at most one: what is seen while the cameras are
    disturbed counts for less. scatter: (b, frames, m, 3) [m], nan where nothing is seen."""
    variance = uniform_filter1d(np.nan_to_num(np.nanmean(scatter**2, axis=(1, 2, 3))), LOUD_BLOCKS, mode="nearest")
    share = np.median(variance) / np.maximum(variance, 1e-30)
    return np.where(share < LOUD, share, 1.0)


def passing(flag: NDArray[np.bool_], time_s: Array) -> NDArray[np.bool_]:
    """Where a flag (n,) or (n, m) is up for a moment only: a ghost passes, a slip lasts."""
    width = max(int(LASTING_S / float(np.median(np.diff(time_s)))), 1)
    up = uniform_filter1d(flag.astype(float), width, axis=0, mode="nearest")
    return flag & (up < 0.45)


def _assembled(
    chain: Chain,
    body: NDArray[np.int64],
    labels: tuple[str, ...],
    residual: Array,
    weight: Array,
    angle: Array,
    palm: Array,
    record: Array,
    time_s: Array,
) -> Blocks:
    x, by_frame, by_marker, by_joint = jacobians(chain, body, angle)
    _, _, joints = propagate(chain, body, angle)
    b, m = weight.shape
    root = np.sqrt(np.repeat(weight / BLOCK, 3, axis=1))[..., None]
    basis, _ = np.linalg.qr(by_frame.reshape(b, 3 * m, -1) * root)
    shared = np.zeros((b, m, 3, 3 * m))
    for j in range(m):
        shared[:, j, :, 3 * j : 3 * j + 3] = by_marker[:, j]
    columns = np.concatenate([shared.reshape(b, 3 * m, -1), by_joint.reshape(b, 3 * m, -1)], axis=-1)
    return Blocks(
        residual,
        weight,
        basis,
        columns,
        by_marker,
        x,
        np.stack([a for a, _ in joints], 1),
        np.stack([c for _, c in joints], 1),
        angle,
        record.astype(int),
        time_s,
        labels,
        body,
        palm,
    )


def share_of_range(blocks: Blocks, joint: int) -> Array:
    """Angle (b,) of a joint over the range that it was recorded in: zero where it begins, one where it ends."""
    angle = blocks.angle[:, joint]
    low, high = np.quantile(angle, [0.005, 0.995])
    return (angle - low) / max(high - low, 1e-9)


def across_axis(blocks: Blocks, joint: int) -> tuple[Array, Array]:
    """Two directions (b, 3) across a joint's axis and across each other, that turn with the segment before it."""
    axis = blocks.axes[:, joint]
    helper = np.eye(3)[np.argmin(np.abs(axis[0]))]
    if joint > 0:
        before = blocks.rotation[:, int(np.flatnonzero(blocks.body == joint)[0])]
        helper = before @ before[0].T @ helper
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(axis, first)


def way_of_motion(blocks: Blocks, joint: int) -> Array:
    """Which way (b,) a joint was moving last: one while its angle grows, minus one while it falls, between the two while
    it turns round over TURNED of its range (stop operator; Visintin 1994, "Differential models of hysteresis", III.1).
    Zero until each recording's first motion."""
    u, out = share_of_range(blocks, joint), np.zeros(len(blocks.time_s))
    for i in range(1, len(out)):
        if blocks.record[i] == blocks.record[i - 1]:
            out[i] = min(max(out[i - 1] + 2 * (u[i] - u[i - 1]) / TURNED, -1.0), 1.0)
    return out


def turning_rate(blocks: Blocks, joint: int) -> Array:
    """Rate (b,) of a joint's angle, over one that only a tenth of the blocks exceed."""
    u, out = share_of_range(blocks, joint), np.zeros(len(blocks.time_s))
    for r in np.unique(blocks.record):
        rows = np.flatnonzero(blocks.record == r)
        if len(rows) > 1:
            out[rows] = np.gradient(u[rows], blocks.time_s[rows])
    return out / max(float(np.quantile(np.abs(out), 0.9)), 1e-12)


def present_way(blocks: Blocks, joint: int) -> Array:
    """Which way (b,) a joint is moving: one while its angle grows, minus one while it falls, zero at rest."""
    return np.clip(turning_rate(blocks, joint) / RESTING, -1.0, 1.0)


def project(blocks: Blocks, columns: Array) -> Array:
    """Columns (b, 3m, c), weighted, minus what each block's pose explains."""
    root = np.sqrt(np.repeat(blocks.weight / BLOCK, 3, axis=1))[..., None]
    c = columns * root
    return c - blocks.pose_basis @ (np.swapaxes(blocks.pose_basis, 1, 2) @ c)
