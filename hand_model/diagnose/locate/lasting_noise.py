"""Noise of markers that lasts: what filtering, reflections and swaying cameras leave alike in neighbouring frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from .blocks import Blocks

Array = NDArray[np.float64]

STILL_RAD = 0.005  # by which a joint's angle, smoothed, may differ: what depends on it is the same
SMOOTHED = 5  # blocks
LONGEST = 8  # blocks over which noise may last; what lasts longer is a misfit
FEW = 100  # numbers, below which nothing is said of it
SURE = 3.0  # standard errors by which noise must last
SLOWEST = 0.8  # of what noise is alike from block to block, at most


@dataclass(frozen=True)
class LastingNoise:
    """inflation: variance of long means over what differences of neighbours promise (1 where noise is white). freedom:
    degrees of freedom behind it."""

    inflation: float = 1.0
    freedom: float = np.inf

    def chance(self, statistic: float, degrees: int) -> float:
        """Probability of a sum of squares as large (chi-square; Fisher's F where the noise lasts), of as many degrees of
        freedom, each over the variance that differences of neighbours promise."""
        from scipy.stats import chi2, f

        if self.inflation == 1.0:
            return float(chi2.sf(statistic, degrees))
        return float(f.sf(statistic / self.inflation / degrees, degrees, self.freedom))


def lasting_noise(blocks: Blocks, y: Array) -> LastingNoise:
    """How long noise lasts in readings y (b, 3m) [m], poses projected out, by the variogram (Matheron 1963) of blocks
    between which the finger stands still: no misfit by angle tells these apart. Beyond what is alike in neighbours it is
    taken to fade by the same share from block to block. The inflation is that of long means; those of blocks of many
    passes vary less, and a test of these is on the safe side."""
    free = y.shape[1] - blocks.pose_basis.shape[-1]
    still = _smoothed(blocks)
    step_s = float(np.median(np.diff(blocks.time_s)[np.diff(blocks.record) == 0]))
    square, count = [], 0
    for k in range(1, LONGEST + 1):
        apart = np.abs(still[k:] - still[:-k]).max(1)
        pair = (blocks.record[k:] == blocks.record[:-k]) & (apart < STILL_RAD)
        pair &= blocks.time_s[k:] - blocks.time_s[:-k] < 1.5 * k * step_s
        count = int(pair.sum())
        if count * free < FEW:
            return LastingNoise()
        # by the median, for what slips at rest is a misfit
        square.append(float(np.median(np.sum((y[k:] - y[:-k])[pair] ** 2, axis=1))))
    rise = np.array(square) / square[0]
    whole = float(np.mean(rise[-3:]))  # variance, in that of neighbours' differences
    alike, next_alike = whole - rise[0], whole - rise[1]
    if alike < SURE * np.sqrt(2.0 / (count * free)):
        return LastingNoise()
    share = float(np.clip(next_alike / alike, 0.0, SLOWEST))
    inflation = whole + 2 * alike / (1 - share)
    return LastingNoise(inflation, count * free / (2 * inflation))


def _smoothed(blocks: Blocks) -> Array:
    """Angles (b, k) [rad] without most of their noise, each recording by itself."""
    out = np.array(blocks.angle)
    for r in np.unique(blocks.record):
        rows = blocks.record == r
        out[rows] = uniform_filter1d(blocks.angle[rows], SMOOTHED, axis=0, mode="nearest")
    return out
