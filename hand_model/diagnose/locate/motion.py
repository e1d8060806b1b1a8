"""State of a drive from its log: position, velocity and acceleration by local quadratics, phases of motion and rest.

Position is noisy and quantised, samples are irregular. One kernel gives position, velocity and acceleration; where the
motion starts or stops within the kernel the estimate is smeared, and such samples carry an uncertainty that says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...effects.path import runs
from ...session import between_rows, resolution, row_before, rows_lost

Array = NDArray[np.float64]

SURE = 3.0  # standard deviations
WIDER = (1.0, 1.6, 2.5, 4.0, 6.0)  # times a kernel, of which the acceleration's is one
QUIETER = (1.6, 2.5, 4.0, 6.0, 9.0)  # times a kernel, where a position does not bend
NARROW = 0.6  # standard deviations of such intervals: wider ones let a corner be smoothed
OWN = 0.6  # weight of a sample in its own value, times bandwidth over step: 3 / 2 phi(0)
WIDENED = 4  # times a kernel may be widened
# of the acceleration of fast motion, at most, is noise: as an error of a regressor it takes its square off the inertia
ROUGH = 0.2
QUICK = 0.5  # of the fastest speed, from which what times are wrong by shows in the position
FEWEST_BLOCKS = 12  # that a smoothing is made of
DEPARTURES_S = (0.1, 0.25, 0.6, 1.5)  # bandwidths of what departs from a known course
LASTING_S = 0.3  # over which errors may be alike; what lasts longer is what departs
GAP = 3.0  # sample intervals, from which readings are no neighbours
FAR, SPREAD, FAR_ERROR = 3.0, 0.9733, 1.05  # deviations, the variance of what is nearer, and its error over that of all
WHITE: Array = np.zeros(0)  # covariance of errors of which none lasts
FEW = 100  # pairs of readings, below which nothing is said of how long errors last
# times the error between two rows is that of a row left out, where the acceleration jumps: it grows with the interval
# squared
LEFT_OUT = 4.0
FEWEST_CALM = 12  # readings at rest that tell their noise


@dataclass(frozen=True)
class Motion:
    """position, velocity, acceleration: (n,). noise: standard deviation of the raw position; bandwidth_s: of the kernel
    [s]. moving: (n,) bool;
    since_start_s, until_stop_s: (n,) [s] to the nearest rest before and after (inf where none). smoothed: whether by
    the kernel; else simulated. acceleration_noise: standard deviation of what the noise of the position makes of it."""

    position: Array
    velocity: Array
    acceleration: Array
    noise: float
    bandwidth_s: float
    moving: NDArray[np.bool_]
    since_start_s: Array
    until_stop_s: Array
    smoothed: bool = True
    acceleration_noise: float = 0.0


def local_quadratic(time_s: Array, values: Array, bandwidth_s: float) -> Array:
    """Value, first and second derivative (3, n) by Gaussian-weighted local quadratics (Fan & Gijbels 1996).

    time_s: (n,) [s], increasing, irregular; values: (n,); bandwidth_s: standard deviation of the kernel [s].
    """
    n = len(time_s)
    reach = int(3.5 * bandwidth_s / max(float(np.median(np.diff(time_s))), 1e-9)) + 2
    index = np.arange(n)[:, None] + np.arange(-reach, reach + 1)[None]
    inside = (index >= 0) & (index < n)
    index = index.clip(0, n - 1)
    d = (time_s[index] - time_s[:, None]) / bandwidth_s
    w = np.exp(-0.5 * d**2) * inside
    moment = [(w * d**k).sum(1) for k in range(5)]
    right = [(w * d**k * (values[index] - values[:, None])).sum(1) for k in range(3)]
    normal = np.stack([np.stack([moment[i + j] for j in range(3)], -1) for i in range(3)], -2)
    normal = normal + 1e-9 * np.eye(3)
    c = np.linalg.solve(normal, np.stack(right, -1)[..., None])[..., 0]
    return np.stack([values + c[:, 0], c[:, 1] / bandwidth_s, 2 * c[:, 2] / bandwidth_s**2])


def estimate_motion(time_s: Array, position: Array, bandwidth_s: float | None = None, uneven: bool = False) -> Motion:
    """Motion (n,) of one channel; the bandwidth defaults to 1.5 sample intervals, widened while velocity noise exceeds
    2 % of the fastest speed. uneven: times are known less well than they are told, so that a fast position is known
    less well than one at rest, and its acceleration must be known, too."""
    step = float(np.median(np.diff(time_s)))
    apart = _apart(position)
    noise = wrong = float(np.median(apart))
    h = 1.5 * step if bandwidth_s is None else bandwidth_s
    for _ in range(WIDENED):
        x, v, a = local_quadratic(time_s, position, h)
        fastest = float(np.percentile(np.abs(v), 98))
        velocity_noise = noise / h * np.sqrt(step / (4 * np.sqrt(np.pi) * h))
        quick = np.abs(v) > QUICK * fastest
        rough = False
        if uneven and quick[3:].any():
            wrong = max(wrong, float(np.median(apart[quick[3:]])))
            rough = _acceleration_noise(wrong, step, h) > ROUGH * float(np.sqrt(np.mean(a[quick] ** 2)))
        if bandwidth_s is not None or (velocity_noise < 0.02 * fastest and not rough):
            break
        h *= 1.4
    moving = np.abs(v) > max(5 * velocity_noise, 0.03 * fastest)
    moving = _drop_short(moving & ~_beside_lost_rows(time_s), 3)
    a, rough_a = _sure_enough(time_s, position, h, noise, a, moving)
    return Motion(x, v, a, noise, h, moving, *since_rest(time_s, moving), acceleration_noise=rough_a)


def standing_at_turns(motion: Motion, time_s: Array) -> Motion:
    """The same where samples (n,) [s] between which a drive turns round are at rest: it stands in between, however
    short, and when is not known."""
    turns = motion.velocity[1:] * motion.velocity[:-1] < 0
    moving = _drop_short(motion.moving & ~_on_either_side(turns), 3)
    since, until = since_rest(time_s, moving)
    return replace(motion, moving=moving, since_start_s=since, until_stop_s=until)


def _apart(position: Array) -> Array:
    """Sizes (n - 3,) of third differences, whose median is the standard deviation of white noise on a slow motion."""
    return np.abs(np.diff(position, 3)) / 0.6745 / np.sqrt(20.0)


def _beside_lost_rows(time_s: Array) -> NDArray[np.bool_]:
    """Samples (n,) beside which rows were lost: the drive may have stopped between them."""
    return _on_either_side(rows_lost(time_s))


def _on_either_side(between: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples (n,) before or after which something is between two of them (n - 1,)."""
    return np.r_[between, False] | np.r_[False, between]


def _sure_enough(
    time_s: Array, position: Array, bandwidth_s: float, noise: float, acceleration: Array, moving: NDArray[np.bool_]
) -> tuple[Array, float]:
    """Acceleration (n,), and the noise that the position's makes of it, by a kernel widened until that is a fifth of
    the whole in motion; no wider than where the leave-one-out error of the position is least (Stone 1974), for there
    what bends is smeared."""
    step = float(np.median(np.diff(time_s)))
    found, rough = acceleration, _acceleration_noise(noise, step, bandwidth_s)
    least = np.inf
    for wider in WIDER:
        if not moving.any() or rough < ROUGH * float(np.sqrt(np.mean(found[moving] ** 2))):
            break
        h = wider * bandwidth_s
        x, _, a = local_quadratic(time_s, position, h)
        error = float(np.mean(((position - x)[moving] / (1 - OWN * step / h)) ** 2))
        if not error < least:
            break
        least, found, rough = error, a, _acceleration_noise(noise, step, h)
    return found, rough


def least_error(time_s: Array, values: Array, alike: Array = WHITE) -> tuple[Array, Array]:
    """Values smoothed over time and their rate (n,), at the bandwidth with the least leave-one-out error (Stone 1974);
    zero where that errs least. alike: covariance (k,) of errors one to k samples apart (`lasting_errors`): those that
    last are followed by a narrow kernel, which the error of what is left out does not show (Hart 1991)."""
    tried = [(values**2, np.zeros(len(values)), np.zeros(len(values))), *smoothings(time_s, values, alike)]
    _, smooth, rate = min(tried, key=lambda x: float(np.mean(x[0])))
    return smooth, rate


def lasting_errors(time_s: Array, values: Array, calm: NDArray[np.bool_]) -> tuple[float, Array]:
    """Variance of the errors of values (n,), and covariance (k,) of those one to k samples apart, by the variogram
    (Matheron 1963) over calm spells; none where they do not plainly last, and no variance where nothing tells it.
    Whether they last is asked of the mean over the first one, two, four, ... samples: what fades slowly is small at
    each."""
    rises, count = [], 0
    spell = np.cumsum(~calm)  # alike within one
    step = max(float(np.median(np.diff(time_s))), 1e-9)
    longest = int(np.clip(LASTING_S / step, 1, max(len(values) // 4, 1)))
    spell += np.cumsum(np.diff(time_s, prepend=time_s[0]) > GAP * step)
    for k in range(1, longest + 1):
        pair = calm[k:] & (spell[k:] == spell[:-k])
        count = int(pair.sum())
        if count < FEW:
            return 0.0, WHITE
        apart = np.abs(values[k:] - values[:-k])[pair]
        near = apart[apart <= FAR * float(np.median(apart)) / 0.6745]  # for a finger may jump off its drive
        rises.append(0.5 * float(np.mean(near**2)) / SPREAD)
    last = max(longest // 4, 1)
    whole = float(np.mean(rises[-last:]))
    covariance = whole - np.array(rises)
    first = 2 ** np.arange(last.bit_length())  # counts of samples up to as many as tell the whole
    lasting = np.array([float(np.mean(covariance[:m])) for m in first])
    if not np.any(lasting > SURE * FAR_ERROR * whole * np.sqrt(2.0 / count * (1.0 / first + 1.0 / last))):
        return whole, WHITE
    faded = np.flatnonzero(covariance <= 0)
    return whole, covariance[: faded[0]] if len(faded) else covariance


def smoothings(time_s: Array, values: Array, alike: Array = WHITE) -> Iterator[tuple[Array, Array, Array]]:
    """Square of the leave-one-out error, values smoothed and their rate, (n,) each, at every bandwidth. alike:
    covariance (k,) of errors one to k samples apart, none where they are white."""
    step = max(float(np.median(np.diff(time_s))), 1e-9)
    lag = np.arange(1, 1 + len(alike))
    for bandwidth in DEPARTURES_S:
        # samples averaged first: six to a bandwidth lose nothing; stamps in packets have next to no step
        count = max(1, min(int(bandwidth / step / 6), len(values) // FEWEST_BLOCKS))
        block = np.arange(len(values)) // count
        size = np.bincount(block)
        t, y = np.bincount(block, time_s) / size, np.bincount(block, values) / size
        impulse = np.zeros(len(y))
        impulse[len(y) // 2] = 1 / count
        kernel = local_quadratic(t, impulse, bandwidth)[0][len(y) // 2 :]
        own = float(kernel[0])
        at = (lag / count).round().astype(int)
        within = at < len(kernel)
        followed = 2 * float(kernel[at[within]] @ alike[within])
        smooth, rate = (np.interp(time_s, t, x) for x in local_quadratic(t, y, bandwidth)[:2])
        yield ((values - smooth) / (1 - own)) ** 2 + 2 * followed / (1 - own), smooth, rate


def position_at(motion: Motion, time_s: Array, then: Array) -> Array:
    """Position (m,) at times (m,) of a motion estimated at (n,) [s]: what the kernel takes off a curve's corners is put
    back, as much as it takes off once more ("twicing"; Stuetzle & Mittal 1979), where nothing bends noise is smoothed
    away, and between samples the position goes with its velocity (Hermite)."""
    from scipy.interpolate import CubicHermiteSpline

    again = local_quadratic(time_s, motion.position, motion.bandwidth_s)
    exact = 2 * motion.position - again[0]
    spline = CubicHermiteSpline(time_s, _quieter(motion, time_s, exact), 2 * motion.velocity - again[1])
    return spline(np.clip(then, time_s[0], time_s[-1]))


def _quieter(motion: Motion, time_s: Array, exact: Array) -> Array:
    """A position (n,) with the widest kernel at each sample whose value lies within the noise of all narrower ones
    (intersection of confidence intervals; Goldenshluger & Nemirovski 1997)."""
    step = float(np.median(np.diff(time_s)))
    out, doubt = exact.copy(), NARROW * _position_noise(motion.noise, step, motion.bandwidth_s)
    low, high = exact - doubt, exact + doubt
    for wider in QUIETER:
        smooth = local_quadratic(time_s, exact, wider * motion.bandwidth_s)[0]
        doubt = NARROW * _position_noise(motion.noise, step, wider * motion.bandwidth_s)
        low, high = np.maximum(low, smooth - doubt), np.minimum(high, smooth + doubt)
        out = np.where(low <= high, smooth, out)
    return out


def told_between(motion: Motion, time_s: Array, position: Array, then: Array) -> NDArray[np.bool_]:
    """Whether rows (n,) at times [s] tell where a drive is at the times (m,) [s]: within the log, where no rows are
    lost, and where a row that is left out is met by the cubic through the two on each side of it so well that between
    rows the error is within the noise of one reading. A few rows to a stroke do not tell how it begins and ends."""
    inside = between_rows(time_s, then)
    if len(time_s) < 5:
        return inside
    calm = ~motion.moving[3:] & ~motion.moving[:-3]
    noise = float(np.median(_apart(position)[calm])) if calm.sum() >= FEWEST_CALM else motion.noise
    noise = max(noise, resolution(position) / np.sqrt(12.0))
    missed, doubt = _left_out(time_s, position)
    bent = np.zeros(len(time_s), bool)
    bent[2:-2] = np.abs(missed) > noise * np.maximum(LEFT_OUT, SURE * doubt)
    row = row_before(time_s, then)
    return inside & ~(bent[row] | bent[row + 1])


def _left_out(time_s: Array, position: Array) -> tuple[Array, Array]:
    """By how much the cubic (Lagrange) through the two rows on each side misses a row, (n - 4,), and the standard deviation
    of that for noise of one."""
    rows = len(time_s) - 4
    sides = (0, 1, 3, 4)
    missed, variance = -position[2:-2], np.ones(rows)
    for side in sides:
        others = [time_s[k : k + rows] for k in sides if k != side]
        share = np.prod([(time_s[2:-2] - t) / (time_s[side : side + rows] - t) for t in others], axis=0)
        missed = missed + share * position[side : side + rows]
        variance += share**2
    return missed, np.sqrt(variance)


def sure_acceleration(motion: Motion) -> Array:
    """Acceleration (n,) without what may be noise of the position: that would be found again, with the other sign, in
    whatever the position is held against, and as an error of a regressor would take off its coefficient (Fuller 1987).
    What exceeds the noise stays as it is."""
    return np.where(np.abs(motion.acceleration) > SURE * motion.acceleration_noise, motion.acceleration, 0.0)


def _position_noise(noise: float, step_s: float, bandwidth_s: float) -> float:
    """Standard deviation of the value that a kernel makes of so noisy a position: its square is that of the noise times
    step / h int ((3 - u^2) / 2 phi)^2 du = 27 / (32 sqrt(pi)) step / h."""
    return noise * float(np.sqrt(27 / 32 / np.sqrt(np.pi) * step_s / bandwidth_s))


def _acceleration_noise(noise: float, step_s: float, bandwidth_s: float) -> float:
    """Standard deviation of the second derivative that a kernel makes of so noisy a position: its square is that of
    the noise times step / h^5 int ((u^2 - 1) phi)^2 du = 0.2116 step / h^5."""
    return noise * float(np.sqrt(0.2116 * step_s / bandwidth_s**5))


def _drop_short(flag: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """Runs of True shorter than `shortest` samples become False."""
    out = flag.copy()
    for a, b in runs(flag):
        if b - a < shortest:
            out[a:b] = False
    return out


def since_rest(time_s: Array, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Time [s] (n,) since the last sample at rest and until the next one, inf where there is none."""
    return _since(time_s, moving), _since(-time_s[::-1], moving[::-1])[::-1]


def _since(time_s: Array, moving: NDArray[np.bool_]) -> Array:
    """Time since the last sample at rest, inf before the first."""
    last = np.maximum.accumulate(np.where(~moving, np.arange(len(moving)), -1))
    return np.where(last >= 0, time_s - time_s[last.clip(0)], np.inf)
