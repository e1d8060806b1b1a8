"""Wander: what differs from one while to the next although place, speed and direction are the same.

Machines and channels do not repeat themselves exactly: a zero drifts, friction is another in every stroke, something
shakes the bench. Such a load has no law to be named, but whoever counts it as white noise names whatever effect
resembles the accident. It is a random level per while (a random intercept; Laird & Ware 1982), as large as the
replicates say.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .noise import replicate_deviation
from .samples import Samples

Array = NDArray[np.float64]

WHILES_S = (0.3, 0.8, 2.0, np.inf)  # lengths of the whiles within a stroke that are tried; infinite: the whole stroke
EVIDENCE_LEAST = 6.0  # log likelihood that a random level must bring: as much as any effect
FEWEST = 8  # whiles below which nothing can be said


@dataclass(frozen=True)
class Wander:
    """A random level per while. label: (n,) while of every compared sample. deviation: standard deviation of the levels
    [effort]. evidence: log likelihood that it brings. length_s: of a while, infinite for whole strokes."""

    label: NDArray[np.int64]
    deviation: float
    evidence: float
    length_s: float

    @property
    def real(self) -> bool:
        """Whether it brings as much evidence as any effect must."""
        return self.evidence >= EVIDENCE_LEAST

    @cached_property
    def _pieces(self) -> dict[tuple[int, int], Wander]:
        return {}

    def within(self, rows: slice) -> Wander:
        """The levels of some rows alone, which hold whole whiles."""
        place = rows.start, rows.stop
        if place not in self._pieces:
            self._pieces[place] = replace(self, label=self.label[rows])
        return self._pieces[place]

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        """Where each while begins: whiles follow each other."""
        return np.flatnonzero(np.r_[True, np.diff(self.label) != 0])

    @cached_property
    def _lengths(self) -> NDArray[np.int64]:
        return np.diff(np.r_[self._starts, len(self.label)])

    def whiten(self, values: Array, weight: Array, inflation: float) -> Array:
        """Weighted values (n,) or (n, k) with the level of each while shrunk to the size that noise has: uncorrelated
        again.

        weight: (n,) that `values` carry, zero for samples that take no part. Exact inverse root of
        I + d^2/inflation * w w' within each while (Woodbury).
        """
        size = np.add.reduceat(weight**2, self._starts)
        shrink = 1 - 1 / np.sqrt(1 + self.deviation**2 * size / inflation)
        rate = np.where(size > 0, shrink / np.where(size > 0, size, 1.0), 0.0)

        def one(column: Array) -> Array:
            return column - np.repeat(rate * np.add.reduceat(column * weight, self._starts), self._lengths) * weight

        if values.ndim == 1:
            return one(values)
        out = np.empty(values.shape)
        for j in range(values.shape[1]):  # column by column: sums along the rows of a matrix are slow
            out[:, j] = one(values[:, j])
        return out

    def common(self, weighted: Array, weight: Array, inflation: float) -> Array:
        """What the levels take off the products (k, k) of weighted columns, rows here (k, n): X X' less this is that of
        the whitened ones (Woodbury)."""
        size = np.add.reduceat(weight**2, self._starts)
        sums = np.add.reduceat(weighted * weight, self._starts, axis=1)
        share = self.deviation**2 / (inflation + self.deviation**2 * size)
        return (sums * share) @ sums.T

    def log_likelihood(self, residual: Array, weight: Array, inflation: float) -> float:
        """Log likelihood of a weighted residual (n,), normalised to that of white noise of the same weights."""
        size = np.bincount(self.label, weight**2) / inflation
        left = float(np.sum(self.whiten(residual, weight, inflation) ** 2)) / inflation
        return -0.5 * (left + float(np.sum(np.log1p(self.deviation**2 * size))))


def estimate_wander(balance: Samples, prediction: Array) -> Wander | None:
    """The random level that the residual of a prediction (n,) shows in training recordings, beside what repeats: the
    likeliest size and length of a while (Laird & Ware 1982). None where there are too few replicates to tell."""
    use = balance.train & balance.steady
    apart, _ = replicate_deviation(balance, balance.effort - prediction, use)
    if not len(apart):
        return None
    seen = use & np.isfinite(apart)
    weight = np.where(seen, balance.weight, 0.0)
    z = np.where(seen, apart, 0.0) * weight
    best = None
    for length_s in WHILES_S:
        label = whiles(balance, length_s)
        size = np.bincount(label, weight**2) / balance.inflation
        square = (np.bincount(label, z * weight) / balance.inflation) ** 2
        square, size = square[size > 0], size[size > 0]
        if len(size) < FEWEST:
            continue
        deviations = np.geomspace(0.02, 5.0, 40) * balance.sigma
        gains = [_gain(d**2, size, square) for d in deviations]
        k = int(np.argmax(gains))
        if best is None or gains[k] > best.evidence:
            best = Wander(label, float(deviations[k]), float(gains[k]), float(length_s))
    return best


def _gain(variance: float, size: Array, square: Array) -> float:
    grown = 1 + variance * size
    return 0.5 * float(np.sum(square * variance / grown - np.log(grown)))


def whiles(balance: Samples, length_s: float) -> NDArray[np.int64]:
    """Label (n,) of the while to which each compared sample belongs: strokes, cut into pieces of `length_s` [s]."""
    if not np.isfinite(length_s):
        return balance.stroke
    time_s = balance.gather(lambda s: s.time_s)
    first = np.full(int(balance.stroke.max()) + 1, np.inf)
    np.minimum.at(first, balance.stroke, time_s)
    piece = ((time_s - first[balance.stroke]) / length_s).astype(np.int64)
    return np.unique(balance.stroke * (int(piece.max()) + 1) + piece, return_inverse=True)[1]
