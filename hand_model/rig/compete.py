"""Candidates compete by the error on blocks of the recording that they were not fitted to.

Blocks, not samples, because residuals are correlated (Bergmeir & Benitez 2012); the probability that a candidate is
the best is the share of resampled sets of blocks in which it is (Efron's bootstrap). Validation trials are never seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..diagnose.name.balance import DISCRETE
from .balance import Rows
from .candidates import Candidate
from .consistent import consistent
from .declared import DeclaredFit, bounds, prior
from .evidence import BEYOND_DOUBT, weigh
from .solve import solve_bounded
from .states import later

Array = NDArray[np.float64]
FOLDS = 6
FEW = 4  # recordings from which on whole ones are left out
LEAST_SHARE = 0.05  # of the held-out residual variance: less is not worth a name
MOST_TERMS, MOST_OF_FEW = 4, 3  # of few recordings what is left after so many goes by many names
MOST_WEIGHINGS = 8
LEAST_SCALE = 1e-3  # of what the declared model leaves


@dataclass(frozen=True)
class Term:
    """A candidate with its shape."""

    candidate: Candidate
    shape: Mapping[str, float]


Settle = Callable[[tuple[Term, ...]], tuple[tuple[Term, ...], Sequence[Candidate]]]


@dataclass(frozen=True)
class Score:
    """A candidate added to the terms so far. error (B,): squared error of every block when left out [normalised]; parts: its
    normal equations by block."""

    term: Term
    error: Array
    parts: tuple = ()


@dataclass(frozen=True)
class Step:
    """One round of the competition: the winner's probability against none, rivals with theirs, share of variance; equals:
    effects not told from the best; close: which of the rivals these are."""

    probability: float
    rivals: tuple[tuple[str, float], ...]
    gain: float
    equals: tuple[str, ...] = ()
    close: tuple[int, ...] = ()


@dataclass(frozen=True)
class Problem:
    """Training rows cut into blocks. fit: with scale; fold (B,): which fold leaves a block out; group (B,): its recording;
    box: lower and upper bounds, prior mean and weight of the declared parameters (P,) each."""

    fit: DeclaredFit
    rows: tuple[Rows, ...]
    block: tuple[Array, ...]
    fold: Array
    group: Array
    box: tuple[Array, Array, Array, Array]


def pose(fit: DeclaredFit, joint: str | None = None) -> Problem:
    """Cut the training recordings (of one joint, or all) into at least a dozen blocks. Whole recordings are left out where
    there are several, as the validation trials are; else neighbouring blocks go to different folds."""
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


def term_columns(row: Rows, term: Term) -> Array:
    """Filtered, thinned columns (m, j) of a term; none of its own joint's rows are anything but zero elsewhere."""
    width = len(term.candidate.amplitudes)
    if row.joint != term.candidate.joint:
        return np.zeros((len(row.effort), width))
    return row.filtered(term.candidate.columns(row, term.shape)).reshape(len(row.effort), width)


def design(row: Rows, terms: Sequence[Term]) -> Array:
    """Declared columns and those of the terms (m, P + J), each delayed where a term says so."""
    matrix = np.concatenate([row.columns, *(term_columns(row, t) for t in terms)], 1)
    for t in terms:
        if t.candidate.delays and t.candidate.joint == row.joint:
            matrix = later(row.time_s[:: row.step], matrix, t.shape["delay"])
    return matrix


def limits(problem: Problem, terms: Sequence[Term]) -> tuple[Array, Array, Array, Array]:
    """Lower and upper bounds, prior mean and weight of all parameters (P + J,)."""
    low, high, mean, weight = problem.box
    extra = [a for t in terms for a in t.candidate.amplitudes]
    more = np.array([[a[2], a[3]] for a in extra]).reshape(-1, 2)
    zero = np.zeros(len(extra))
    return (np.concatenate([low, more[:, 0]]), np.concatenate([high, more[:, 1]]),
            np.concatenate([mean, zero]), np.concatenate([weight, zero + 1e-12]))  # fmt: skip


def normal(problem: Problem, terms: Sequence[Term]) -> tuple[Array, Array, Array, Array]:
    """Normal equations by block: gram (B, P, P), moment (B, P), square (B,), count (B,)."""
    count, parts = len(problem.fold), None
    for row, block in zip(problem.rows, problem.block, strict=True):
        x = design(row, terms)[row.moving] / problem.fit.scale[row.joint]
        y = row.effort[row.moving] / problem.fit.scale[row.joint]
        if parts is None:
            p = x.shape[1]
            parts = np.zeros((count, p, p)), np.zeros((count, p)), np.zeros(count), np.zeros(count)
        for b, s in _pieces(block[row.moving]):
            parts[0][b] += x[s].T @ x[s]
            parts[1][b] += x[s].T @ y[s]
            parts[2][b] += y[s] @ y[s]
            parts[3][b] += len(y[s])
    return parts


def _pieces(block: Array) -> list[tuple[int, slice]]:
    """Blocks of a row (m,) and where each lies: they follow one another."""
    edges = [0, *(np.flatnonzero(np.diff(block)) + 1), len(block)]
    return [(int(block[a]), slice(a, b)) for a, b in pairwise(edges) if b > a]


def held_out(problem: Problem, terms: Sequence[Term], parts: tuple) -> Array:
    """Squared error (B,) of every block under the fit to the other folds."""
    box, error = limits(problem, terms), np.zeros(len(problem.fold))
    for f in np.unique(problem.fold):
        out = problem.fold == f
        error[out] = _left_out(parts, box, out)
    return error


def _left_out(parts: tuple, box: tuple[Array, Array, Array, Array], out: Array) -> Array:
    """Squared errors of the blocks `out` (B,) bool under the fit to all others."""
    gram, moment, square, _ = parts
    theta = solve_bounded(gram[~out].sum(0), moment[~out].sum(0), *box)
    return np.maximum(square[out] - 2 * moment[out] @ theta + np.einsum("p,bpq,q->b", theta, gram[out], theta), 0.0)


def borne_out(problem: Problem, few: tuple[Sequence[Term], tuple], many: tuple[Sequence[Term], tuple]) -> bool:
    """Whether more terms (with their normal equations each) predict better what took no part in their fit, however the
    training recordings are split (repeated learning and testing, Burman 1989), and by enough to be worth a name."""
    sides = [(parts, limits(problem, terms)) for terms, parts in (few, many)]
    error = np.array([[_left_out(*side, out).sum() for side in sides] for out in splits(problem)])
    return bool(np.mean(error[:, 1] < error[:, 0]) >= BEYOND_DOUBT
                and error[:, 1].sum() < (1 - LEAST_SHARE) * error[:, 0].sum())  # fmt: skip


def splits(problem: Problem) -> list[Array]:
    """Blocks (B,) bool to leave out, split by split: of few recordings each alone and all but each; of a single one its
    halves and thirds, and so of all where one has a parameter of its own, which no other could tell."""
    names, group = np.unique(problem.group, return_inverse=True)
    if len(names) == 1 or _own_parameters(problem):
        part = np.arange(len(group)) % np.bincount(group).max() / np.bincount(group).max()
        return [np.floor(part * k) == i for k in (2, 3) for i in range(k)]
    alone = [group == i for i in range(len(names))]
    return alone if len(names) == 2 else [*alone, *(~a for a in alone)]


def _own_parameters(problem: Problem) -> bool:
    """Whether any declared parameter acts in one of several recordings alone (a level that the laboratory set there)."""
    acts = {t: np.any([np.any(r.columns, 0) for r in problem.rows if r.trial == t], 0) for t in {r.trial for r in problem.rows}}
    return bool(np.any(np.sum(list(acts.values()), 0) == 1))


def training_error(problem: Problem, terms: Sequence[Term], parts: tuple) -> float:
    """Squared error of the fit to all blocks."""
    gram, moment = parts[0].sum(0), parts[1].sum(0)
    theta = solve_bounded(gram, moment, *limits(problem, terms))
    return float(parts[2].sum() - 2 * moment @ theta + theta @ gram @ theta)


def rescaled(problem: Problem, terms: Sequence[Term]) -> Problem:
    """The problem with every joint weighed by what declared parameters and terms leave there, not by what the declared ones
    alone leave: weights and parameters in turn (Gautier & Poignet 2001). Beside a large effect that is not yet known the
    recordings would say less than what was declared, and other joints would have to make up for it."""
    box, sums = limits(problem, terms), []
    for row in problem.rows:
        x, y = design(row, terms)[row.moving], row.effort[row.moving]
        sums.append((row.joint, x.T @ x, x.T @ y, float(y @ y), len(y)))
    scale = dict(problem.fit.scale)
    for _ in range(MOST_WEIGHINGS):
        gram, moment = (sum(s[k] / scale[s[0]] ** 2 for s in sums) for k in (1, 2))
        theta = solve_bounded(gram, moment, *box)
        left: dict[str, list[float]] = {}
        for joint, g, m, square, count in sums:
            left.setdefault(joint, []).append(max(square - 2 * m @ theta + theta @ g @ theta, 0.0) / count)
        last, scale = scale, dict(scale)
        for joint, squares in left.items():
            scale[joint] = max(float(np.sqrt(np.median(squares))), LEAST_SCALE * problem.fit.scale[joint])
        if all(abs(scale[j] - last[j]) < 0.01 * last[j] for j in left):
            break
    return replace(problem, fit=replace(problem.fit, scale=scale))


def solution(problem: Problem, terms: Sequence[Term]) -> Array:
    """All parameters (P + J,) on all training blocks, every joint weighed by what it leaves; bodies are such as can exist."""
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


def _extended(problem: Problem, terms: Sequence[Term], new: Term, parts: tuple) -> tuple:
    """Normal equations with one more term, from those without it: only its own columns are multiplied out."""
    gram, moment, square, count = parts
    p, j = moment.shape[1], len(new.candidate.amplitudes)
    g, m = np.zeros((len(square), p + j, p + j)), np.zeros((len(square), p + j))
    g[:, :p, :p], m[:, :p] = gram, moment
    for row, block in zip(problem.rows, problem.block, strict=True):
        if row.joint != new.candidate.joint:
            continue
        scale = problem.fit.scale[row.joint]
        x, y = _moving_design(problem, row, terms), row.effort[row.moving] / scale
        c = term_columns(row, new)[row.moving] / scale
        for b, s in _pieces(block[row.moving]):
            cross = x[s].T @ c[s]
            g[b, :p, p:] += cross
            g[b, p:, :p] += cross.T
            g[b, p:, p:] += c[s].T @ c[s]
            m[b, p:] += c[s].T @ y[s]
    return g, m, square, count


def _moving_design(problem: Problem, row: Rows, terms: Sequence[Term]) -> Array:
    """The scaled design of a row's moving samples; cached by the caller's round."""
    key = (row.trial, row.joint, tuple((t.candidate.key, tuple(t.shape.items())) for t in terms))
    if key not in _CACHE:
        if len(_CACHE) > 200:
            _CACHE.clear()
        _CACHE[key] = design(row, terms)[row.moving] / problem.fit.scale[row.joint]
    return _CACHE[key]


_CACHE: dict = {}


def score(problem: Problem, terms: Sequence[Term], candidate: Candidate, parts: tuple) -> Score:
    """The candidate at the best of its starting shapes, by the training error."""
    best: tuple[float, Term, tuple] | None = None
    for shape in candidate.grid:
        term = Term(candidate, shape)
        extended = normal(problem, [*terms, term]) if candidate.delays else _extended(problem, terms, term, parts)
        train = training_error(problem, [*terms, term], extended)
        if best is None or train < best[0]:
            best = train, term, extended
    return Score(best[1], held_out(problem, [*terms, best[1]], best[2]), best[2])


def refined(problem: Problem, terms: Sequence[Term], term: Term, parts: tuple) -> Term:
    """The term beside others in the best of its forms, its continuous shapes moved together, by the training error."""

    def train(shape: Mapping[str, float]) -> float:
        moved = Term(term.candidate, shape)
        some = normal(problem, [*terms, moved]) if term.candidate.delays else _extended(problem, terms, moved, parts)
        return training_error(problem, [*terms, moved], some)

    forms: dict[tuple, list[dict[str, float]]] = {}
    for shape in term.candidate.grid:
        forms.setdefault(tuple(v for n, v in shape.items() if n in DISCRETE), []).append(shape)
    starts = [min(grid, key=train) for grid in forms.values()] if len(forms) > 1 else [dict(term.shape)]
    ends = [_descended(train, term.candidate.grid, shape) for shape in starts]
    return Term(term.candidate, min(ends, key=train))


def _descended(train: Callable[[Mapping[str, float]], float], shapes: Sequence[Mapping[str, float]],
               start: Mapping[str, float]) -> Mapping[str, float]:  # fmt: skip
    """The shape of least training error near one of a grid of shapes and within their bounds (Nelder & Mead 1965)."""
    from scipy.optimize import minimize

    grid = {n: np.unique([g[n] for g in shapes]) for n in start if n not in DISCRETE}
    names = [n for n, values in grid.items() if len(values) > 1]
    if not names:
        return start
    low, high = (np.array([grid[n][k] for n in names]) for k in (0, -1))
    at = np.array([start[n] for n in names])

    def shape(x: Array) -> dict[str, float]:
        return {**start, **dict(zip(names, (float(v) for v in np.clip(x, low, high)), strict=True))}

    near = np.array([grid[n][np.argsort(np.abs(grid[n] - x))[1]] for n, x in zip(names, at, strict=True)])
    corners = at + np.concatenate([np.zeros((1, len(names))), np.diag(0.5 * (near - at))])
    begin = train(start)
    found = minimize(lambda x: train(shape(x)), at, method="Nelder-Mead", options={
        "initial_simplex": corners, "maxfev": 15 + 20 * len(names), "xatol": 0, "fatol": 1e-4 * begin})  # fmt: skip
    return shape(found.x) if found.fun < begin else start


def compete(problem: Problem, rivals: Sequence[Candidate], begin: tuple[Term, ...] = (),
            most: int | None = None, settle: Settle | None = None) -> tuple[tuple[Term, ...], tuple[Step, ...], tuple[Score, ...]]:  # fmt: skip
    """Forward selection: the candidate that lowers the held-out error most, while it does so beyond doubt.

    begin: terms that stand already; settle: terms and rivals again, at the loads of a fit with these terms. Returns all terms, the rounds, and the scores of the last round.
    """
    terms, most = begin, most or (MOST_TERMS if left_out_whole(problem) else MOST_OF_FEW)
    steps: list[Step] = []
    scores: list[Score] = []
    while len(terms) < most:
        _CACHE.clear()
        problem = rescaled(problem, terms)
        parts = normal(problem, terms)
        none = held_out(problem, terms, parts)
        taken = {t.candidate.key for t in terms}
        scores = [score(problem, terms, c, parts) for c in rivals if c.repeats or c.key not in taken]
        stand = scores if left_out_whole(problem) else [s for s in scores if borne_out(problem, (terms, parts), ((*terms, s.term), s.parts))]
        found = judge(none, stand, problem)
        if found is None:
            break
        # Between the points of a grid a rival may be better than on them: those not told apart meet again at their best.
        last = [refined(problem, terms, stand[k].term, parts) for k in dict.fromkeys((found[0], *found[1].close))]
        won, step = last[0], found[1]
        if len(last) > 1:
            errors = [Score(t, held_out(problem, (*terms, t), normal(problem, (*terms, t)))) for t in last]
            again = judge(none, errors, problem)
            won, step = (last[again[0]], again[1]) if again is not None else (won, step)
        terms = (*terms, won)
        if settle is not None:
            terms, rivals = settle(terms)
        steps.append(step)
    return terms, tuple(steps), tuple(scores)


def judge(none: Array, scores: Sequence[Score], problem: Problem) -> tuple[int, Step] | None:
    """Index of the winner and what the round says, or None where no candidate beats "nothing" (none (B,)) beyond doubt and by
    enough of its error. Of few recordings the splits have said what is no chance."""
    if not scores:
        return None
    many = left_out_whole(problem)
    said = weigh(none, np.array([s.error for s in scores]), [_size(s.term) for s in scores], problem.group, by_chance=many, worth=LEAST_SHARE)
    if said is None:
        return None
    rivals = tuple((scores[i].term.candidate.key, float(said.wins[i])) for i in np.argsort(-said.wins) if said.wins[i] > 0.005)
    equals = tuple(dict.fromkeys(scores[k].term.candidate.effect for k in said.close))
    return said.chosen, Step(said.probability, rivals, said.gain, equals, said.close)


def _size(term: Term) -> int:
    return len(term.shape) + len(term.candidate.amplitudes)
