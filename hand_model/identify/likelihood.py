"""Maximum likelihood of a whole chain from its markers, with covariance.

Gauss-Newton (Levenberg-damped) on all frames; the blocks of the per-frame unknowns are eliminated (Schur complement;
Triggs et al. 2000, "Bundle adjustment: a modern synthesis", section 6), so cost is linear in frames. What remains is
the Fisher information of the shared unknowns; its inverse is their covariance and, at the truth, the Cramer-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from .chain import Chain, ChainData, Pose, frame_jacobian, jacobians, palm_pose, propagate

Array = NDArray[np.float64]

# Beyond this many standard deviations a marker loses weight, with the fourth power. 99.98 % of three-dimensional
# Gaussian
# residuals lie within, so nothing is lost on clean data, while ghosts, reflections and wrong labels fade away.
OUTLIER_LIMIT = 4.5
# A step of this many standard deviations (all shared unknowns together) is the last: the next would be far smaller.
STEP_LIMIT = 0.1
LAST_STEP = 1e-8  # [m, rad]: a frame that moves less stays
# Frames that bring the chain into its basin before all frames are used.
START_FRAMES = 400
# There the outlier limit starts this many times wider and halves with every step, so that a poor start is not taken for
# outliers.
ANNEALING = 8.0
# Frames linearised at a time: their Jacobians fit a second-level cache.
CHUNK = 512


@dataclass(frozen=True)
class ChainFit:
    """Result of `fit_chain`.

    covariance: (s, s) of the shared unknowns, ordered as in `Chain.moved`, in the gauge where the palm markers neither
    move nor turn as a whole and no joint's zero moves. angle_sd_rad: (n, k), chain known. noise_m: per coordinate.
    weight: (n, m) in [0, 1], zero where unseen. residual_palm: (n, m, 3) [m] observed minus modelled, nan where unseen.
    cost: half the robust sum of squares, in units of the noise. redundancy: observed coordinates minus unknowns.
    """

    data: ChainData
    chain: Chain
    pose: Pose
    covariance: Array
    angle_sd_rad: Array
    noise_m: float
    weight: Array
    residual_palm: Array
    cost: float
    redundancy: float
    converged: bool


@dataclass(frozen=True)
class _Normal:
    """Normal equations with the frames eliminated. frame_block: (n, f, f). back: (n, f, s + 1) solves a frame's
    step."""

    frame_block: Array
    back: Array
    reduced: Array
    gradient: Array


def fit_chain(data: ChainData, start: Chain, iterations: int = 20) -> ChainFit:
    """Estimate chain and poses from all frames; robust against ghosts and wrong labels, efficient on Gaussian noise.

    data: observations. start: a chain within the basin (`start.start_chain`).
    """
    chain = _optimise(data.thinned(START_FRAMES), start, iterations, ANNEALING)[0]
    chain, pose, noise, converged = _optimise(data, chain, iterations)
    return _finish(data, chain, pose, noise, converged)


def angle_noise_ratio(fit: ChainFit) -> Array:
    """(k,) noise of one frame's joint angle over the spread of that angle: small where the arc is long."""
    shown = fit.weight.sum(1) > 0
    return np.median(fit.angle_sd_rad[shown], axis=0) / np.maximum(np.std(fit.pose.angle_rad[shown], axis=0), 1e-9)


def fit_poses(data: ChainData, chain: Chain, noise_m: float, iterations: int = 8) -> tuple[Pose, Array]:
    """Poses of all frames for a known chain, and the robust weights (n, m) of their markers."""
    pose = palm_pose(chain, data)
    left = np.arange(len(data.position_world))  # frames that still move
    for _ in range(iterations):
        here, seen = pose.take(left), data.take(left)
        x, by_frame = frame_jacobian(chain, data.body, here.angle_rad)
        residual = here.to_palm(seen.position_world) - x
        block, gradient = _frame_system(by_frame, residual, robust_weight(residual, noise_m))
        step = np.linalg.solve(block, gradient[..., None])[..., 0]
        pose.put(left, here.moved(step))
        left = left[np.abs(step).max(axis=1) >= LAST_STEP]
        if not len(left):
            break
    return pose, robust_weight(_residual(data, chain, pose), noise_m)


def robust_weight(residual: Array, noise_m: float) -> Array:
    """Weights (n, m) of residuals (n, m, 3) [m]: one up to `OUTLIER_LIMIT` standard deviations, then the fourth power
    of the ratio; zero where unseen."""
    distance = np.linalg.norm(residual, axis=-1) / noise_m
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(distance > OUTLIER_LIMIT, (OUTLIER_LIMIT / distance) ** 4, 1.0)
    return np.where(np.isfinite(distance), weight, 0.0)


def robust_cost(residual: Array, noise_m: float) -> float:
    """Half the sum of squared residuals in units of the noise, bounded for outliers: the loss of `robust_weight`."""
    square = np.nansum(residual**2, axis=-1) / noise_m**2
    limit = OUTLIER_LIMIT**2
    with np.errstate(divide="ignore"):
        return 0.5 * float(np.where(square > limit, 2 * limit - limit**2 / square, square).sum())


def _residual(data: ChainData, chain: Chain, pose: Pose) -> Array:
    return pose.to_palm(data.position_world) - propagate(chain, data.body, pose.angle_rad)[0]


def _linearise(data: ChainData, chain: Chain, pose: Pose) -> tuple[Array, Array, Array, Array]:
    x, by_frame, by_marker, by_joint = jacobians(chain, data.body, pose.angle_rad)
    return pose.to_palm(data.position_world) - x, by_frame, by_marker, by_joint


def _optimise(data: ChainData, chain: Chain, iterations: int, width: float = 1.0) -> tuple[Chain, Pose, float, bool]:
    pose = palm_pose(chain, data)
    damping = 1e-8
    residual = _residual(data, chain, pose)
    noise = _noise(residual, data)
    for _ in range(iterations):
        scale = noise * width
        cost = robust_cost(residual, scale)
        normal = _assemble(data, chain, pose, robust_weight(residual, scale))
        for _ in range(8):
            shared, frames = _step(normal, chain, data, damping)
            new_chain, new_pose = chain.moved(shared), pose.moved(frames)
            new_residual = _residual(data, new_chain, new_pose)
            if robust_cost(new_residual, scale) <= cost * (1 + 1e-9):
                damping = max(damping / 10, 1e-12)
                break
            damping = max(damping * 100, 1e-6)
        else:
            return chain, pose, noise, False
        chain, pose, residual = new_chain, new_pose, new_residual
        noise = _noise(residual, data)
        if width == 1.0 and shared @ normal.reduced @ shared < (STEP_LIMIT * noise) ** 2:
            return chain, pose, noise, True
        width = max(1.0, width / 2)
    return chain, pose, noise, False


def _noise(residual: Array, data: ChainData) -> float:
    """Robust noise per coordinate [m]: median of squared marker residuals, corrected for what the pose fit absorbs."""
    square = np.sum(residual**2, axis=-1)
    square = square[np.isfinite(square)]
    unknowns = (6 + data.n_joints) * len(residual)
    kept = max(1 - unknowns / (3 * square.size), 0.05)
    return float(np.sqrt(np.median(square) / 2.366 / kept)) + 1e-12  # 2.366: median of chi-squared with three degrees


def _frame_system(by_frame: Array, residual: Array, weight: Array) -> tuple[Array, Array]:
    n, _, _, f = by_frame.shape
    flat = by_frame.reshape(n, -1, f)
    weighted = flat * np.repeat(weight, 3, axis=1)[..., None]
    block = np.swapaxes(flat, 1, 2) @ weighted
    trace = np.einsum("nii->n", block)[:, None, None]
    block = block + np.eye(f) * np.maximum(trace * 1e-9, 1e-9)  # a frame that sees too little keeps its start value
    gradient = np.einsum("nrf,nr->nf", weighted, np.nan_to_num(residual).reshape(n, -1))
    return block, gradient


def _assemble(data: ChainData, chain: Chain, pose: Pose, weight: Array) -> _Normal:
    """Normal equations, a chunk of frames at a time so that what is worked on stays in the cache."""
    n, f, size = len(weight), 6 + data.n_joints, chain.size
    block, back = np.empty((n, f, f)), np.empty((n, f, size + 1))
    reduced, gradient = np.zeros((size, size)), np.zeros(size)
    for start in range(0, n, CHUNK):
        part = slice(start, start + CHUNK)
        linear = _linearise(data.take(part), chain, pose.take(part))
        block[part], back[part], more, more_gradient = _assemble_chunk(linear, weight[part])
        reduced += more
        gradient += more_gradient
    return _Normal(block, back, (reduced + reduced.T) / 2, gradient)


def _assemble_chunk(linear: tuple[Array, Array, Array, Array], weight: Array) -> tuple[Array, Array, Array, Array]:
    residual, by_frame, by_marker, by_joint = linear
    n, m, _, f = by_frame.shape
    block, frame_gradient = _frame_system(by_frame, residual, weight)
    r = np.nan_to_num(residual)
    w = weight[..., None, None]
    frame_marker = np.einsum("nmif,nmij->nfmj", by_frame * w, by_marker, optimize=True).reshape(n, f, 3 * m)
    flat_joint = by_joint.reshape(n, 3 * m, -1)
    weighted_joint = flat_joint * np.repeat(weight, 3, axis=1)[..., None]
    frame_joint = np.swapaxes(by_frame.reshape(n, 3 * m, f), 1, 2) @ weighted_joint
    frame_shared = np.concatenate([frame_marker, frame_joint], axis=2)
    size, columns = frame_shared.shape[2], flat_joint.shape[2]
    shared = np.zeros((size, size))
    shared[: 3 * m, : 3 * m] = np.diag(np.repeat(weight.sum(0), 3))
    marker_joint = np.einsum("nmij,nmiq->mjq", by_marker * w, by_joint, optimize=True).reshape(3 * m, -1)
    shared[: 3 * m, 3 * m :], shared[3 * m :, : 3 * m] = marker_joint, marker_joint.T
    shared[3 * m :, 3 * m :] = flat_joint.reshape(-1, columns).T @ weighted_joint.reshape(-1, columns)
    gradient_marker = np.einsum("nmij,nmi->mj", by_marker * w, r, optimize=True).ravel()
    gradient_joint = np.einsum("nrq,nr->q", weighted_joint, r.reshape(n, -1))
    back = np.linalg.solve(block, np.concatenate([frame_shared, frame_gradient[..., None]], axis=2))
    eliminated = frame_shared.reshape(n * f, size).T @ back.reshape(n * f, size + 1)
    return (
        block,
        back,
        shared - eliminated[:, :size],
        np.concatenate([gradient_marker, gradient_joint]) - eliminated[:, size],
    )


def free_directions(chain: Chain, body: Array) -> Array:
    """(s, s - 6 - k) orthonormal steps that leave the gauge alone: palm markers as a whole, and each joint's zero."""
    k = len(chain.axis_palm)
    fixed = np.zeros((6 + k, chain.size))
    for j in np.flatnonzero(body == 0):
        centred = chain.marker_palm[j] - chain.marker_palm[body == 0].mean(0)
        fixed[:3, 3 * j : 3 * j + 3] = np.eye(3)
        for i in range(3):
            fixed[3 + i, 3 * j : 3 * j + 3] = np.cross(np.eye(3)[i], centred)
    for joint in range(k):
        for j in np.flatnonzero(body == joint + 1):
            arm = chain.marker_palm[j] - chain.centre_palm[joint]
            fixed[6 + joint, 3 * j : 3 * j + 3] = np.cross(chain.axis_palm[joint], arm)
    fixed /= np.linalg.norm(fixed, axis=1, keepdims=True)
    return scipy.linalg.null_space(fixed)


def _step(normal: _Normal, chain: Chain, data: ChainData, damping: float) -> tuple[Array, Array]:
    free = free_directions(chain, data.body)
    system = free.T @ normal.reduced @ free
    system += damping * np.diag(np.maximum(np.diag(system), 1e-9))
    shared = free @ np.linalg.lstsq(system, free.T @ normal.gradient, rcond=1e-14)[0]
    frames = normal.back[..., -1] - normal.back[..., :-1] @ shared
    return shared, frames


def _finish(data: ChainData, chain: Chain, pose: Pose, noise: float, converged: bool) -> ChainFit:
    residual = _residual(data, chain, pose)
    weight = robust_weight(residual, noise)
    normal = _assemble(data, chain, pose, weight)
    free = free_directions(chain, data.body)
    redundancy = 3 * weight.sum() - (6 + data.n_joints) * (weight.sum(1) > 0).sum() - free.shape[1]
    noise = float(np.sqrt(np.nansum(weight[..., None] * residual**2) / max(redundancy, 1.0)))
    covariance = noise**2 * free @ np.linalg.pinv(free.T @ normal.reduced @ free, rcond=1e-15, hermitian=True) @ free.T
    angle_sd = noise * np.sqrt(np.einsum("nii->ni", np.linalg.inv(normal.frame_block))[:, 6:])
    return ChainFit(
        data,
        chain,
        pose,
        covariance,
        angle_sd,
        noise,
        weight,
        residual,
        robust_cost(residual, noise),
        redundancy,
        converged,
    )
