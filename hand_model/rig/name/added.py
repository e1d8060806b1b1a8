"""One more term beside those that stand, in any of its shapes: what does not change with the shape is worked out once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..solve import Nested
from .candidate import Candidate
from .problem import Problem, Term, delay_of, limits, moving_design, normal, training_error

Array = NDArray[np.float64]
AT_ONCE = 32  # shapes whose columns are held at once


class Added:
    """Training error of terms and a candidate beside them. parts: normal equations of the terms, by block."""

    def __init__(self, problem: Problem, terms: Sequence[Term], candidate: Candidate, parts: tuple) -> None:
        self._problem, self._terms, self._candidate = problem, tuple(terms), candidate
        self._gram, self._moment, self._square = parts[0].sum(0), parts[1].sum(0), parts[2].sum()
        box = limits(problem, terms)
        self._nested = Nested(self._gram, self._moment, *box)
        self._rows = [r for r in problem.rows if r.joint == candidate.joint]
        designs = [moving_design(problem, row, terms) for row in self._rows]
        self._unit = problem.fit.scale[candidate.joint] ** 2
        self._used = np.unique(np.concatenate([used for *_, used in designs])) if designs else np.zeros(0, int)
        self._x = np.zeros((sum(len(y) for _, y, _ in designs), len(self._used)))
        self._y = np.concatenate([y for _, y, _ in designs]) if designs else np.zeros(0)
        first = 0
        for x, y, used in designs:
            self._x[first : first + len(y), np.searchsorted(self._used, used)] = x
            first += len(y)
        low, high, _, weight = limits(problem, [*terms, Term(candidate, {})])
        self._box = tuple(side[len(self._moment) :] for side in (low, high, weight))

    def error(self, shape: Mapping[str, float]) -> float:
        """Squared error of the fit of all to all blocks, the candidate having this shape."""
        return self.errors([shape])[0]

    def errors(self, shapes: Sequence[Mapping[str, float]]) -> list[float]:
        """The same of several shapes."""
        if self._candidate.delays:  # it moves all other columns
            every = ([*self._terms, Term(self._candidate, shape)] for shape in shapes)
            return [training_error(self._problem, terms, normal(self._problem, terms)) for terms in every]
        some = (shapes[k : k + AT_ONCE] for k in range(0, len(shapes), AT_ONCE))
        return [self._beside(c) for part in some for c in self._columns(part)]

    def _columns(self, shapes: Sequence[Mapping[str, float]]) -> list[Array]:
        """Filtered columns (m, J) of each shape in all recordings: many pass the filter at once."""
        width = len(self._box[0])
        every = [np.zeros((0, len(shapes) * width))]
        for row in self._rows:
            full = [self._candidate.columns(row, shape).reshape(len(row.time_s), width) for shape in shapes]
            every.append(row.filtered(np.concatenate(full, 1), delay_of(row, self._terms))[row.moving])
        return np.split(np.concatenate(every), len(shapes), axis=1)

    def _beside(self, c: Array) -> float:
        """Squared error of the fit with the candidate's columns (m, J)."""
        cross = np.zeros((len(self._moment), c.shape[1]))
        cross[self._used] = self._x.T @ c / self._unit
        own, moment = c.T @ c / self._unit, c.T @ self._y / self._unit
        theta = self._nested.solve(cross, own, moment, *self._box)
        few, more = theta[: len(self._moment)], theta[len(self._moment) :]
        left = self._square - 2 * self._moment @ few + few @ self._gram @ few
        return float(left + (2 * (few @ cross - moment) + more @ own) @ more)
