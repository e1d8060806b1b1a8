"""Is anything missing at all? Residuals grouped by what they could depend on, against the pure error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..effects.path import travelled
from .balance import Balance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LackOfFit:
    """p: probability of a residual as structured as this if nothing is missing (Bonferroni over the groupings).
    ratio: variance of cell means over what pure error explains, of the most telling grouping. telling: its name.
    limit: the ratio that pure error stays below with probability 1 - alpha. excess: weighted sum of squares of cell means
    beyond what pure error explains, of the grouping that holds most: the explainable mismatch."""

    p: float
    ratio: float
    telling: str
    limit: float
    excess: float = 0.0


def groupings(balance: Balance) -> dict[str, NDArray[np.int64]]:
    """Cell label (n,) of every compared sample, by grouping; -1 leaves a sample out.

    Position x direction (fine), position x direction x speed, speed x direction, distance since reversal x direction,
    stroke, stroke x third of the stroke.
    """
    position = balance.gather(lambda s: s.position)
    velocity = balance.gather(lambda s: s.velocity)
    since = balance.gather(lambda s: travelled(s.position))
    trial = balance.gather(lambda s: s.extra.get("trial_index", np.zeros(len(s.time_s)))).astype(int)
    way = (velocity > 0).astype(int)
    fine = _bins(position, 40) * 2 + way
    speed = _bins(np.abs(velocity), 5)
    return {
        "position": fine,
        "position x speed": (_bins(position, 10) * 2 + way) * 8 + speed,
        "speed": _bins(np.abs(velocity), 16) * 2 + way,
        "distance since reversal": _bins(since, 16) * 2 + way,
        "stroke": balance.stroke,
        "trial x position": (trial * 8 + _bins(position, 8)) * 2 + way,
    }


def _bins(values: Array, count: int) -> NDArray[np.int64]:
    """Bins of equal occupation."""
    edges = np.quantile(values, np.linspace(0, 1, count + 1)[1:-1])
    return np.searchsorted(edges, values).astype(np.int64)


def stroke_variance(balance: Balance, z: Array) -> float:
    """Variance from one stroke to its next replicate (same direction and speed) beyond the samples' noise, in its units:
    machines do not repeat themselves exactly. Successive differences, so that a slow drift does not count."""
    use = balance.steady
    velocity = balance.gather(lambda s: s.velocity)[use]
    index = np.unique(balance.stroke[use], return_inverse=True)[1]
    count = np.bincount(index)
    mean, speed = np.bincount(index, z[use]) / count, np.bincount(index, velocity) / count
    scale = max(float(np.abs(speed).max()), 1e-12)
    squares = []
    for level in np.unique(np.round(8 * speed / scale)):
        mine = np.flatnonzero((np.round(8 * speed / scale) == level) & (count >= 10))
        noise = balance.inflation / count[mine]
        squares += ((np.diff(mean[mine]) ** 2 - noise[1:] - noise[:-1]) / 2).tolist()
    return max(float(np.mean(squares)), 0.0) if len(squares) >= 8 else 0.0


def lack_of_fit(balance: Balance, prediction: Array, parameters: int, alpha: float) -> LackOfFit:
    """Chi-square tests of cell means of the residual (steady samples) against the pure error, several groupings.

    parameters: number of fitted coefficients, taken off the degrees of freedom of every grouping (conservative where
    a grouping does not see them). alpha: false-alarm probability that `limit` stands for.
    """
    from scipy.stats import chi2

    z = (balance.effort - prediction) * balance.weight
    use = balance.steady
    unrest = stroke_variance(balance, z)
    best, excess = LackOfFit(1.0, 0.0, "", 0.0), 0.0
    cells = groupings(balance)
    for name, label in cells.items():
        index = np.unique(label[use], return_inverse=True)[1]
        count = np.bincount(index)
        total = np.bincount(index, z[use])
        keep = count >= 3
        pairs, size = np.unique(np.stack([index, balance.stroke[use]]), axis=1, return_counts=True)
        common = np.bincount(pairs[0], size.astype(float) ** 2, minlength=len(count))
        variance = balance.inflation * count + unrest * common
        statistic = float(np.sum(total[keep] ** 2 / variance[keep]))
        degrees = max(int(keep.sum()) - (parameters if name != "stroke" else 2), 1)
        excess = max(excess, statistic - degrees)
        p = min(float(chi2.sf(statistic, degrees)) * len(cells), 1.0)
        if p < best.p or not best.telling:
            best = LackOfFit(p, statistic / degrees, name, float(chi2.isf(alpha / len(cells), degrees)) / degrees)
    return replace(best, excess=float(excess))
