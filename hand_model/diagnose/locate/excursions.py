"""Excursions: short whiles in which an angle runs ahead of what the same place and direction give in other strokes."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...effects import effect
from ...effects.base import DriveState
from ...effects.path import runs
from ..name.balance import Balance
from ..name.term import Term
from .motion import lasting_errors, local_quadratic

Array = NDArray[np.float64]

LONGEST_S = 12.0  # what lasts longer is no excursion
SHORTEST_S = 0.12  # of the windows that are tried
LASTING_S = 0.2  # above half of its height: what is shorter is a reading at the wrong time, and no finger
GROWTH = 1.3  # from one length tried to the next
FEWEST = 50  # samples of a recording below which nothing is searched
BEYOND = 2.0  # times as much as anything stands out below
LEAST = 12.0  # log likelihood ratio of an excursion, beyond the search over moments and lengths
SMOOTH_S = 0.06  # bandwidth of its course
EDGE_S = 0.3  # by which it may begin before and end after the window that tells it best


def with_excursions(states: Sequence[DriveState]) -> tuple[DriveState, ...]:
    """The states with "ahead" in `extra`: (n,) [effort unit] the course of every excursion, zero elsewhere.

    The residual of the declared map and a drifting clock, minus its median over replicates (same place and direction in
    other strokes), is searched for windows whose mean stands out by a likelihood ratio, and beyond what stands out
    below: nothing pushes a finger behind its drive, so what does so there is chance (an angle that wanders goes both
    ways). Each must have ended before LONGEST_S.
    """
    states = tuple(states)
    if not states:
        return states
    balance = Balance(states, everything=True)
    # a clock at another rate lifts the finger where it is fast
    drifting = balance.fit((Term(effect("clock_drift"), {}),))
    told = _recordings(balance, balance.effort - drifting.prediction)
    least, out = _least(told.values()), []
    for state, mask in zip(states, balance.masks, strict=True):
        ahead = np.zeros(len(state.time_s))
        if state.trial in told:
            ahead[mask] = _course(told[state.trial], least)
        out.append(replace(state, extra={**state.extra, "ahead": ahead}))
    return tuple(out)


def whiles_below(states: Sequence[DriveState], trials: Collection[str]) -> dict[str, list[list[float]]]:
    """[begin, end] [s of the recording] of the whiles, by trial of those given, in which the effort lies below what the
    same place and direction give in other strokes, as plainly as an excursion stands out, and beyond what lies above."""
    if not trials:
        return {}
    balance = Balance(tuple(states), everything=True)
    told = _recordings(balance, balance.fit().prediction - balance.effort)
    asked = {trial: t for trial, t in told.items() if trial in trials}
    least, out = _least(asked.values()), {}
    for trial, t in asked.items():
        inside = np.zeros(len(t.residual), bool)
        for begin, end in _windows(t, least):
            inside[begin:end] = True
        out[trial] = [[float(t.time_s[a]), float(t.time_s[b - 1])] for a, b in runs(inside)]
    return out


@dataclass(frozen=True)
class _Told:
    """One recording's residual (n,) beside replicates. sigma: its noise. lengths: of the windows to try, in samples."""

    time_s: Array
    residual: Array
    sigma: float
    lengths: NDArray[np.int64]

    @classmethod
    def of(cls, time_s: Array, residual: Array) -> _Told:
        """The noise is that of one reading as a mean over many has it."""
        step = float(np.median(np.diff(time_s)))
        steps = 1 + int(np.log(LONGEST_S / SHORTEST_S) / np.log(GROWTH))
        lengths = np.unique(np.geomspace(SHORTEST_S / step, LONGEST_S / step, steps).astype(int))
        variance, alike = lasting_errors(time_s, residual, np.ones(len(residual), bool))
        coloured = float(np.sqrt(variance + 2 * alike.sum())) if len(alike) else 0.0
        return cls(time_s, residual, max(float(np.sqrt(np.median(np.diff(residual) ** 2) / 0.9099)), coloured), lengths)


def _recordings(balance: Balance, residual: Array) -> dict[str, _Told]:
    """What each recording that is long enough tells, by trial, of a residual (n,)."""
    parts = np.split(_beside_replicates(balance, residual), np.cumsum([m.sum() for m in balance.masks])[:-1])
    return {
        s.trial: _Told.of(s.time_s[m], r)
        for s, m, r in zip(balance.states, balance.masks, parts, strict=True)
        if len(r) > FEWEST
    }


def _least(told: Collection[_Told]) -> float:
    """Log likelihood ratio that a window must have: more than chance has, and than any that stands out the other way."""
    other_way = max((_best_window(-t.residual, t.sigma, t.lengths)[0] for t in told), default=0.0)
    return max(LEAST, BEYOND * other_way)


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


def _course(told: _Told, least: float) -> Array:
    """Smoothed residual (n,) within the excursions of one recording, zero elsewhere. least: log likelihood ratio of
    each."""
    inside = np.zeros(len(told.residual), bool)
    smooth = np.maximum(local_quadratic(told.time_s, told.residual, SMOOTH_S)[0], 0.0)
    for begin, end in _windows(told, least):
        inside[begin:end] = _lasting(told.time_s, smooth, begin, end)
    return np.where(_to_zero(inside, smooth, int(EDGE_S / float(np.median(np.diff(told.time_s))))), smooth, 0.0)


def _windows(told: _Told, least: float) -> Iterator[tuple[int, int]]:
    """Windows (begin, end) whose mean stands out by that log likelihood ratio, each without those before it."""
    left = told.residual.copy()
    for _ in range(len(left)):
        gain, begin, end = _best_window(left, told.sigma, told.lengths)
        if gain < least or end - begin >= told.lengths[-1]:
            return
        yield begin, end
        left[begin:end] = 0.0


def _lasting(time_s: Array, smooth: Array, begin: int, end: int) -> bool:
    """Whether a course is above half of its largest height within a window for long enough around it."""
    top = begin + int(np.argmax(smooth[begin:end]))
    low = np.flatnonzero(smooth < 0.5 * smooth[top])
    first, last = np.searchsorted(low, top), len(low)
    since = time_s[low[first - 1]] if first > 0 else time_s[0]
    until = time_s[low[first]] if first < last else time_s[-1]
    return bool(until - since >= LASTING_S)


def _to_zero(inside: NDArray[np.bool_], smooth: Array, most: int) -> NDArray[np.bool_]:
    """The windows (n,), each on to where the course is back at zero, `most` samples at most: a finger does not jump."""
    out = inside.copy()
    for step in (1, -1):
        grown = out[::step]
        for _ in range(most):
            grown[1:] |= grown[:-1] & (smooth[::step][1:] > 0)
    return out


def _best_window(residual: Array, sigma: float, lengths: NDArray[np.int64]) -> tuple[float, int, int]:
    """Largest log likelihood ratio of a raised mean over all windows, less the search, and the window. A window noisier
    than the rest counts by its own noise."""
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
