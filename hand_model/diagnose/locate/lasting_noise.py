"""Noise of markers that lasts: what filtering, reflections and swaying cameras leave alike in neighbouring frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ...session import Session
from .blocks import Blocks, frames_of_block

Array = NDArray[np.float64]

STILL_RAD = 0.005  # by which a joint's angle, smoothed, may differ: what depends on it is the same
SMOOTHED = 5  # blocks
LONGEST = 8  # blocks over which noise may last; what lasts longer is a misfit
FEW = 100  # numbers, below which nothing is said of it
SURE = 3.0  # standard errors by which noise must last
SLOWEST = 0.8  # of what noise is alike from block to block, at most
FARTHEST = 64  # blocks over which slow noise of the cameras fades, at most; readings farther apart share none of it
OCTAVES = ((9, 16), (17, 32), (33, FARTHEST))  # blocks apart
ALIKE_RAD = 0.02  # by which angles of two passes may differ: a segment's misfit by angle is the same


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


def lasting_noise(blocks: Blocks, y: Array, drift: float = 0.0) -> LastingNoise:
    """How long noise lasts in readings y (b, 3m) [m], poses projected out: what lasts for a moment, and beside it what lasts
    for seconds. drift: `camera_drift`."""
    brief, slow = _brief(blocks, y), _slow(blocks, y, drift)
    if slow == 0.0:
        return brief
    inflation = brief.inflation + slow
    return LastingNoise(inflation, len(y) * (y.shape[1] - blocks.pose_basis.shape[-1]) / (2 * inflation))


def _brief(blocks: Blocks, y: Array) -> LastingNoise:
    """How long noise lasts, by the variogram (Matheron 1963) of blocks between which the finger stands still: no misfit by
    angle tells these apart. Beyond what is alike in neighbours it is taken to fade by the same share from block to
    block. The inflation is that of long means; those of blocks of many passes vary less, and a test of these is on the
    safe side."""
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


def camera_drift(session: Session) -> float:
    """How much more distances between palm markers vary in seconds than from moment to moment (variance over variance,
    less one): in the least of all flexion recordings, of all fingers, for a palm marker that creeps or slips is at fault
    in some; zero where one of them shows nothing, or there is but one."""
    if session.palm is None:
        return 0.0
    labels = session.palm.labels
    rises = [
        _drifts(trial.mocap().markers(labels), trial.mocap().time_s)
        for trial in session.select("flexion")
        if trial.mocap_path is not None
    ]
    return min(rises) if len(rises) > 1 else 0.0


def long_means(drift: float) -> float:
    """Variance of means over many seconds over what differences of moments promise, at most, where cameras drift."""
    return 1.0 + 2.0 * FARTHEST * drift


def _drifts(markers: Array, time_s: Array) -> float:
    """The same of one recording of markers (n, m, 3) [m] at time_s (n,)."""
    length = frames_of_block(time_s)
    count = len(markers) // length
    if count < 2 * FARTHEST:
        return 0.0
    one, other = np.triu_indices(markers.shape[1], 1)
    apart = np.linalg.norm(markers[:, one] - markers[:, other], axis=-1)[: count * length]
    means = apart.reshape(count, length, -1).mean(1)  # nan where one is not seen
    far, near = (
        np.concatenate([means[k:] - means[:-k] for k in range(first, last, stride)])
        for first, last, stride in ((FARTHEST + 1, count // 2 + 1, 7), (1, LONGEST + 1, 1))
    )
    sound = [d[np.isfinite(d).all(1)] for d in (far, near)]
    if min(len(d) for d in sound) < FEW:
        return 0.0
    seconds, moments = (np.median(d**2, axis=0) for d in sound)
    if np.any(moments == 0):  # no noise at all
        return 0.0
    rise = float(np.mean(seconds / moments)) - 1.0
    return rise if rise > SURE * np.sqrt(4.0 / (count * min(len(one), 3))) else 0.0


def _slow(blocks: Blocks, y: Array, drift: float) -> float:
    """What cameras that drift for seconds add to the variance of long means of readings y (b, 3m) [m], over what
    differences of neighbours promise; zero where they do not.

    By the variogram between passes of the same angle, one way: no misfit by angle tells these apart. What slips or sways
    is one segment, or one recording; noise of the cameras is in all of them, and as much as in the least of them.
    """
    if drift == 0.0:
        return 0.0
    lag, record, square = _passes(blocks, y)
    near, far = square[lag <= LONGEST], [square[(lag > FARTHEST) & (record == r)] for r in np.unique(blocks.record)]
    if min(len(pairs) for pairs in (near, *far)) < FEW:
        return 0.0
    usual = np.median(near, axis=0)
    rise = np.array([np.median(pairs, axis=0) for pairs in far]) / usual - 1.0
    if np.any(rise <= 0.0):
        return 0.0
    whole, lasts = 1.0 + float(np.median(rise)), float(LONGEST)
    for first, last in OCTAVES:
        pairs = square[(lag >= first) & (lag <= last)]
        share = (whole - np.median(np.median(pairs, axis=0) / usual)) / (whole - 1.0) if len(pairs) >= FEW else 1.0
        lasts += float(np.clip(share, 0.0, 1.0)) * (last - first + 1)
    return min(float(rise.min()), drift) * (1.0 + 2.0 * lasts)


def _passes(blocks: Blocks, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Pairs of blocks of a recording at the same angles and on the same way: how many blocks they are apart (p,), their
    recording (p,), and the square of their difference, of every body (p, k) [m^2]."""
    still = _smoothed(blocks)
    way = np.sign(np.gradient(still, axis=0))
    of_body = [np.repeat(blocks.body, 3) == k for k in np.unique(blocks.body)]
    lags, records, squares = [], [], []
    for k in range(1, len(y) // 2 + 1):
        pair = (blocks.record[k:] == blocks.record[:-k]) & np.all(way[k:] == way[:-k], axis=1)
        pair &= np.abs(still[k:] - still[:-k]).max(1) < ALIKE_RAD
        step = (y[k:] - y[:-k])[pair]
        lags.append(np.full(len(step), k))
        records.append(blocks.record[k:][pair])
        squares.append(np.stack([np.sum(step[:, own] ** 2, axis=1) for own in of_body], 1))
    return np.concatenate(lags), np.concatenate(records), np.concatenate(squares)


def _smoothed(blocks: Blocks) -> Array:
    """Angles (b, k) [rad] without most of their noise, each recording by itself."""
    out = np.array(blocks.angle)
    for r in np.unique(blocks.record):
        rows = blocks.record == r
        out[rows] = uniform_filter1d(blocks.angle[rows], SMOOTHED, axis=0, mode="nearest")
    return out
