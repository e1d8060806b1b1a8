"""Lack of fit of an output-error fit, from moves that were commanded more than once (Draper & Smith 1998, ch. 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .output_error import OutputErrorFit

Array = NDArray[np.float64]

BIN_S = 0.04  # over which residuals are averaged before replicates are compared


def lack_of_fit(f: OutputErrorFit) -> float:
    """Systematic misfit: the variance, in units of the noise's, that repeated moves leave unexplained alike; of the
    worse channel.

    Moves of one kind (origin, target, speed) are replicates: what differs between them is pure error, of whatever
    colour; what they share is the model's (analysis of variance on residuals averaged over BIN_S). The lower end of its
    95 % interval, from the scatter between kinds;
    never more than the mean square less one, which is all that counts where nothing was repeated.
    """
    kinds: dict[tuple, list[int]] = {}
    for i, m in enumerate(f.moves):
        kinds.setdefault((round(m.origin), round(m.target), round(float(m.own[2]), 2)), []).append(i)
    least = max(f.chi2) - 1.0
    found = [_shared(f, members) for members in kinds.values() if len(members) > 1 and np.isfinite(least)]
    if len(found) < 3:
        return least
    square, samples = np.array([x for x, _ in found]), np.array([n for _, n in found])
    mean = square.sum(axis=0) / samples.sum()
    sd = np.sqrt(np.sum((square - samples[:, None] * mean) ** 2, axis=0)) / samples.sum()
    return float(min(least, np.max(mean - 1.64 * sd)))


def _shared(f: OutputErrorFit, members: Sequence[int]) -> tuple[Array, float]:
    """Sum of squares (2,) that replicates share, whitened, of position and current, and the samples that it stands
    for."""
    last = min(f.moves[i].time_s[-1] - f.own[i, 0] for i in members)
    bins = max(int(last / BIN_S), 1)
    counts, means = np.empty((len(members), bins)), np.empty((len(members), 2, bins))
    for row, i in enumerate(members):
        at = np.floor((f.moves[i].time_s - f.own[i, 0]) / BIN_S).astype(int)
        k = (at >= 0) & (at < bins)
        counts[row] = np.bincount(at[k], minlength=bins)
        for channel in (0, 1):
            means[row, channel] = np.bincount(
                at[k], f.residual[i][k, channel] / f.sigma[channel], minlength=bins
            ) / np.maximum(counts[row], 1)
    full = (counts > 0).all(axis=0)
    samples = 1 / (1 / counts[:, full]).mean(axis=0)
    mean, scatter = means[:, :, full].mean(axis=0), means[:, :, full].var(axis=0, ddof=1)
    return np.sum((mean**2 - scatter / len(members)) * samples, axis=1), float(samples.sum())
