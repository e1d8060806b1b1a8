"""Rivals beside the terms of a round, tried by two processes: shapes and numbers pass between these, since a candidate's
columns are functions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...background import Pair
from .added import Added
from .candidate import Candidate
from .problem import Problem, Term, extended, held_out, normal
from .refit import moves, refined, refit

Array = NDArray[np.float64]
Shape = Mapping[str, float]


@dataclass(frozen=True)
class Score:
    """A candidate added to the terms so far. error (B,): squared error of every block when left out [normalised];
    parts: its normal equations by block; others: the terms that it is added to, where all shapes have moved for each
    other (None: not yet)."""

    term: Term
    error: Array
    parts: tuple = ()
    others: tuple[Term, ...] | None = None

    def beside(self, terms: tuple[Term, ...]) -> tuple[Term, ...]:
        """All terms with it, where it is added to some."""
        return (*(terms if self.others is None else self.others), self.term)


@dataclass(frozen=True)
class _State:
    """What both processes hold. parts: normal equations of the terms; first: from which of them on shapes move."""

    problem: Problem
    terms: tuple[Term, ...]
    parts: tuple
    rivals: tuple[Candidate, ...]
    first: int


class Beside:
    """Rivals beside terms (parts: the terms' normal equations; first: from which of them on shapes move). Also a context
    manager, which ends the other process."""

    def __init__(
        self, problem: Problem, terms: tuple[Term, ...], parts: tuple, rivals: Iterable[Candidate], first: int
    ) -> None:
        self._pair = Pair(_State(problem, terms, parts, tuple(rivals), first))
        self._places = {id(c): k for k, c in enumerate(self._pair.state.rivals)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *why: object) -> None:
        self._pair.__exit__(*why)

    def scores(self) -> list[Score]:
        """Every rival at the best of its starting shapes, by the training error."""
        rivals = self._pair.state.rivals
        told = self._pair.map(_at_best_start, range(len(rivals)), costs=[float(len(c.grid)) for c in rivals])
        return [Score(Term(c, shape), error, parts) for c, (shape, error, parts) in zip(rivals, told, strict=True)]

    def together(self, scores: Sequence[Score]) -> list[Score]:
        """Scores of rivals in the best of their forms, with all shapes that move fitted beside each other."""
        asked = [s for s in scores if s.others is None]
        told = self._pair.map(_at_best_together, [(self._places[id(s.term.candidate)], s.term.shape) for s in asked])
        done = {}
        for rival, ((*shapes, own), error, parts) in zip(asked, told, strict=True):
            terms = zip(self._pair.state.terms, shapes, strict=True)
            others = tuple(Term(t.candidate, shape) for t, shape in terms)
            done[id(rival)] = Score(Term(rival.term.candidate, own), error, parts, others)
        return [done.get(id(s), s) for s in scores]


def score(problem: Problem, terms: Sequence[Term], candidate: Candidate, parts: tuple) -> Score:
    """The candidate at the best of its starting shapes, by the training error, beside terms with these normal
    equations."""
    errors = Added(problem, terms, candidate, parts).errors(candidate.grid)
    best = Term(candidate, candidate.grid[int(np.argmin(errors))])
    more = extended(problem, terms, best, parts)
    return Score(best, held_out(problem, [*terms, best], more), more)


def _at_best_start(state: _State, place: int) -> tuple[Shape, Array, tuple]:
    found = score(state.problem, state.terms, state.rivals[place], state.parts)
    return found.term.shape, found.error, found.parts


def _at_best_together(state: _State, rival: tuple[int, Shape]) -> tuple[list[Shape], Array, tuple]:
    problem, place, shape = state.problem, *rival
    every = (*state.terms, refined(problem, state.terms, Term(state.rivals[place], shape), state.parts))
    every = refit(problem, every, state.first) if any(moves(t) for t in state.terms[state.first :]) else every
    more = normal(problem, every)
    return [t.shape for t in every], held_out(problem, every, more), more
