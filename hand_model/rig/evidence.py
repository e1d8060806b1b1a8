"""What held-out errors of rivals say, from resampled recordings: who is better beyond doubt, who is simply as good.

Cluster bootstrap (Davison & Hinkley 1997, sec. 3.8): whole recordings are drawn where there are enough of them, since
blocks of one recording share what is peculiar to it; else blocks. A tie goes to the simpler rival within one standard
error of the best (Breiman et al. 1984). That anything is there at all is asked first, of
the best of so many rivals: the largest of their gains against its own distribution with signs turned at random
(Westfall & Young 1993; Romano & Wolf 2005), so that rivals that say the same count once (a protected comparison, Fisher
1935).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RESAMPLES = 600
BEYOND_DOUBT = 0.95
ONE_STANDARD_ERROR = 0.84  # of a normal distribution: so often is a gain of one standard error a gain
ENOUGH = 6  # recordings from which on they are drawn whole


@dataclass(frozen=True)
class Verdict:
    """best, chosen: indices among those that surely beat nothing (chosen is the simplest as good as the best);
    probability: of the chosen one against nothing; wins (rivals,): share of resamples in which each is best of all;
    close:
    not told from the best, in order of error; tied: within one standard error of it; gain: share of the error of
    "nothing" that the chosen one takes away."""

    best: int
    chosen: int
    probability: float
    wins: Array
    close: tuple[int, ...]
    tied: tuple[int, ...]
    gain: float


def units(group: Array) -> Array:
    """What is drawn together (blocks,): recordings where there are enough, else every block alone."""
    names, unit = np.unique(group, return_inverse=True)
    return unit if len(names) >= ENOUGH else np.arange(len(group))


def multiplicities(group: Array, count: int = RESAMPLES, seed: int = 0) -> Array:
    """How often each block is drawn (count, blocks); group (blocks,): recording of each block."""
    unit = units(group)
    total = int(unit.max()) + 1
    drawn = np.random.default_rng(seed).integers(0, total, (count, total))
    return np.stack([np.bincount(row, minlength=total) for row in drawn]).astype(float)[:, unit]


def beyond_chance(none: Array, errors: Array, worth: float = 0.0, flips: int = RESAMPLES, seed: int = 0) -> float:
    """Probability that the best of several rivals' gains is no chance: had none of them anything to gain, a unit's gain
    might as well have had the other sign, of all rivals at once; the largest self-normalised sum is held to its
    distribution under such flips. none (units,), errors (rivals, units); worth: share of "nothing" that a rival has to
    take away to be chosen, here as there."""
    apart = none - errors
    gains = apart / (none + errors + 1e-300)  # relative, or the loudest recording would speak for all
    size = np.sqrt(np.sum(gains**2, 1)) + 1e-300

    def largest(signs: Array) -> Array:
        able = signs @ apart.T >= worth * none.sum()
        return np.max(np.where(able, signs @ gains.T / size, -np.inf), 1, initial=-np.inf)

    best = largest(np.ones((1, len(none))))[0]
    by_chance = largest(np.random.default_rng(seed).choice([-1.0, 1.0], (flips, len(none))))
    return float(np.mean(by_chance < best - 1e-9))


def weigh(
    none: Array,
    errors: Array,
    sizes: Sequence[int],
    group: Array,
    least: float = BEYOND_DOUBT,
    by_chance: bool = True,
    worth: float = 0.0,
) -> Verdict | None:
    """Compare rivals (errors (rivals, blocks), sizes: parameters) with each other and with "nothing" (none (blocks,));
    None where none of them beats nothing with probability `least`, the choice among them allowed for (by_chance: that
    they are more than chance is asked here), or gains enough (worth: share of the error of "nothing")."""
    draws = multiplicities(group)
    resampled, base, total = errors @ draws.T, draws @ none, errors.sum(1)
    against = np.mean(resampled < base, 1)
    unit = units(group)
    mine, theirs = np.bincount(unit, none), np.stack([np.bincount(unit, e) for e in errors])
    if by_chance and beyond_chance(mine, theirs, worth) < least:  # of many rivals some win so
        return None
    sure = [k for k in range(len(errors)) if against[k] >= least]
    if not sure:
        return None
    best = min(sure, key=lambda k: total[k])
    if none.sum() - total[best] < worth * none.sum():
        return None
    close = [k for k in sure if np.mean(resampled[best] < resampled[k]) < BEYOND_DOUBT]
    close.sort(key=lambda k: total[k])
    spread = [float(np.std(resampled[k] - resampled[best])) for k in range(len(errors))]
    tied = [k for k in close if total[k] - total[best] <= spread[k]]
    chosen = min(tied, key=lambda k: (sizes[k], total[k]))
    return Verdict(
        best,
        chosen,
        float(against[chosen]),
        np.bincount(np.argmin(resampled, 0), minlength=len(errors)) / len(draws),
        tuple(close),
        tuple(tied),
        float(1.0 - total[chosen] / max(none.sum(), 1e-300)),
    )
