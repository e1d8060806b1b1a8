"""Noise of a balance: the pure error of replicates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...effects.base import sample_interval
from .least_squares import bounded_least_squares

if TYPE_CHECKING:
    from .samples import Samples

Array = NDArray[np.float64]

COLOURED = 0.05  # autocorrelation of neighbouring samples from which noise counts as coloured
# samples and seconds over which noise may be correlated; what lasts longer than both is a misfit
LONGEST, LONGEST_S = 15, 0.25
# neighbours, below which a recording's own noise is not told, and standard errors by which it must be another
FEW, LOUDER = 100, 3.0


def noise(balance: Samples) -> tuple[float, float]:
    """Standard deviation of the effort's noise and its integrated autocorrelation time in samples.

    Pure error of replicates: the declared fit's residual minus its mean over all strokes with the same direction, speed
    and place. White noise: differences of neighbouring samples (von Neumann 1941) are sharper and are taken instead.
    """
    steady = balance.gather(lambda s: s.extra.get("steady", np.ones(len(s.time_s)))) > 0
    r = balance.effort - _plain_fit(balance, steady)
    same = (balance.stroke[1:] == balance.stroke[:-1]) & steady[1:] & steady[:-1]
    if same.sum() < 20:
        return float(np.std(r)) or 1.0, 1.0
    neighbours = float(np.sqrt(np.mean(np.diff(r)[same] ** 2) / 2))
    deviation, share = replicate_deviation(balance, r, steady)
    if not len(deviation):
        return max(neighbours, 1e-9), 1.0
    lags = []
    longest = max(LONGEST, round(LONGEST_S / sample_interval(balance.states)))
    for k in range(min(longest, len(r) - 1) + 1):
        pair = (
            (balance.stroke[k:] == balance.stroke[: len(r) - k])
            & np.isfinite(deviation[k:])
            & np.isfinite(deviation[: len(r) - k])
        )
        if pair.sum() <= 20:
            break
        lags.append(float(np.mean((deviation[k:] * deviation[: len(r) - k])[pair])))
    if len(lags) < 2:
        return max(neighbours, 1e-9), 1.0
    # What still correlates after the longest lag is a misfit that does not repeat (an event), no noise.
    covariance = np.array(lags) - max(float(np.mean(lags[1:][-max(len(lags) // 3, 5) :])), 0.0)
    rho = covariance / max(covariance[0], 1e-300)
    if rho[1] < COLOURED:
        return max(neighbours, 1e-9), 1.0
    small = np.flatnonzero(rho < 0.03)
    stop = int(small[0]) if len(small) else len(rho)
    return float(np.sqrt(max(covariance[0], 1e-300) / share)), float(1 + 2 * rho[1:stop].sum())


def replicate_deviation(balance: Samples, residual: Array, use: NDArray[np.bool_]) -> tuple[Array, float]:
    """Residual minus its mean over the other strokes' replicates (n,), nan where there are none, and the share of the
    variance that is left by taking a mean out."""
    position, velocity = balance.gather(lambda s: s.position), balance.gather(lambda s: s.velocity)
    place = np.searchsorted(np.quantile(position, np.linspace(0, 1, 31)[1:-1]), position)
    speed = np.searchsorted(np.quantile(np.abs(velocity), np.linspace(0, 1, 7)[1:-1]), np.abs(velocity))
    cell = np.unique(place * 20 + speed * 2 + (velocity > 0), return_inverse=True)[1]
    cell = np.where(use, cell, -1)
    out = np.full(len(residual), np.nan)
    shares = []
    for c in range(cell.max() + 1):
        mine = np.flatnonzero(cell == c)
        strokes_here, index = np.unique(balance.stroke[mine], return_inverse=True)
        if len(strokes_here) < 3:
            continue
        means = np.bincount(index, residual[mine]) / np.bincount(index)
        out[mine] = residual[mine] - means.mean()
        shares.append(np.full(len(mine), 1 - 1 / len(mine)))
    return (out, float(np.concatenate(shares).mean())) if shares else (np.zeros(0), 1.0)


def loudness(balance: Samples, residual: Array) -> Array:
    """Noise of the recording of each sample (n,) over that of all, by how neighbouring residuals (n,) differ; one where
    it is no louder than by chance."""
    recording = balance.gather(lambda s: np.full(len(s.time_s), s.trial))
    near = (balance.stroke[1:] == balance.stroke[:-1]) & balance.steady[1:] & balance.steady[:-1]
    square = np.diff(residual) ** 2
    usual = float(np.mean(square[near])) if near.any() else 0.0
    out = np.ones(len(residual))
    for name in np.unique(recording) if usual > 0 else ():
        own = near & (recording[1:] == name)
        count = int(own.sum())
        if count > FEW and (louder := float(np.mean(square[own])) / usual) > 1 + LOUDER * np.sqrt(3 / count):
            out[recording == name] = np.sqrt(louder)
    return out


def _plain_fit(balance: Samples, use: NDArray[np.bool_]) -> Array:
    matrix = balance.gather(lambda s: s.declared)
    free = np.full(matrix.shape[1], np.inf)
    use = use if use.sum() > 5 * matrix.shape[1] else np.ones(len(matrix), bool)
    return matrix @ bounded_least_squares(matrix[use], balance.effort[use], -free, free)
