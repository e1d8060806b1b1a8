"""Shapes of terms beside each other: the best of their forms, continuous shapes moved until the training error falls no
more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...diagnose.name.term import DISCRETE
from .added import Added
from .candidate import Candidate
from .problem import Problem, Term, normal, training_error

Array = NDArray[np.float64]
ROUNDS = 2  # of all terms in turn
BETTER = 0.999  # of the squared error: no more than rounding would be another form's


def refined(problem: Problem, terms: Sequence[Term], term: Term, parts: tuple) -> Term:
    """The term beside others (with their normal equations) in the best of its forms, its continuous shapes moved
    together."""
    added = Added(problem, terms, term.candidate, parts)
    train = added.error
    forms: dict[tuple, list[dict[str, float]]] = {}
    for shape in term.candidate.grid:
        forms.setdefault(_form(shape), []).append(shape)
    others = [grid for form, grid in forms.items() if form != _form(term.shape)]
    starts = [dict(term.shape), *(grid[int(np.argmin(added.errors(grid)))] for grid in others)]
    ends = [_descended(train, term.candidate, shape) for shape in starts]
    return Term(term.candidate, min(ends, key=train))


def _form(shape: Mapping[str, float]) -> tuple[float, ...]:
    return tuple(float(v) for n, v in sorted(shape.items()) if n in DISCRETE)


def refit(problem: Problem, terms: Sequence[Term], first: int = 0) -> tuple[Term, ...]:
    """The terms, from `first` on, each in the best of its forms and shapes beside all others, in turn."""
    terms = tuple(terms)
    for _ in range(ROUNDS):
        before = terms
        for k, term in list(enumerate(terms))[first:]:
            rest = terms[:k] + terms[k + 1 :]
            terms = (*terms[:k], refined(problem, rest, term, normal(problem, rest)), *terms[k + 1 :])
        if terms == before:
            break
    return terms


def in_other_forms(problem: Problem, terms: Sequence[Term], first: int = 0) -> tuple[Term, ...]:
    """Terms that stand in their best shapes, with one of them in another of its forms where all, moved for that, fit
    better: in the form that suited it before the others came, these make up for the form."""
    best, least = tuple(terms), training_error(problem, terms, normal(problem, terms))
    for k, term in list(enumerate(terms))[first:]:
        forms = {_form(s): s for s in term.candidate.grid if _form(s) != _form(term.shape)}
        for form in forms.values():
            begun = Term(term.candidate, {n: form[n] if n in DISCRETE else v for n, v in term.shape.items()})
            others = refit(problem, (*terms[:k], begun, *terms[k + 1 :]), first)
            error = training_error(problem, others, normal(problem, others))
            if error < BETTER * least:
                best, least = others, error
    return best


def moves(term: Term) -> bool:
    """Whether a term has a shape that is fitted."""
    return bool(_continuous(term.candidate.grid))


def _continuous(shapes: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Values of every continuous shape that a grid varies."""
    grid = {n: np.unique([g[n] for g in shapes]) for n in shapes[0] if n not in DISCRETE}
    return {n: values for n, values in grid.items() if len(values) > 1}


def _descended(
    train: Callable[[Mapping[str, float]], float], candidate: Candidate, start: Mapping[str, float]
) -> Mapping[str, float]:
    """The shape of least training error near one of a candidate's grid, within its bounds or else those of the grid
    (Nelder & Mead 1965)."""
    from scipy.optimize import minimize

    grid = _continuous(candidate.grid)
    names = [n for n in start if n in grid]
    if not names:
        return start
    shapes = candidate.shapes
    ends = [(shapes[n].low, shapes[n].high) if n in shapes else grid[n][[0, -1]] for n in names]
    low, high = np.array(ends).T
    at = np.array([start[n] for n in names])

    def shape(x: Array) -> dict[str, float]:
        return {**start, **dict(zip(names, (float(v) for v in np.clip(x, low, high)), strict=True))}

    near = _next(candidate.grid, start, {n: grid[n] for n in names})
    corners = at + np.concatenate([np.zeros((1, len(names))), np.diag(0.5 * (near - at))])
    begin = train(start)
    found = minimize(
        lambda x: train(shape(x)),
        at,
        method="Nelder-Mead",
        options={"initial_simplex": corners, "maxfev": 15 + 20 * len(names), "xatol": 0, "fatol": 1e-4 * begin},
    )
    return shape(found.x) if found.fun < begin else start


def _next(shapes: Sequence[Mapping[str, float]], start: Mapping[str, float], values: Mapping[str, Array]) -> Array:
    """The next value of each continuous shape along the line of the grid that passes nearest to a start, or of all its
    values where that line has no other."""
    at = np.array([start[n] for n in values])
    points = np.array([[s[n] for n in values] for s in shapes if _form(s) == _form(start)])
    size = np.array([np.ptp(v) for v in values.values()])
    nearest = points[np.argmin(np.sum(((points - at) / size) ** 2, 1))]
    out = at.copy()
    for k, every in enumerate(values.values()):
        line = np.unique(points[np.all(np.delete(points == nearest, k, 1), 1), k])
        line = line if len(line) > 1 else every
        out[k] = line[np.argsort(np.abs(line - at[k]))[1]]
    return out
