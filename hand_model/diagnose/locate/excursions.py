"""Excursions: short whiles in which an angle runs ahead of what the same place and direction give in other strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...effects import effect
from ...effects.base import DriveState
from ..name.balance import Balance, Term
from .motion import local_quadratic

Array = NDArray[np.float64]

LONGEST_S = 2.5  # what lasts longer is no excursion
SHORTEST_S = 0.12
GROWTH = 1.3  # from one length tried to the next
LEAST = 12.0  # log likelihood ratio of an excursion, beyond the search over moments and lengths
SMOOTH_S = 0.06  # bandwidth of its course


def with_excursions(states: Sequence[DriveState]) -> tuple[DriveState, ...]:
    """The states with "ahead" in `extra`: (n,) [effort unit] the course of every excursion, zero elsewhere.

    The residual of the declared map and a drifting clock, minus its median over replicates (same place and direction in other strokes), is
    searched for windows whose mean stands out by a likelihood ratio; each must have ended before LONGEST_S.
    """
    states = tuple(states)
    if not states:
        return states
    balance = Balance(states, everything=True)
    drifting = balance.fit((Term(effect("clock_drift"), {}),))  # a clock at another rate lifts the finger where it is fast
    residual = _beside_replicates(balance, balance.effort - drifting.prediction)
    out, start = [], 0
    for state, mask in zip(states, balance.masks, strict=True):
        mine = residual[start : start + mask.sum()]
        start += len(mine)
        ahead = np.zeros(len(state.time_s))
        if len(mine) > 50:
            ahead[mask] = _course(state.time_s[mask], mine, balance.sigma * np.sqrt(balance.inflation) if balance.inflation > 1 else 0.0)
        out.append(replace(state, extra={**state.extra, "ahead": ahead}))
    return tuple(out)


def _beside_replicates(balance: Balance, residual: Array) -> Array:
    """Residual (n,) minus the median over the strokes that pass the same place in the same direction."""
    position, velocity = balance.gather(lambda s: s.position), balance.gather(lambda s: s.velocity)
    still = 0.02 * float(np.percentile(np.abs(velocity), 98))
    way = np.sign(velocity) * (np.abs(velocity) > still)
    place = np.searchsorted(np.quantile(position, np.linspace(0, 1, 25)[1:-1]), position)
    cell = np.unique(place * 3 + way + 1, return_inverse=True)[1]
    out = residual.copy()
    for c in range(cell.max() + 1):
        mine = np.flatnonzero(cell == c)
        _, index = np.unique(balance.stroke[mine], return_inverse=True)
        means = np.bincount(index, residual[mine]) / np.bincount(index)
        out[mine] -= np.median(means) if len(means) > 2 else np.median(residual[mine])
    return out


def _course(time_s: Array, residual: Array, coloured: float) -> Array:
    """Smoothed residual (n,) within the excursions of one recording, zero elsewhere. coloured: deviation of one reading that a mean over
    many has, where noise is not white, else zero."""
    step = float(np.median(np.diff(time_s)))
    left = residual.copy()
    inside = np.zeros(len(left), bool)
    quiet = max(float(np.sqrt(np.median(np.diff(residual) ** 2) / 0.9099)), coloured)
    lengths = np.unique(np.geomspace(SHORTEST_S / step, LONGEST_S / step, 1 + int(np.log(LONGEST_S / SHORTEST_S) / np.log(GROWTH))).astype(int))
    for _ in range(len(left)):
        gain, begin, end = _best_window(left, quiet, lengths)
        if gain < LEAST or end - begin >= lengths[-1]:
            break
        inside[begin:end] = True
        left[begin:end] = 0.0
    smooth = local_quadratic(time_s, residual, SMOOTH_S)[0]
    return np.where(inside, np.maximum(smooth, 0.0), 0.0)


def _best_window(residual: Array, sigma: float, lengths: NDArray[np.int64]) -> tuple[float, int, int]:
    """Largest log likelihood ratio of a raised mean over all windows, less the search, and the window. A window noisier than
    the rest counts by its own noise."""
    total = np.concatenate([[0.0], np.cumsum(residual)])
    rough = np.concatenate([[0.0], np.cumsum(np.diff(residual, prepend=residual[0]) ** 2 / 2)])
    best = (-np.inf, 0, 0)
    for n in lengths:
        if n >= len(residual):
            break
        mean = (total[n:] - total[:-n]) / n
        variance = np.maximum((rough[n:] - rough[:-n]) / n, sigma**2)
        gain = np.where(mean > 0, 0.5 * n * mean**2 / variance, 0.0)
        at = int(np.argmax(gain))
        searched = float(np.log(len(lengths) * len(residual) / n))
        if gain[at] - searched > best[0]:
            best = (float(gain[at]) - searched, at, at + int(n))
    return best
