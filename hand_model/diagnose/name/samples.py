"""The compared samples of recordings, stacked: efforts, weights, noise, and what of them takes part in learning."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...effects.path import strokes
from .memory import Memory
from .noise import noise

if TYPE_CHECKING:
    from .wander import Wander

Array = NDArray[np.float64]

SETTLED = 0.25  # of the noise: more of what starts and stops bring, and motion is not steady
UNSETTLED = 1e-3  # weight left to a start or stop where steady motion alone is asked


class Samples:
    """The compared samples of several DriveStates, stacked.

    effort, weight (1 / standard deviation), timing (the part of that deviation that starts and stops bring), train
    (bool): (n,). sigma:
    noise of the effort; inflation: integrated autocorrelation of that noise (1 where it is white): a sum of squares
    counts divided by it. untouched: whether some recordings take no part in learning. typical: declared coefficients of
    other balances of the same kind, by name.
    """

    def __init__(
        self, states: tuple[DriveState, ...], everything: bool = False, typical: Mapping[str, float] | None = None
    ) -> None:
        self.states, self.typical = states, typical or {}
        self.masks = [np.isfinite(s.effort) & np.isfinite(s.declared).all(1) for s in states]
        self._rows = [np.flatnonzero(m) for m in self.masks]
        self.effort = self.gather(lambda s: s.effort)
        self.train = np.concatenate(
            [np.full(m.sum(), everything or not s.validate) for s, m in zip(states, self.masks, strict=True)]
        )
        self.untouched = not self.train.all()
        self.names = states[0].declared_names or tuple(f"c{i}" for i in range(states[0].declared.shape[1]))
        self.stroke = self._strokes()
        self.sigma, self.inflation = 1.0, 1.0
        self.weight = np.ones(len(self.effort))
        self.sigma, self.inflation = noise(self)
        self.timing = self.gather(lambda s: s.extra.get("sigma", np.zeros(len(s.time_s))))
        self.weight = 1 / np.hypot(self.sigma, self.timing)
        self.steady = self.timing <= SETTLED * self.sigma
        self.wander: Wander | None = None
        self._last = Memory()
        self._learning: Self | None = None

    def wandering(self, wander: Wander | None) -> Self:
        """The same balance with a random level per while in its noise, where that is real."""
        return self._with(wander=wander if wander is not None and wander.real else None)

    def with_inflation(self, inflation: float) -> Self:
        """The same balance with noise that lasts as long as an integrated autocorrelation says."""
        return self._with(inflation=inflation)

    def told(self, other: Callable[[DriveState], DriveState]) -> Self:
        """The same balance with `other` of each state in its place: of the same samples, efforts and noise."""
        return self._with(states=tuple(other(s) for s in self.states), _last=Memory())

    def settled(self) -> Self:
        """The same balance with next to no weight on starts and stops."""
        return self.only(self.steady)

    def only(self, samples: NDArray[np.bool_]) -> Self:
        """The same balance with next to no weight on any other samples than these (n,)."""
        return self._with(weight=np.where(samples, self.weight, UNSETTLED * self.weight))

    def learning(self) -> Self:
        """The same balance without the samples of recordings that take no part in learning: what is only compared is
        found there sooner."""
        if self._learning is None:
            mine = self.train
            kept = {
                name: getattr(self, name)[mine] for name in ("effort", "weight", "timing", "steady", "stroke", "train")
            }
            rows = [rows[:0] if state.validate else rows for state, rows in zip(self.states, self._rows, strict=True)]
            wander = None if self.wander is None else replace(self.wander, label=self.wander.label[mine])
            self._learning = self if mine.all() else self._with(**kept, _rows=rows, wander=wander, _last=Memory())
        return self._learning

    def _with(self, **changes: Any) -> Self:
        """The same balance with other attributes, what was kept of the old ones thrown away."""
        other = object.__new__(type(self))
        other.__dict__.update({**self.__dict__, **self._fresh(), **changes})
        return other

    def _fresh(self) -> dict[str, Any]:
        """What is only kept to save time, thrown away."""
        return {"_learning": None}

    def __getstate__(self) -> dict[str, Any]:
        """What another process needs."""
        return {**self.__dict__, **self._fresh(), "_last": Memory()}

    def whiten(self, values: Array, weight: Array, rows: slice | None = None) -> Array:
        """Weighted values (n,) or (n, k) in which the noise is as good as white; as they are without `wander`. rows:
        those of whole recordings that the values are of, None for all."""
        if self.wander is None:
            return values
        return (self.wander if rows is None else self.wander.within(rows)).whiten(values, weight, self.inflation)

    def products(self, weighted: Array, weight: Array) -> Array:
        """Products (k, k) with each other of columns, rows here (k, n), that are weighted by `weight`, whitened."""
        out = weighted @ weighted.T
        return out if self.wander is None else out - self.wander.common(weighted, weight, self.inflation)

    def gather(self, value: Any, first: int = 0, end: int | None = None) -> Array:
        """Stack `value(state)` (n, ...) over the compared samples, of the recordings from `first` to before `end`
        alone."""
        return np.concatenate(
            [
                np.asarray(value(s)).take(rows, axis=0)
                for s, rows in zip(self.states[first:end], self._rows[first:end], strict=True)
                if len(rows)
            ]
        )

    def by_recording(self, values: Array) -> dict[str, tuple[Array, Array]]:
        """Recording -> times [s] and values (m, ...) of its compared samples, of values (n, ...) of all."""
        ends = np.cumsum([len(rows) for rows in self._rows])[:-1]
        parts = np.split(values, ends)
        return {s.trial: (s.time_s[rows], v) for s, rows, v in zip(self.states, self._rows, parts, strict=True)}

    def _strokes(self) -> NDArray[np.int64]:
        out, count = [], 0
        for state in self.states:
            label = np.zeros(len(state.time_s), int)
            for a, b, _ in strokes(state.position):
                label[a:b] = count
                count += 1
            out.append(label)
        return np.concatenate([label[m] for label, m in zip(out, self.masks, strict=True)])
