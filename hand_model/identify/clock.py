"""Clock alignment: which mocap time belongs to which log time.

log time = offset + rate * mocap time. Correlation finds the offset to a sample, least squares through the encoder map
refines it far below one sample and estimates the rate with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from ..errors import IdentificationError, SessionError

Array = NDArray[np.float64]

# Degree of the encoder map used while aligning: one above what a map may have, so that its shape does not pull on the
# clock.
MAP_DEGREE = 4
# Below this share of explained variance the two recordings show no common motion.
LEAST_EXPLAINED = 0.5
FALLING = 0.9  # counts of the other sign explain more than this, as recorded less


@dataclass(frozen=True)
class Clock:
    """log time = offset_s + rate * mocap time. rate is 1 unless the recording shows that it is not.

    offset_sd_s, rate_sd: standard deviations (of the rate as estimated freely, rate_free). explained: share of the
    angle's variance that the aligned encoder explains. lags_s, correlation: the search, for a picture.
    """

    offset_s: float
    rate: float
    offset_sd_s: float
    rate_free: float
    rate_sd: float
    explained: float
    lags_s: Array
    correlation: Array

    def log_time(self, mocap_time_s: Array) -> Array:
        """Log times [s] of mocap times [s]."""
        return self.offset_s + self.rate * np.asarray(mocap_time_s, float)


def align(mocap_time_s: Array, angle_rad: Array, log_time_s: Array, counts: Array, name: str = "trial") -> Clock:
    """Align a joint angle (n,) [rad] on the mocap clock with encoder counts (m,) on the log's clock.

    nan samples are left out. name: for the message. Raises IdentificationError where either does not move or they never
    correlate, SessionError where counts fall as the angle rises.
    """
    seen, kept = np.isfinite(angle_rad), np.isfinite(counts) & np.isfinite(log_time_s)
    t, q, s, c = mocap_time_s[seen], angle_rad[seen], log_time_s[kept], counts[kept]
    if len(t) < 20 or len(s) < 20:
        raise IdentificationError(
            f"{name}: {len(t)} marker frames and {len(s)} log samples; 20 of each are needed to align the clocks"
        )
    if np.ptp(c) == 0 or np.std(q) == 0:
        raise IdentificationError(
            f"{name}: nothing moves; a flexion through the whole range is needed to align the clocks"
        )
    lags, correlation = _correlate(t, q, s, c)
    offset, rate = float(lags[np.argmax(correlation)]), 1.0
    offset, rate, offset_sd, rate_sd, explained = _refine(t, q, s, c, offset)
    if explained < FALLING:
        lowest = float(lags[np.argmin(np.where(correlation > -1, correlation, 1.0))])
        if _refine(t, q, s, -c, lowest)[-1] > FALLING:
            raise SessionError(
                f"{name}: `position` falls as the finger flexes; it must increase with flexion, and the markers must "
                "begin with the hand open and at rest"
            )
    if explained < LEAST_EXPLAINED:
        raise IdentificationError(
            f"{name}: mocap and log never correlate (best alignment explains {100 * max(explained, 0):.0f} % of the "
            "motion); a log of the same motion is needed"
        )
    drifts = abs(rate - 1) > 4 * rate_sd
    rate_free = rate
    if not drifts:
        rate = 1.0
        offset += (rate_free - 1.0) * float(np.mean(t))
    return Clock(offset, rate, offset_sd, rate_free, rate_sd, explained, lags, correlation)


def _correlate(t: Array, q: Array, s: Array, c: Array) -> tuple[Array, Array]:
    """Correlation coefficient at every lag (log start time on the mocap clock) with at least half of the shorter
    overlapping."""
    step = max(float(np.median(np.diff(s))), float(np.median(np.diff(t))))
    a = np.interp(np.arange(t[0], t[-1], step), t, q)
    b = np.interp(np.arange(s[0], s[-1], step), s, c)
    a, b = (a - a.mean()) / a.std(), (b - b.mean()) / b.std()
    ones_a, ones_b = np.ones_like(a), np.ones_like(b)

    def slide(x: Array, y: Array) -> Array:
        return fftconvolve(y, x[::-1])

    overlap = np.round(slide(ones_a, ones_b))
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_a, mean_b = slide(a, ones_b) / overlap, slide(ones_a, b) / overlap
        covariance = slide(a, b) / overlap - mean_a * mean_b
        spread = np.sqrt(
            np.maximum(slide(a**2, ones_b) / overlap - mean_a**2, 0)
            * np.maximum(slide(ones_a, b**2) / overlap - mean_b**2, 0)
        )
        correlation = covariance / spread
    enough = overlap >= min(len(a), len(b)) / 2
    correlation = np.where(enough & (spread > 1e-3), correlation, -1.0)
    lag = np.arange(len(correlation)) - (len(a) - 1)  # index in b at which a starts
    return s[0] + lag * step - t[0], correlation


def _refine(t: Array, q: Array, s: Array, c: Array, offset: float) -> tuple[float, float, float, float, float]:
    """Gauss-Newton on offset and rate, encoder map eliminated; standard deviations from one-second blocks
    (sandwich)."""
    centre, spread = float(c.mean()), float(np.ptp(c)) / 2
    middle = float(t.mean())
    rate = 1.0
    for iteration in range(25):
        at = offset + middle + rate * (t - middle)
        inside = (at >= s[0]) & (at <= s[-1])
        if inside.sum() < 20:
            return offset, rate, np.inf, np.inf, 0.0
        u = (np.interp(at[inside], s, c) - centre) / spread
        basis = np.polynomial.polynomial.polyvander(u, MAP_DEGREE)
        coefficients = np.linalg.lstsq(basis, q[inside], rcond=None)[0]
        fitted = basis @ coefficients
        slope = _slope(at[inside], fitted)
        design = np.column_stack([basis, slope, slope * (t[inside] - middle)])
        residual = q[inside] - fitted
        keep = np.abs(residual) <= 6 * np.median(np.abs(residual)) + 1e-3 * np.ptp(q)
        solution = np.linalg.lstsq(design[keep], residual[keep], rcond=None)[0]
        shift, drift = solution[-2], solution[-1] if iteration > 3 else 0.0
        offset, rate = offset + np.clip(shift, -0.2, 0.2), float(np.clip(rate + drift, 0.9, 1.1))
        if iteration > 4 and max(abs(shift), abs(drift) * np.ptp(t)) < 1e-7:
            break
    explained = 1 - float(np.var(residual[keep]) / np.var(q[inside][keep]))
    offset_sd, rate_sd = _sandwich(design[keep], residual[keep], t[inside][keep])
    return offset + (1 - rate) * middle, rate, offset_sd, rate_sd, explained


def _slope(time_s: Array, value: Array) -> Array:
    """Time derivative of a noisy signal: differences over five samples each way."""
    n = len(value)
    ahead, behind = np.minimum(np.arange(n) + 5, n - 1), np.maximum(np.arange(n) - 5, 0)
    return (value[ahead] - value[behind]) / np.maximum(time_s[ahead] - time_s[behind], 1e-9)


def _sandwich(design: Array, residual: Array, time_s: Array) -> tuple[float, float]:
    bread = np.linalg.pinv(design.T @ design)
    block = np.floor(time_s - time_s[0]).astype(int)
    score = np.zeros((block.max() + 1, design.shape[1]))
    np.add.at(score, block, design * residual[:, None])
    sd = np.sqrt(np.maximum(np.diag(bread @ (score.T @ score) @ bread), 0))
    return float(sd[-2]), float(sd[-1])
