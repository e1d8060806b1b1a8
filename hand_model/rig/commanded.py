"""How closely a channel is a command: sinusoids of time, a static function of the position, another channel over again,
the law of a controller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .model import RigTrial
from .states import fill_gaps, uniform_time

Array = NDArray[np.float64]
SAME = 0.01  # a measured channel differs from its command by more than this share: drives, sensors and CAN buses do
BOTH_WAYS = 0.1  # of the way that a joint goes to one side: as much to the other shows its friction twice
LEAST_PERIODS = 2.0
UNBEGUN = 0.02  # of a recording, at its begin, in which its controller need not run yet
LATEST = 2  # samples by which a copy may come late


def rms(values: Array) -> float:
    """Root mean square of values (n,), zero of none."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def linear(trial: RigTrial, joint: str, values: Array) -> bool:
    """Whether a joint moves in sinusoids and a channel is of the same frequencies: a linear machine takes such a torque,
    which says nothing."""
    frequencies, left = _sinusoids(trial.time_s, fill_gaps(trial.time_s, trial.position[joint]), 2)
    return left < SAME and _left_of(trial.time_s, values, frequencies) < SAME


def sinusoids_left(time_s: Array, values: Array, most: int = 2) -> float:
    """Share (residual rms over rms) that up to `most` sinusoids and a mean leave; frequencies refined from the
    spectrum. One where the first does not come twice: any smooth curve is a piece of some sinusoid."""
    return _sinusoids(time_s, values, most)[1]


def _sinusoids(time_s: Array, values: Array, most: int) -> tuple[tuple[float, ...], float]:
    """Frequencies [Hz] of sinusoids, and the share that `sinusoids_left` says."""
    from scipy.optimize import minimize_scalar

    grid, y = _begun(time_s, values)
    if np.ptp(y) == 0 or len(y) < 49:
        return (), 1.0
    found: tuple[float, ...] = ()
    left, step = y - y.mean(), 1.0 / (grid[-1] - grid[0])
    for _ in range(most):
        spectrum = np.abs(np.fft.rfft(left * np.hanning(len(left))))
        k = int(np.argmax(spectrum[1:])) + 1

        def cost(f: float, base: tuple[float, ...] = found) -> float:
            return rms(_solve(_waves(grid, (*base, f)), y))

        f = minimize_scalar(
            cost, bounds=((k - 1) * step, (k + 1) * step), method="bounded", options={"xatol": 1e-6 * step}
        ).x
        if f < LEAST_PERIODS * step and not found:
            return (), 1.0
        found = (*found, float(f))
        left = _solve(_waves(grid, found), y)
    return found, _share(left, y)


def _begun(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Even times (n,) [s] and values, without the first instants, before the generator runs."""
    grid = uniform_time(time_s)
    trim = slice(int(UNBEGUN * len(grid)), None)
    return grid[trim], np.interp(grid, time_s, values)[trim]


def _waves(grid: Array, frequencies: Sequence[float]) -> list[Array]:
    """A mean, and sine and cosine of each frequency [Hz], (n,) each."""
    return [np.ones_like(grid), *(f(2 * np.pi * hz * grid) for hz in frequencies for f in (np.sin, np.cos))]


def _left_of(time_s: Array, values: Array, frequencies: Sequence[float]) -> float:
    """Share (as `_share`) that sinusoids of these frequencies [Hz] leave."""
    grid, y = _begun(time_s, values)
    return _share(_solve(_waves(grid, frequencies), y), y)


def _share(left: Array, y: Array) -> float:
    """What is left of a signal over what it varies by, by the median of the one and the rms of the other."""
    return float(np.median(np.abs(left)) / 0.6745 / rms(y - y.mean()))


def _solve(columns: list[Array], y: Array) -> Array:
    x = np.stack(columns, 1)
    return y - x @ np.linalg.lstsq(x, y, rcond=None)[0]


def static_left(trial: RigTrial, joint: str, values: Array) -> float:
    """Share (as `_share`) that sine, cosine and cubic of the position leave, where the joint goes both ways: a function
    of it is one at most samples, and need not be in the first instants, before its controller runs.

    Friction alone keeps a true torque from being a function of the position: it changes sign with the motion.
    """
    q = fill_gaps(trial.time_s, trial.position[joint])
    q, values = (v[int(UNBEGUN * len(q)) :] for v in (q, values))
    if not _reverses(trial, joint) or np.ptp(q) == 0:
        return 1.0
    x = np.stack([np.ones_like(q), q, q**2, q**3, np.sin(q), np.cos(q)], 1)
    scale = np.abs(x).max(0) + 1e-300
    left = values - (x / scale) @ np.linalg.lstsq(x / scale, values, rcond=1e-10)[0]
    return _share(left, values)


def copied(values: Array, other: Array) -> tuple[float, int]:
    """Share that a gain and an offset of another channel leave where it is read as many samples earlier as suits best,
    and how many: a log may write down what was asked for a step ago."""
    return min((copy_left(values[k:], other[: len(other) - k]), k) for k in range(LATEST + 1))


def copy_left(values: Array, other: Array) -> float:
    """Share that a gain and an offset of another channel leave."""
    if np.ptp(other) == 0:
        return 1.0
    left = _solve([np.ones_like(other), other], values)
    return rms(left) / max(float(np.std(values)), 1e-300)


def _reverses(trial: RigTrial, joint: str) -> bool:
    step = np.diff(fill_gaps(trial.time_s, trial.position[joint]))
    up, down = step[step > 0].sum(), -step[step < 0].sum()
    return min(up, down) > BOTH_WAYS * max(up, down)


def controller_left(trial: RigTrial, joint: str) -> float:
    """Share (as `_share`) of a joint's effort that the law of a controller leaves: target, position, speed, the rate of
    the target and the sum of what position lacks, each with a gain; one without a target. Limits need not be met, for
    the share is of most samples."""
    if joint not in trial.setpoint:
        return 1.0
    time_s = trial.time_s
    effort, target, q = (fill_gaps(time_s, x[joint]) for x in (trial.effort, trial.setpoint, trial.position))
    lacks = target - q
    summed = np.r_[0.0, np.cumsum(0.5 * (lacks[1:] + lacks[:-1]) * np.diff(time_s))]
    speed = fill_gaps(time_s, trial.velocity[joint]) if joint in trial.velocity else np.gradient(q, time_s)
    columns = [np.ones_like(q), target, q, speed, summed, np.gradient(target, time_s)]
    return _share(_solve(columns, effort), effort)
