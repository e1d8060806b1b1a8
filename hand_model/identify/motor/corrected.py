"""The regression done right: both sides filtered alike, preload, friction along the path, smooth weights, honest covariance.

current = inertia a + viscous v + coulomb z + stiffness p + preload (+ (static - coulomb) z exp(-|v| / stribeck)), where z in -1..1 is
the friction state of Dahl (1968) along the recorded path. Where it is not saturated (rest, reversal) friction is known only within
its bounds, and there the samples weigh nothing. Needs no setpoint and no controller; the start and the fallback of `output_error`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .published import CUTOFF_HZ, derivatives, zero_phase
from .recording import MotorTrial

Array = NDArray[np.float64]

NAMES = ("inertia", "viscous", "coulomb", "stiffness", "preload")
PRESLIDING = 1.2  # [%], a travel after which the friction has turned round in any drive of interest
STRIBECK = (6.0, 10.0, 15.0, 22.0, 32.0, 45.0)  # [%/s], profiled
BLOCK_S = 0.5  # longer than the filter rings and the friction transients last


@dataclass(frozen=True)
class Regression:
    """values (5,) of NAMES; covariance (5, 5), a sandwich over blocks; rmse_raw of the filtered current;
    static_excess [raw] and stribeck_speed [%/s]; excess_z: the excess over its standard error."""

    values: Array
    covariance: Array
    rmse_raw: float
    static_excess: float = 0.0
    stribeck_speed: float = 20.0
    excess_z: float = 0.0


def friction_state(position: Array, presliding: float) -> Array:
    """Dahl's friction state z (n,) in -1..1 along positions (n,) [%]: z' = (1 - z sign(v)) v / presliding, from z = 0."""
    move = np.diff(position)
    keep = np.exp(-np.abs(move) / presliding)
    sign = np.sign(move)
    z = np.zeros(len(position))
    state = 0.0
    for i, (a, s) in enumerate(zip(keep.tolist(), sign.tolist(), strict=True)):
        state = s + (state - s) * a
        z[i + 1] = state
    return z


@dataclass(frozen=True)
class _Prepared:
    time: Array
    rate: float
    rows: Array  # (n, 5) regressors in the order of NAMES, filtered
    friction: Array  # the friction state, not filtered
    speed: Array
    current: Array
    weight: Array


def _prepare(t: MotorTrial, sigma: float) -> _Prepared:
    rate = 1 / float(np.median(np.diff(t.time_s)))
    time = np.arange(t.time_s[0], t.time_s[-1], 1 / rate)
    position, current = np.interp(time, t.time_s, t.position), np.interp(time, t.time_s, t.current)
    p = zero_phase(position, rate)
    v, a = derivatives(p, rate)
    light = zero_phase(position, rate, 2 * CUTOFF_HZ)
    z = friction_state(light, PRESLIDING)
    slow = 8 * sigma * np.sqrt(rate)  # [%/s]: where the smoothed velocity is no longer told from zero
    sliding = (np.abs(z) > 0.97) & (np.abs(np.gradient(light, time)) > slow)
    known = zero_phase(sliding.astype(float), rate)  # all that the filter mixes in is sliding
    weight = np.clip((known - 0.9) / 0.1, 0.0, 1.0) * (1 - np.exp(-((v / slow) ** 2)))
    rows = np.column_stack([a, v, zero_phase(z, rate), p, np.ones(len(z))])
    return _Prepared(time, rate, rows, z, np.abs(np.gradient(light, time)), zero_phase(current, rate), weight)


def fit_regression(trials: Sequence[MotorTrial], sigma_position: float, stribeck: bool = False) -> Regression:
    """Weighted least squares; with `stribeck` the Stribeck speed is profiled over a grid.

    sigma_position: encoder noise [%]; its share in the acceleration's variance is taken off (errors in variables).
    """
    parts = [_prepare(t, sigma_position) for t in trials]
    weight = np.concatenate([q.weight for q in parts])
    current = np.concatenate([q.current for q in parts])
    noise = sum(q.weight.sum() * _noise_gram(q.rate, sigma_position) for q in parts)
    best = None
    for speed in STRIBECK if stribeck else (None,):
        x = np.concatenate([q.rows for q in parts])
        if speed is not None:
            x = np.c_[x, np.concatenate([zero_phase(q.friction * np.exp(-q.speed / speed), q.rate) for q in parts])]
        beta = np.linalg.lstsq(x * np.sqrt(weight)[:, None], current * np.sqrt(weight), rcond=None)[0]
        cost = float(np.sum(weight * (current - x @ beta) ** 2))
        if best is None or cost < best[0]:
            best = (cost, x, speed)
    cost, x, speed = best
    gram = x.T @ (weight[:, None] * x)
    index = [0, 1, 3]
    gram[np.ix_(index, index)] -= noise
    beta = np.linalg.solve(gram, x.T @ (weight * current))
    block = np.concatenate([np.floor(q.time / BLOCK_S).astype(int) + 100000 * i for i, q in enumerate(parts)])
    covariance = _sandwich(x, weight, current - x @ beta, block, np.linalg.inv(gram))
    rmse = float(np.sqrt(np.average((current - x @ beta) ** 2, weights=weight)))
    if speed is None:
        return Regression(beta, covariance, rmse)
    z = float(beta[5] / np.sqrt(covariance[5, 5]))
    return Regression(beta[:5], covariance[:5, :5], rmse, float(beta[5]), speed, z)


def balance(t: MotorTrial, values: Array, cutoff_hz: float = 2 * CUTOFF_HZ, flexing: bool = False) -> Array:
    """Current (n,) [raw] that the recorded motion of a trial takes, by `values` (5,) of NAMES; motion filtered at cutoff_hz [Hz].

    flexing: friction as in flexion throughout, which is all that it can be while the drive flexes or is held up in flexion.
    """
    rate = 1 / float(np.median(np.diff(t.time_s)))
    time = np.arange(t.time_s[0], t.time_s[-1], 1 / rate)
    p = zero_phase(np.interp(time, t.time_s, t.position), rate, cutoff_hz)
    v, a = derivatives(p, rate)
    z = np.ones(len(p)) if flexing else friction_state(p, PRESLIDING)
    return np.interp(t.time_s, time, np.column_stack([a, v, z, p, np.ones(len(p))]) @ values)


def _noise_gram(rate: float, sigma: float) -> Array:
    """Expected noise per sample in the products of (acceleration, velocity, position): the filter's response to white noise."""
    n = int(4 * rate)
    pulse = np.zeros(2 * n + 1)
    pulse[n] = 1.0
    p = zero_phase(pulse, rate)
    v, a = derivatives(p, rate)
    response = np.c_[a, v, p]
    return sigma**2 * response.T @ response


def _sandwich(x: Array, weight: Array, residual: Array, block: Array, inverse: Array) -> Array:
    """Covariance of weighted least squares that holds for residuals correlated within blocks (Liang & Zeger 1986)."""
    score = x * (weight * residual)[:, None]
    _, label = np.unique(block, return_inverse=True)
    total = np.zeros((label.max() + 1, x.shape[1]))
    np.add.at(total, label, score)
    n = len(total)
    return inverse @ (total.T @ total) @ inverse * n / max(1, n - x.shape[1])
