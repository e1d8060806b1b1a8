"""The regression that candidates compete in: rows cut into blocks, terms beside the declared columns, errors of blocks
left out.

Blocks, not samples, because residuals are correlated (Bergmeir & Benitez 2012).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..balance import Rows
from ..consistent import consistent
from ..declared import DeclaredFit, bounds, prior
from ..solve import solve_bounded, squared_error, sums_of
from .candidate import Candidate

Array = NDArray[np.float64]
FOLDS = 6
FEW = 4  # recordings from which on whole ones are left out
MOST_WEIGHINGS = 8
LEAST_SCALE = 1e-3  # of what the declared model leaves
MOST_DESIGNS = 200  # that are kept


@dataclass(frozen=True)
class Term:
    """A candidate with its shape."""

    candidate: Candidate
    shape: Mapping[str, float]


@dataclass(frozen=True)
class Problem:
    """Training rows cut into blocks. fit: with scale; fold (B,): which fold leaves a block out; group (B,): its
    recording;
    box: lower and upper bounds, prior mean and weight of the declared parameters (P,) each; designs: kept to save
    time."""

    fit: DeclaredFit
    rows: tuple[Rows, ...]
    block: tuple[Array, ...]
    fold: Array
    group: Array
    box: tuple[Array, Array, Array, Array]
    designs: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)


def pose(fit: DeclaredFit, joint: str | None = None) -> Problem:
    """Cut the training recordings (of one joint, or all) into at least a dozen blocks. Whole recordings are left out
    where there are several, as the validation trials are; else neighbouring blocks go to different folds."""
    rows = tuple(r for r in fit.rows if not r.validate and joint in (None, r.joint) and r.moving.sum() > 10)
    trials = list(dict.fromkeys(r.trial for r in rows))
    each = int(np.clip(np.ceil(18 / max(len(trials), 1)), 2, 18))
    block, first = [], {t: k * each for k, t in enumerate(trials)}
    for r in rows:
        n = len(r.effort)
        block.append(first[r.trial] + np.minimum(np.arange(n) * each // n, each - 1))
    count = each * len(trials)
    group = np.arange(count) // each
    fold = group % FOLDS if len(trials) >= FEW else np.arange(count) % min(FOLDS, count)
    return Problem(fit, rows, tuple(block), fold, group, (*bounds(fit.columns), *prior(fit.columns, fit.anchored)))


def left_out_whole(problem: Problem) -> bool:
    """Whether the folds leave out whole recordings."""
    return len(set(problem.group.tolist())) >= FEW


def term_columns(row: Rows, term: Term, delay_s: float = 0.0) -> Array:
    """Filtered, thinned columns (m, j) of a term, later by a delay; none of its own joint's rows are anything but zero
    elsewhere."""
    width = len(term.candidate.amplitudes)
    if row.joint != term.candidate.joint:
        return np.zeros((len(row.effort), width))
    return row.filtered(term.candidate.columns(row, term.shape), delay_s).reshape(len(row.effort), width)


def design(row: Rows, terms: Sequence[Term]) -> Array:
    """Declared columns and those of the terms (m, P + J), each delayed where a term says so."""
    delay = delay_of(row, terms)
    declared = row.columns
    if delay:
        declared = np.zeros(row.columns.shape)
        declared[:, row.used] = row.filtered(row.full_columns[:, row.used], delay)
    return np.concatenate([declared, *(term_columns(row, t, delay) for t in terms)], 1)


def delay_of(row: Rows, terms: Sequence[Term]) -> float:
    """How much later [s] the terms make a row's columns."""
    return sum(t.shape["delay"] for t in terms if t.candidate.delays and t.candidate.joint == row.joint)


def limits(problem: Problem, terms: Sequence[Term]) -> tuple[Array, Array, Array, Array]:
    """Lower and upper bounds, prior mean and weight of all parameters (P + J,)."""
    low, high, mean, weight = problem.box
    extra = [a for t in terms for a in t.candidate.amplitudes]
    more = np.array([[a[2], a[3]] for a in extra]).reshape(-1, 2)
    zero = np.zeros(len(extra))
    return (
        np.concatenate([low, more[:, 0]]),
        np.concatenate([high, more[:, 1]]),
        np.concatenate([mean, zero]),
        np.concatenate([weight, zero + 1e-12]),
    )


def amplitudes(fit: DeclaredFit, terms: Sequence[Term], theta: Array) -> list[Array]:
    """Of a solution theta (P + J,), or of many (..., P + J), what is each term's."""
    ends = len(fit.columns) + np.cumsum([0, *(len(t.candidate.amplitudes) for t in terms)])
    return [theta[..., a:b] for a, b in pairwise(ends)]


def normal(problem: Problem, terms: Sequence[Term]) -> tuple[Array, Array, Array, Array]:
    """Normal equations by block: gram (B, P, P), moment (B, P), square (B,), count (B,)."""
    count, width = len(problem.fold), len(problem.fit.columns) + sum(len(t.candidate.amplitudes) for t in terms)
    parts = np.zeros((count, width, width)), np.zeros((count, width)), np.zeros(count), np.zeros(count)
    for row, block in zip(problem.rows, problem.block, strict=True):
        (x, y, used), unit = moving_design(problem, row, terms), problem.fit.scale[row.joint] ** 2
        for b, s in _pieces(block[row.moving]):
            *sums, number = sums_of(x[s], y[s], used, width)
            for part, of_block in zip(parts, (*(v / unit for v in sums), number), strict=True):
                part[b] += of_block
    return parts


def extended(problem: Problem, terms: Sequence[Term], new: Term, parts: tuple) -> tuple:
    """Normal equations with one more term, from those without it: only its own columns are multiplied out, where it
    moves no others."""
    if new.candidate.delays:
        return normal(problem, [*terms, new])
    gram, moment, square, count = parts
    p, j = moment.shape[1], len(new.candidate.amplitudes)
    g, m = np.zeros((len(square), p + j, p + j)), np.zeros((len(square), p + j))
    g[:, :p, :p], m[:, :p] = gram, moment
    for row, block in zip(problem.rows, problem.block, strict=True):
        if row.joint != new.candidate.joint:
            continue
        (x, y, used), unit = moving_design(problem, row, terms), problem.fit.scale[row.joint] ** 2
        c = term_columns(row, new, delay_of(row, terms))[row.moving]
        for b, s in _pieces(block[row.moving]):
            cross = x[s].T @ c[s] / unit
            g[b, used, p:] += cross
            g[b, p:, used] += cross
            g[b, p:, p:] += c[s].T @ c[s] / unit
            m[b, p:] += c[s].T @ y[s] / unit
    return g, m, square, count


def moving_design(problem: Problem, row: Rows, terms: Sequence[Term]) -> tuple[Array, Array, NDArray[np.int64]]:
    """The design (m, k) and effort (m,) of a row's moving samples, and which of all columns (k,) these are: those that
    are not zero throughout. Kept with the problem."""
    key = (row.trial, row.joint, tuple((id(t.candidate), *t.shape.items()) for t in terms))
    if key not in problem.designs:
        if len(problem.designs) > MOST_DESIGNS:
            problem.designs.clear()
        every = design(row, terms)
        used = np.append(row.used, np.arange(row.columns.shape[1], every.shape[1]))
        x = np.ascontiguousarray(every[:, used][row.moving])
        problem.designs[key] = [t.candidate for t in terms], (x, row.effort[row.moving], used)
    return problem.designs[key][1]


def _pieces(block: Array) -> list[tuple[int, slice]]:
    """Blocks of a row (m,) and where each lies: they follow one another."""
    edges = [0, *(np.flatnonzero(np.diff(block)) + 1), len(block)]
    return [(int(block[a]), slice(a, b)) for a, b in pairwise(edges) if b > a]


def held_out(problem: Problem, terms: Sequence[Term], parts: tuple) -> Array:
    """Squared error (B,) of every block under the fit to the other folds."""
    box, error = limits(problem, terms), np.zeros(len(problem.fold))
    for f in np.unique(problem.fold):
        out = problem.fold == f
        error[out] = left_out(parts, box, out)
    return error


def left_out(parts: tuple, box: tuple[Array, Array, Array, Array], out: Array) -> Array:
    """Squared errors of the blocks `out` (B,) bool under the fit to all others."""
    gram, moment, square, _ = parts
    theta = solve_bounded(gram[~out].sum(0), moment[~out].sum(0), *box)
    return np.maximum(square[out] - 2 * moment[out] @ theta + np.einsum("p,bpq,q->b", theta, gram[out], theta), 0.0)


def training_error(problem: Problem, terms: Sequence[Term], parts: tuple) -> float:
    """Squared error of the fit to all blocks."""
    gram, moment = parts[0].sum(0), parts[1].sum(0)
    theta = solve_bounded(gram, moment, *limits(problem, terms))
    return squared_error(gram, moment, parts[2].sum(), theta)


def rescaled(problem: Problem, terms: Sequence[Term]) -> Problem:
    """The problem with every joint weighed by what declared parameters and terms leave there, not by what the declared
    ones alone leave: weights and parameters in turn (Gautier & Poignet 2001). Beside a large effect that is not yet
    known the recordings would say less than what was declared, and other joints would have to make up for it."""
    box, sums = limits(problem, terms), []
    for row in problem.rows:
        sums.append((row.joint, *sums_of(*moving_design(problem, row, terms), len(box[0]))))
    scale = dict(problem.fit.scale)
    for _ in range(MOST_WEIGHINGS):
        gram, moment = (sum(s[k] / scale[s[0]] ** 2 for s in sums) for k in (1, 2))
        theta = solve_bounded(gram, moment, *box)
        left: dict[str, list[float]] = {}
        for joint, g, m, square, count in sums:
            left.setdefault(joint, []).append(max(squared_error(g, m, square, theta), 0.0) / count)
        last, scale = scale, dict(scale)
        for joint, squares in left.items():
            scale[joint] = max(float(np.sqrt(np.median(squares))), LEAST_SCALE * problem.fit.scale[joint])
        if all(abs(scale[j] - last[j]) < 0.01 * last[j] for j in left):
            break
    return replace(problem, fit=replace(problem.fit, scale=scale))


def solution(problem: Problem, terms: Sequence[Term]) -> Array:
    """All parameters (P + J,) on all training blocks, every joint weighed by what it leaves; bodies are such as can
    exist."""
    problem = rescaled(problem, terms)
    gram, moment, _, _ = normal(problem, terms)
    sums, box, fit = (gram.sum(0), moment.sum(0)), limits(problem, terms), problem.fit
    theta = solve_bounded(*sums, *box)
    return consistent(fit.columns, fit.bodies, theta, *sums, *box) if len(fit.bodies) else theta


def resampled(problem: Problem, terms: Sequence[Term], draws: int = 200) -> Array:
    """All parameters (draws, P + J) on resampled sets of training blocks (block bootstrap, Kuensch 1989)."""
    problem = rescaled(problem, terms)
    gram, moment, _, _ = normal(problem, terms)
    box = limits(problem, terms)
    pick = np.random.default_rng(0).integers(0, len(gram), (draws, len(gram)))
    return np.array([solve_bounded(gram[k].sum(0), moment[k].sum(0), *box) for k in pick])
