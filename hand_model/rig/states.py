"""Smooth states of a recorded joint: position, velocity and acceleration by one zero-phase filter, effort by the same.

The cut-off is chosen from the recording: as high as the position noise lets the acceleration be (Gautier 1997 asks for
both sides of the balance to pass one filter; the cut-off rule is ours).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOISE_SHARE = 0.03  # acceleration noise allowed, as a share of the acceleration itself
ORDER = 4
# of states: they lose nothing of the band in which a balance weighs them, and of noise only what lies in their own
STEEP = 8
PASSED = 0.45  # of the sampling rate: a filter above lets everything through
WINDOWS = (5, 7, 11, 15, 21, 29, 41, 57, 81, 113, 159, 225, 317, 447)  # samples
ROUNDING = 8.2 / 70.0**0.5  # steps: weights of a fourth difference add up to 16; a little for the motion itself
OFF_RUNG = 0.1  # steps: digits of a log do not hold an encoder's step exactly
LEAST_SAMPLES = 30  # of a recording: fewer pass no filter
KNOTS = 16  # after which a spline has forgotten how it began: 0.27^16 is 1e-9
SURE = 2.0  # half width of a confidence interval, in standard deviations


def fill_gaps(time_s: Array, values: Array) -> Array:
    """Linear interpolation over lost samples (nan), (n,); constant beyond the ends."""
    good = np.isfinite(values)
    return values if good.all() else np.interp(time_s, time_s[good], values[good])


def uniform_time(time_s: Array) -> Array:
    """An even grid over the trial at the median rate, (m,) [s]."""
    step = float(np.median(np.diff(time_s)))
    return np.arange(int(np.floor((time_s[-1] - time_s[0]) / step + 1e-6)) + 1) * step + time_s[0]


def noise_std(values: Array, time_s: Array | None = None) -> float:
    """Standard deviation of the white part of a signal, from fourth differences, or its step/sqrt(12); time_s: its own
    stamps, where they are uneven (fourth divided differences: of even ones what moves smoothly would be noise)."""
    fourth = np.diff(values, 4) / np.sqrt(70.0) if time_s is None else _fourth(time_s, values)
    size, step = np.abs(fourth - np.median(fourth)), ladder_step(values)
    # Rounding moves a value by half a step at most: what it can do alone is no other noise, and its size is known.
    rounding = step > 0 and np.percentile(size, 99.9) <= ROUNDING * step
    white = 0.0 if rounding else _median(size, step / np.sqrt(70.0)) / 0.6745
    return max(white, step / np.sqrt(12.0), 1e-12 * (np.ptp(values) + 1e-12))


def ladder_step(values: Array) -> float:
    """Step of a ladder (a coarse encoder, few digits) on whose rungs all values (n,) stand; zero where they stand
    anywhere."""
    grain = 1e-7 * np.ptp(values) + 1e-300  # what differs by less is equal but for rounding
    apart = grain * np.diff(np.unique(np.round(values / grain)))
    if len(apart) < 2:
        return 0.0
    step = float(np.percentile(apart, 10))
    step = float(np.median(apart / np.maximum(np.round(apart / step), 1.0)))
    rungs = apart / step
    on = np.percentile(np.abs(rungs - np.round(rungs)), 90) < OFF_RUNG
    return step if on and step > 5 * grain else 0.0


def _median(size: Array, step: float) -> float:
    """Median of sizes (n,) that come in steps, each spread over its own: few different values hide where the middle is
    (median of grouped data)."""
    if step <= 0:
        return float(np.median(size))
    rung, count = np.unique(np.round(size / step), return_counts=True)
    return float(
        step
        * np.interp(0.5 * len(size), np.append(0, np.cumsum(count)), np.append(max(rung[0] - 0.5, 0.0), rung + 0.5))
    )


def _fourth(time_s: Array, values: Array) -> Array:
    """Fourth divided differences (n - 4,), each scaled so that white noise of one gives one: no cubic is seen by
    them."""
    at = np.lib.stride_tricks.sliding_window_view(time_s, 5)
    at = (at - at[:, :1]) / (at[:, -1:] - at[:, :1])
    weights = 1.0 / np.prod(at[:, :, None] - at[:, None, :] + np.eye(5), 2)
    weights /= np.linalg.norm(weights, axis=1)[:, None]
    return np.sum(weights * np.lib.stride_tricks.sliding_window_view(values, 5), 1)


def low_pass(values: Array, rate_hz: float, cutoff_hz: float, order: int = ORDER) -> Array:
    """Zero-phase Butterworth low-pass (both ways, together of that order) along the first axis; no change where the
    cut-off is too high.

    Ends are extended by their point reflection and the filter starts settled there: what scipy.signal.filtfilt
    does, without working out the start anew in each of many thousand calls.
    """
    from scipy.signal import lfilter

    if cutoff_hz >= PASSED * rate_hz or len(values) < LEAST_SAMPLES:
        return values
    pad = min(len(values) - 2, int(3 * rate_hz / cutoff_hz))
    b, a, settled = _butterworth(cutoff_hz / (0.5 * rate_hz), order)
    out = _reflected(values, pad)
    settled = settled.reshape(-1, *[1] * (out.ndim - 1))
    for _ in range(2):
        out = lfilter(b, a, out, axis=0, zi=settled * out[:1])[0][::-1]
    return out[pad : len(out) - pad]


@lru_cache(maxsize=256)
def _butterworth(cutoff: float, order: int) -> tuple[Array, Array, Array]:
    """Numerator and denominator of the filter, one way, and its state on a constant one; cutoff: share of half the
    sampling rate; order: both ways."""
    from scipy.signal import butter, lfilter_zi

    b, a = butter(order // 2, cutoff)
    return b, a, lfilter_zi(b, a)


def later(time_s: Array, values: Array, delay_s: float) -> Array:
    """Values (n, ...) on an even grid (n,) that come later by delay_s (earlier where negative), constant beyond the
    ends: cubic spline, since a line between samples of a thinned grid would smooth and so favour delays of whole
    samples.

    A spline on even knots is a filter (Unser 1999); ends are extended by their point reflection, as in `low_pass`.
    """
    from scipy.ndimage import spline_filter1d

    count = len(time_s)
    if count < 2:
        return values
    pad = min(count - 1, KNOTS)
    weights = spline_filter1d(_reflected(values, pad), axis=0)
    at = np.clip(np.arange(count) - delay_s * (count - 1) / (time_s[-1] - time_s[0]), 0, count - 1)
    before = np.minimum(at.astype(int), count - 2)
    u = (at - before).reshape(-1, *[1] * (values.ndim - 1))
    pieces = ((1 - u) ** 3, 4 - 3 * u**2 * (2 - u), 4 - 3 * (1 - u) ** 2 * (1 + u), u**3)
    return sum(piece * weights[before + pad - 1 + k] for k, piece in enumerate(pieces)) / 6.0


def _reflected(values: Array, pad: int) -> Array:
    """Values (n, ...) with so many more at either end, less than n, by point reflection there."""
    return np.concatenate([2 * values[:1] - values[pad:0:-1], values, 2 * values[-1:] - values[-2 : -pad - 2 : -1]])


def differentiate(values: Array, rate_hz: float, resolved: bool = True) -> Array:
    """Central differences, sixth order, second at the ends, (n, ...): at a tenth of the sampling rate second order
    would lose 6 % of a slope and 13 % of an acceleration, and these would pass for physics. resolved: False where
    values jump from sample to sample, about which sixth order would ring."""
    out = np.gradient(values, 1.0 / rate_hz, axis=0, edge_order=2)
    if resolved and len(values) > 6:
        apart = [values[3 + k : len(values) - 3 + k] - values[3 - k : len(values) - 3 - k] for k in (1, 2, 3)]
        out[3:-3] = (45 * apart[0] - 9 * apart[1] + apart[2]) * (rate_hz / 60.0)
    return out


def choose_cutoff(position: Array, rate_hz: float) -> float:
    """Highest cut-off [Hz] at which white position noise is at most NOISE_SHARE of the acceleration, (n,) even
    samples."""
    sigma = noise_std(position)
    best = 1.0
    for cutoff in np.geomspace(1.0, 0.25 * rate_hz, 25) if rate_hz > 4 else [0.25 * rate_hz]:
        acceleration = differentiate(differentiate(low_pass(position, rate_hz, cutoff), rate_hz), rate_hz)
        noise = sigma * np.sqrt(2.0 / rate_hz * (2 * np.pi) ** 4 * cutoff**5 / 5.0)
        if noise <= NOISE_SHARE * float(np.std(acceleration)):
            best = float(cutoff)
        elif cutoff > best * 1.5:
            break
    return min(best, 0.25 * rate_hz)


def velocity_noise(position: Array, rate_hz: float, cutoff_hz: float) -> float:
    """Standard deviation of the smoothed velocity's noise [position unit / s]."""
    return noise_std(position) * np.sqrt(2.0 / rate_hz * (2 * np.pi) ** 2 * cutoff_hz**3 / 3.0)


def recorded_states(time_s: Array, values: Array) -> tuple[Array, Array, Array]:
    """Even times (m,) [s] of a recording (n,) at time_s (gaps: nan), with position and velocity (m,) there. Its noise
    is that of what was recorded: on a line between two samples there is less, and rounding no longer shows."""
    filled, grid = fill_gaps(time_s, values), uniform_time(time_s)
    sigma = noise_std(filled, time_s) if np.ptp(filled) > 0 else None
    return grid, *local_states(np.interp(grid, time_s, filled), 1.0 / (grid[1] - grid[0]), sigma)


def local_states(values: Array, rate_hz: float, sigma: float | None = None) -> tuple[Array, Array]:
    """Position and velocity (n,) at every sample of an even recording (n,), ends included: local cubics (Savitzky &
    Golay 1964), each over the longest window on which shorter ones do not contradict it (intersection of confidence
    intervals, Katkovnik 1999). sigma: standard deviation of the noise, where it is known."""
    from scipy.signal import savgol_filter

    sigma, n = noise_std(values) if sigma is None else sigma, len(values)
    if n < WINDOWS[0]:
        return values, np.gradient(values, 1.0 / rate_hz)
    position, velocity = values.copy(), np.zeros(n)
    low, high, open_ = np.full(n, -np.inf), np.full(n, np.inf), np.ones(n, bool)
    for window in (w for w in WINDOWS if w <= n):
        q = savgol_filter(values, window, 3, mode="interp")
        v = savgol_filter(values, window, 3, deriv=1, delta=1.0 / rate_hz, mode="interp")
        half = window // 2
        edge = rate_hz * _slope_noise(window)
        spread = np.full(n, edge[half])
        spread[: half + 1], spread[n - half - 1 :] = edge, edge[::-1]
        low, high = np.maximum(low, v - SURE * sigma * spread), np.minimum(high, v + SURE * sigma * spread)
        open_ &= low <= high
        position[open_], velocity[open_] = q[open_], v[open_]
    return position, velocity


@lru_cache(maxsize=len(WINDOWS))
def _slope_noise(window: int) -> Array:
    """Standard deviation [per sample] of a local cubic's slope at its first, second, ... middle sample (half + 1,), for
    white noise of one."""
    at = np.linspace(-1.0, 1.0, window)
    weights = np.linalg.pinv(np.stack([at**k for k in range(4)], 1))
    slope = np.stack([k * at ** max(k - 1, 0) for k in range(4)], 1)[: window // 2 + 1]
    return np.linalg.norm(slope @ weights, axis=1) * 2.0 / (window - 1)
