"""Polynomials whose order is chosen on held-out cycles, and monotonic ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.special import comb

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PolynomialFit:
    """coefficients: ascending. order: the one chosen. rmse, rmse_held_out: order -> RMSE in the unit of y, fitted to
    all cycles and tested on them (as the thesis does), or fitted without and tested on each cycle in turn."""

    coefficients: Array
    order: int
    rmse: dict[int, float]
    rmse_held_out: dict[int, float]


def cycles(drive: Array, least: int = 3, blocks: int = 5) -> NDArray[np.int64]:
    """Cycle number (n,) of each sample: a cycle starts when `drive` rises through a tenth of its range after having
    been above half of it. Fewer than `least` cycles: `blocks` equal parts instead."""
    low, high = np.nanquantile(drive, [0.02, 0.98])
    u = (drive - low) / max(high - low, 1e-300)
    starts, armed = [], False
    for i in np.flatnonzero((u < 0.1) | (u > 0.5)):
        if u[i] > 0.5:
            armed = True
        elif armed:
            starts.append(i)
            armed = False
    number = np.zeros(len(drive), int)
    number[starts] = 1
    number = np.cumsum(number)
    if number.max() + 1 < least:
        number = np.minimum(np.arange(len(drive)) * blocks // max(len(drive), 1), blocks - 1)
    return number


def fit_polynomial(
    x: Array, y: Array, group: NDArray[np.int64], orders: Iterable[int], monotonic: bool = False
) -> PolynomialFit:
    """Least squares polynomial y(x), robust against stray samples; order chosen on held-out groups.

    x, y: (n,). group: (n,) cycle numbers. The lowest order is taken whose held-out error is not worse than the best
    one's by more than two standard errors of their difference over groups. monotonic: y must not turn back over the
    range of x.
    """
    orders = tuple(orders)
    kept = _kept(x, y, max(orders))
    x, y, group = x[kept], y[kept], group[kept]
    labels = np.unique(group)
    rmse, held_out, loss = {}, {}, {}
    for order in orders:
        rmse[order] = float(np.sqrt(np.mean((y - _evaluate(_least_squares(x, y, order), x)) ** 2)))
        per_group = np.empty(len(labels))
        for i, label in enumerate(labels):
            out = group == label
            fitted = _least_squares(x[~out], y[~out], order) if (~out).sum() > order else _least_squares(x, y, order)
            per_group[i] = np.mean((y[out] - _evaluate(fitted, x[out])) ** 2)
        weight = np.array([(group == label).mean() for label in labels])
        loss[order] = per_group * weight * len(labels)
        held_out[order] = float(np.sqrt(loss[order].mean()))
    best = min(orders, key=held_out.__getitem__)
    order = next(o for o in orders if o == best or _as_good(loss[o], loss[best]))
    coefficients = _least_squares(x, y, order)
    if monotonic and not _is_monotonic(coefficients, x.min(), x.max()):
        coefficients = monotonic_polynomial(x, y, order)
    return PolynomialFit(coefficients, order, rmse, held_out)


def monotonic_polynomial(x: Array, y: Array, order: int) -> Array:
    """Ascending coefficients of the least-squares polynomial that never turns back over the range of x.

    In the Bernstein basis over the range, coefficients that only rise (or only fall) make a monotonic polynomial
    (Farouki 2012, "The Bernstein polynomial basis: a centennial retrospective", section 3.4); their increments are
    bounded at zero.
    """
    low, high = float(x.min()), float(x.max())
    u = (x - low) / (high - low)
    basis = np.stack([comb(order, i) * u**i * (1 - u) ** (order - i) for i in range(order + 1)], axis=1)
    cumulative = np.cumsum(basis[:, ::-1], axis=1)[:, ::-1]  # column i: effect of the i-th increment
    rising = np.polyfit(x, y, 1)[0] > 0
    bounds = np.full(order + 1, 0.0), np.full(order + 1, np.inf)
    if not rising:
        bounds = -bounds[1], bounds[0]
    bounds[0][0], bounds[1][0] = -np.inf, np.inf
    increments = lsq_linear(cumulative, y, bounds).x
    bernstein = np.cumsum(increments)
    power = np.zeros(order + 1)  # Bernstein to power basis in u, then to x
    for j in range(order + 1):
        power[j] = sum(comb(order, j) * comb(j, i) * (-1.0) ** (j - i) * bernstein[i] for i in range(j + 1))
    in_x = np.polynomial.Polynomial(power)(np.polynomial.Polynomial([-low, 1.0]) / (high - low))
    return np.pad(in_x.coef, (0, order + 1 - len(in_x.coef)))


def _evaluate(coefficients: Array, x: Array) -> Array:
    return np.polynomial.polynomial.polyval(x, coefficients)


def _least_squares(x: Array, y: Array, order: int) -> Array:
    centre, scale = float(np.mean(x)), float(np.ptp(x)) / 2 or 1.0
    basis = np.polynomial.polynomial.polyvander((x - centre) / scale, order)
    coefficients = np.linalg.lstsq(basis, y, rcond=None)[0]
    in_x = np.polynomial.Polynomial(coefficients)(np.polynomial.Polynomial([-centre, 1.0]) / scale)
    return np.pad(in_x.coef, (0, order + 1 - len(in_x.coef)))


def _kept(x: Array, y: Array, order: int) -> NDArray[np.bool_]:
    """Finite samples within six robust standard deviations of a fit of the highest order."""
    kept = np.isfinite(x) & np.isfinite(y)
    floor = 1e-3 * np.ptp(y[kept])
    for _ in range(3):
        residual = y - _evaluate(_least_squares(x[kept], y[kept], order), x)
        with np.errstate(invalid="ignore"):
            kept = np.isfinite(residual) & (np.abs(residual) <= 6 * 1.4826 * np.nanmedian(np.abs(residual)) + floor)
    return kept


def _as_good(loss: Array, best: Array) -> bool:
    """Whether held-out losses per group are not worse: in their logarithm, so that no single group decides."""
    difference = np.log(loss + 1e-300) - np.log(best + 1e-300)
    return difference.mean() <= 2 * difference.std(ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else False


def _is_monotonic(coefficients: Array, low: float, high: float) -> bool:
    slope = _evaluate(np.polynomial.polynomial.polyder(coefficients), np.linspace(low, high, 400))
    return bool((slope >= 0).all() or (slope <= 0).all())
