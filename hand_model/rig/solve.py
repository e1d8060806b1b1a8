"""Bounded linear least squares from block sums, so that leaving a block out costs one small solve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROUNDING = 1e-13  # added to normal equations with a diagonal of ones
LEAST_NEW = 1e-9  # of a column, that others do not say: below, rounding counts


def solve_bounded(gram: Array, moment: Array, low: Array, high: Array, prior: Array, weight: Array) -> Array:
    """argmin of theta' G theta - 2 m' theta + sum weight (theta - prior)^2 in a box, by an active set on the bounds.

    gram (P, P), moment (P,), all others (P,). Parameters that the data says nothing about stay at their prior.
    """
    return _active_set(gram, moment, low, high, prior, weight).theta


class Nested:
    """The least squares of `solve_bounded`, many times over, with a few columns more each time: where these change no
    bound that holds, what stands is factorised once (Schur complement; else all is solved anew)."""

    def __init__(self, gram: Array, moment: Array, low: Array, high: Array, prior: Array, weight: Array) -> None:
        self._standing = gram, moment, low, high, prior, weight
        self._set = _active_set(*self._standing)
        free = self._set.free
        self._factor = _factor(self._set.h[np.ix_(free, free)])

    def solve(self, cross: Array, own: Array, moment: Array, low: Array, high: Array, weight: Array) -> Array:
        """Parameters (P + J,) with J more columns, whose prior is zero: cross (P, J), own (J, J), others (J,)."""
        quick = self._quick(cross, own + np.diag(weight), moment, low, high)
        if quick is not None:
            return quick
        gram, standing, *rest = self._standing
        none = np.zeros(len(moment))
        return solve_bounded(
            np.block([[gram, cross], [cross.T, own]]),
            *(np.concatenate(pair) for pair in zip((standing, *rest), (moment, low, high, none, weight), strict=True)),
        )

    def _quick(self, cross: Array, own: Array, moment: Array, low: Array, high: Array) -> Array | None:
        """`solve` where the bounds that hold stay the same, else None. own: with its weight."""
        at, free = self._set, self._set.free
        unit = 1.0 / np.sqrt(np.maximum(np.diag(own), 1e-300))
        cross, own, low, high = cross * at.unit[:, None] * unit, own * unit[:, None] * unit, low / unit, high / unit
        if self._factor is None:
            return None
        moved = self._factor(cross[free])
        schur = own - cross[free].T @ moved
        if np.linalg.eigvalsh(schur)[0] < LEAST_NEW:
            return None
        more = np.linalg.solve(schur, moment * unit - cross.T @ at.scaled)
        if len(more) == 1:  # a parabola in a box
            more = np.clip(more, low, high)
        elif np.any((more < low) | (more > high)):
            return None
        scaled = at.scaled.copy()
        scaled[free] -= moved @ more
        if np.any((scaled < at.low) | (scaled > at.high)):
            return None
        slope = at.h[~free] @ scaled + cross[~free] @ more - at.g[~free]
        if np.any(_released(scaled[~free], at.low[~free], at.high[~free], slope)):
            return None
        return np.concatenate([scaled * at.unit, more * unit])


@dataclass(frozen=True)
class _ActiveSet:
    """A solution and what of it is at no bound, all but theta (P,) in units (P,) of the parameters: normal equations h
    (P, P), g (P,), bounds."""

    theta: Array
    scaled: Array
    free: NDArray[np.bool_]
    unit: Array
    h: Array
    g: Array
    low: Array
    high: Array


def _active_set(gram: Array, moment: Array, low: Array, high: Array, prior: Array, weight: Array) -> _ActiveSet:
    h = gram + np.diag(weight)
    g = moment + weight * prior
    unit = 1.0 / np.sqrt(np.maximum(np.diag(h), 1e-300))
    h, g = h * unit[:, None] * unit, g * unit
    low, high = low / unit, high / unit
    theta = np.clip(np.zeros(len(g)), low, high)
    fixed = np.zeros(len(g), bool)
    for _ in range(3 * len(g) + 5):
        free = ~fixed
        trial = theta.copy()
        if free.any():
            rows = h[free]
            trial[free] = np.linalg.solve(
                rows[:, free] + ROUNDING * np.eye(len(rows)), g[free] - rows[:, fixed] @ theta[fixed]
            )
        beyond = free & ((trial < low) | (trial > high))
        if beyond.any():
            theta = np.clip(trial, low, high)
            fixed |= beyond
            continue
        theta = trial
        slope = h @ theta - g
        release = fixed & _released(theta, low, high, slope)
        if not release.any():
            break
        worst = np.argmax(np.abs(slope) * release)
        fixed[worst] = False
    scaled = np.clip(theta, low, high)
    return _ActiveSet(scaled * unit, scaled, ~fixed, unit, h, g, low, high)


def _released(theta: Array, low: Array, high: Array, slope: Array) -> NDArray[np.bool_]:
    """Which parameters at a bound are freed: where the cost falls into the box."""
    return ((theta <= low) & (slope < -1e-10)) | ((theta >= high) & (slope > 1e-10))


def _factor(h: Array) -> Callable[[Array], Array] | None:
    """Solver of h x = y for y (P, J) with h (P, P) positive definite; None where it is not."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    try:
        factor = cho_factor(h + ROUNDING * np.eye(len(h)), check_finite=False)
    except LinAlgError:
        return None
    return lambda y: cho_solve(factor, y, check_finite=False)


def sums_of(x: Array, y: Array, used: NDArray[np.int64], width: int) -> tuple[Array, Array, float, int]:
    """Normal equations of columns x (m, k), which stand at the places `used` (k,) among `width` others that are zero,
    and y (m,): gram (width, width), moment (width,), square, count."""
    gram, moment = np.zeros((width, width)), np.zeros(width)
    gram[np.ix_(used, used)], moment[used] = x.T @ x, x.T @ y
    return gram, moment, float(y @ y), len(y)


def squared_error(gram: Array, moment: Array, square: float, theta: Array) -> float:
    """Sum of squares that theta (P,) leaves, from normal equations: below zero by rounding at most."""
    return float(square - 2 * moment @ theta + theta @ gram @ theta)
