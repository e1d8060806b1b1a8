"""Is a joint a hinge? What the markers leave when it is taken for one, and what that does to the certainty of its
axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from .chain import propagate
from .likelihood import ChainFit

Array = NDArray[np.float64]

# Frames whose residuals are averaged: about the time a motion takes to change.
BLOCK = 50
ANGLE_BINS = 10
# A systematic residual is worth a sentence when it is certain and larger than a fifth of the noise of a marker.
CERTAIN = 1e-6
NOTABLE = 0.2


@dataclass(frozen=True)
class Misfit:
    """Systematic part of a segment's marker residuals over its joint's angle. rms_m, most_m [m]; p: that noise makes as
    much."""

    rms_m: float
    most_m: float
    p: float


def block_inflation(fit: ChainFit) -> float:
    """By how much the variance of block means of the residuals exceeds that of white noise: one where the chain fits.

    The covariance of the shared unknowns takes frames as independent; residuals that stay the same for a while carry
    less information than their number says (effective sample size; Bayley & Hammersley 1946).
    """
    ratios, counts = [], []
    for _, residual in _in_body(fit):
        count = len(residual) // BLOCK
        if count < 4:
            continue
        blocks = residual[: count * BLOCK].reshape(count, BLOCK, 3)
        white = np.mean(residual**2) / BLOCK
        ratios.append(np.mean(blocks.mean(1) ** 2) / max(white, 1e-300))
        counts.append(count)
    return max(1.0, float(np.average(ratios, weights=counts))) if ratios and fit.noise_m > 1e-7 else 1.0


def hinge_misfit(fit: ChainFit, joint: int) -> Misfit:
    """Mean residual of the segment behind a joint in bins of the joint's angle, against the scatter of blocks within a
    bin."""
    bins = _bins(fit.pose.angle_rad[:, joint])
    between, within, groups, blocks, largest = 0.0, 0.0, 0, 0, 0.0
    used = [(fit.weight[:, j] > 0.5, j) for j in np.flatnonzero(fit.data.body == joint + 1)]
    rotations = propagate(fit.chain, fit.data.body, fit.pose.angle_rad)[1]
    for seen, j in used:
        turned = np.einsum("nji,nj->ni", rotations[:, joint + 1], fit.residual_palm[:, j])
        for b in range(ANGLE_BINS):
            rows = turned[seen & (bins == b)]
            count = len(rows) // 10
            if count < 3:
                continue
            means = rows[: count * 10].reshape(count, 10, 3).mean(1)
            centre = means.mean(0)
            between += count * float(centre @ centre)
            within += float(((means - centre) ** 2).sum())
            groups, blocks = groups + 1, blocks + count
            largest = max(largest, float(np.linalg.norm(centre)))
    if groups == 0 or blocks <= groups:
        return Misfit(0.0, 0.0, 1.0)
    noise = within / (3 * (blocks - groups))
    ratio = between / (3 * groups) / max(noise, 1e-300)
    p = float(f_distribution.sf(ratio, 3 * groups, 3 * (blocks - groups)))
    return Misfit(float(np.sqrt(max(between - 3 * groups * noise, 0.0) / blocks)), largest, p)


def hinge_note(fit: ChainFit, joint: int) -> str:
    """A sentence where the joint's markers leave the hinge systematically, else ""."""
    misfit = hinge_misfit(fit, joint)
    if misfit.p > CERTAIN or misfit.rms_m < NOTABLE * fit.noise_m or fit.noise_m < 1e-7:
        return ""
    return (
        f"no plain hinge: its markers leave the hinge's motion by {1e3 * misfit.rms_m:.2f} mm (up to "
        f"{1e3 * misfit.most_m:.2f} mm) in step with the angle; a wobbling or travelling axis, "
        "or markers that move on their segment"
    )


def _bins(angle_rad: Array) -> NDArray[np.int64]:
    edges = np.quantile(angle_rad, np.linspace(0, 1, ANGLE_BINS + 1)[1:-1])
    return np.searchsorted(edges, angle_rad)


def _in_body(fit: ChainFit) -> list[tuple[int, Array]]:
    """Residuals (q, 3) [m] of every marker in its body's frame, frames in which it counts."""
    rotations = propagate(fit.chain, fit.data.body, fit.pose.angle_rad)[1]
    out = []
    for j, body in enumerate(fit.data.body):
        seen = fit.weight[:, j] > 0.5
        out.append((j, np.einsum("nji,nj->ni", rotations[seen, body], fit.residual_palm[seen, j])))
    return out
