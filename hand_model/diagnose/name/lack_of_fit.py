"""Is anything missing at all? Residuals grouped by what they could depend on, against the pure error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...effects.path import travelled
from .balance import Balance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LackOfFit:
    """p: probability of a residual as structured as this if nothing is missing (Bonferroni over the groupings).
    ratio: variance of cell means over what pure error explains, of the most telling grouping. telling: its name.
    limit: the ratio that pure error stays below with probability 1 - alpha. excess: weighted sum of squares of cell
    means beyond what pure error explains, of the grouping that holds most: the explainable mismatch. unrest: variance
    from one stroke to its replicate, over the noise's."""

    p: float
    ratio: float
    telling: str
    limit: float
    excess: float = 0.0
    unrest: float = 0.0


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
    """Variance from one stroke to its next replicate (same direction and speed) beyond the samples' noise, in its
    units:
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


def lack_of_fit(
    balance: Balance, prediction: Array, parameters: int, alpha: float, calmest: float = np.inf
) -> LackOfFit:
    """Tests of cell means of the residual (steady samples) against how they vary from stroke to stroke, several
    groupings.

    parameters: number of fitted coefficients, taken off the degrees of freedom of the grouping by strokes. alpha:
    false-alarm probability that `limit` stands for. calmest: the least unrest known of other models of these
    recordings, by which the excess is measured: what they explain is no pure error. The null is that of a wild
    bootstrap with strokes as blocks (Liu 1988), in closed form: it holds for noise that is coloured, differs over pose
    or speed, or comes in bursts.
    """
    from scipy.stats import f

    z = (balance.effort - prediction) * balance.weight
    use = balance.steady
    unrest = stroke_variance(balance, z)
    best, excess = LackOfFit(1.0, 0.0, "", 0.0), 0.0
    cells = groupings(balance)
    for name, label in cells.items():
        sums, count = _sums(label[use], balance.stroke[use], z[use])
        keep = count.sum(1) >= 3
        sums, count = sums[keep], count[keep]
        variance = balance.inflation * count.sum(1) + unrest * (count**2).sum(1)
        pure = balance.inflation * count.sum(1) + min(unrest, calmest) * (count**2).sum(1)
        excess = max(excess, float(np.sum(sums.sum(1) ** 2 / pure)) - max(len(sums) - parameters, 1))
        if name == "stroke":
            freedom, many = max(len(sums) - 2, 1), max(count.shape[1] - parameters, 2)
            ratio = float(np.sum(sums.sum(1) ** 2 / variance)) / freedom
        else:
            ratio, freedom, many = _against_strokes(sums, count, variance)
        p = min(float(f.sf(ratio, freedom, many)) * len(cells), 1.0)
        if p < best.p or not best.telling:
            best = LackOfFit(p, ratio, name, float(f.isf(alpha / len(cells), freedom, many)))
    return replace(best, excess=float(excess), unrest=unrest)


def _sums(cell: NDArray[np.int64], stroke: NDArray[np.int64], z: Array) -> tuple[Array, Array]:
    """Sum of z and number of samples (cells, strokes)."""
    i, j = np.unique(cell, return_inverse=True)[1], np.unique(stroke, return_inverse=True)[1]
    shape = (i.max() + 1, j.max() + 1) if len(i) else (0, 0)
    flat = i * max(shape[1], 1) + j
    size = shape[0] * shape[1]
    return np.bincount(flat, z, size).reshape(shape), np.bincount(flat, minlength=size).reshape(shape).astype(float)


def _against_strokes(sums: Array, count: Array, variance: Array) -> tuple[float, float, float]:
    """Sum of squared cell means over its expectation if only the strokes differ, and its two degrees of freedom.

    sums, count: (cells, strokes); variance: (cells,) scales of the cells. With strokes multiplied by random signs the
    sum is a quadratic form, whose first two moments give the scale and the degrees of freedom (Satterthwaite 1946).
    """
    replicates = (count > 0).sum(1)
    keep = replicates >= 3
    if not keep.any():
        return 0.0, 1.0, 1.0
    sums, count, variance, replicates = sums[keep], count[keep], variance[keep], replicates[keep]
    total = count.sum(1)
    left = sums - count * (sums.sum(1) / total)[:, None]
    # what taking the cell's mean out leaves of the variance of its strokes
    left /= np.sqrt(1 - (count**2).sum(1) / total**2).clip(0.3)[:, None]
    root = left / np.sqrt(variance)[:, None]
    form = root @ root.T
    expected = float(np.trace(form))
    freedom = expected**2 / max(float(np.sum(form**2)), 1e-300)
    return (
        float(np.sum(sums.sum(1) ** 2 / variance)) / max(expected, 1e-300),
        freedom,
        max(float((count > 0).any(0).sum()) - 1, 1.0),
    )
