"""Candidates compete by the error on blocks of the recording that they were not fitted to.

The probability that a candidate is the best is the share of resampled sets of blocks in which it is (Efron's
bootstrap). Validation trials are never seen.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...diagnose.name.term import DISCRETE
from ..evidence import BEYOND_DOUBT, weigh
from ..laws import ALL_TURNING
from .beside import Beside, Score
from .candidates import LOADED, OFFSET, PRELOADED, STOP, Candidate
from .problem import (
    Problem,
    Term,
    held_out,
    left_out,
    left_out_whole,
    limits,
    normal,
    rescaled,
    training_error,
)
from .refit import in_other_forms, refit

Array = NDArray[np.float64]
LEAST_SHARE = 0.05  # of the held-out residual variance: less is not worth a name
MOST_TERMS, MOST_OF_FEW = 4, 3  # of few recordings what is left after so many goes by many names
TOGETHER = 3  # rivals that meet in their best shapes, beside those of what stands

Settle = Callable[[tuple[Term, ...]], tuple[tuple[Term, ...], Sequence[Candidate]]]


@dataclass(frozen=True)
class Step:
    """One round of the competition: the winner's probability against none, rivals with theirs, share of variance;
    equals:
    effects not told from the best; close: which of the rivals these are."""

    probability: float
    rivals: tuple[tuple[str, float], ...]
    gain: float
    equals: tuple[str, ...] = ()
    close: tuple[int, ...] = ()


def compete(
    problem: Problem,
    rivals: Sequence[Candidate],
    begin: tuple[Term, ...] = (),
    most: int | None = None,
    settle: Settle | None = None,
) -> tuple[tuple[Term, ...], tuple[Step, ...], tuple[Score, ...]]:
    """Forward selection: the candidate that lowers the held-out error most, while it does so beyond doubt.

    begin: terms that stand already; settle: terms and rivals again, at the loads of a fit with these terms. Returns all
    terms, the rounds, and the scores of the last round.
    """
    terms, most = begin, most or (MOST_TERMS if left_out_whole(problem) else MOST_OF_FEW)
    steps: list[Step] = []
    scores: list[Score] = []
    been: set[tuple[str, ...]] = set()
    while len(terms) < most:
        problem = rescaled(problem, terms)
        parts = normal(problem, terms)
        plain = terms, parts, held_out(problem, terms, parts)
        scores, found = _round(problem, plain, terms, rivals, len(begin))
        pair = found is None and bool(scores) and len(terms) == len(begin) and most > len(terms) + 1
        if pair:  # what one leaves may hide it, as a Stribeck rise hides a tight spot: two at once
            lead = min(scores, key=lambda s: s.error.sum())
            found = _round(problem, plain, lead.beside(terms), rivals, len(begin))[1]
        if found is None:
            break
        every, step = found
        terms, kept = _settled_down(problem, every, len(begin), been)
        if pair and not all(kept):  # one of them would have stood alone
            terms = begin
            break
        steps = (
            [replace(step, rivals=(), equals=()), step]
            if pair
            else [s for s, stays in zip((*steps, step), kept, strict=True) if stays]
        )
        been.add(_names(terms))
        if settle is not None:
            terms, kept = _resettled(problem, terms, len(begin), been, settle)
            steps = [s for s, stays in zip(steps, kept, strict=True) if stays]
            been.add(_names(terms))
            terms, rivals = settle(terms)
    return terms, tuple(steps), tuple(scores)


def _round(
    problem: Problem,
    plain: tuple[tuple[Term, ...], tuple, Array],
    terms: tuple[Term, ...],
    rivals: Sequence[Candidate],
    first: int,
) -> tuple[list[Score], tuple[tuple[Term, ...], Step] | None]:
    """Scores of the rivals beside the terms, and all terms with the winner and what the round says, or None where none
    is better than what stands (plain:
    its terms, normal equations and errors (B,)). first: from which on shapes of terms move."""
    standing, its_parts, none = plain
    parts, taken = its_parts if terms is standing else normal(problem, terms), {t.candidate.key for t in terms}
    rivals = [c for c in rivals if (c.repeats or c.key not in taken) and not _said(c, terms)]
    with Beside(problem, terms, parts, rivals, first) as beside:
        scores = _met(problem, terms, beside)
        stand = (
            scores
            if left_out_whole(problem)
            else [s for s in scores if borne_out(problem, (standing, its_parts), (s.beside(terms), s.parts))]
        )
        found = judge(none, stand, problem)
        if found is None:
            return scores, None
        # Between the points of a grid a rival may be better than on them: those not told apart meet again at their best.
        last = beside.together([stand[k] for k in dict.fromkeys((found[0], *found[1].close))])
    again = judge(none, last, problem) if len(last) > 1 else None
    won, step = (0, found[1]) if again is None else again
    return scores, (last[won].beside(terms), step)


def _said(candidate: Candidate, terms: Sequence[Term]) -> bool:
    """Whether a constant effort that a candidate has is a term's at its joint already."""
    constant = {c.joint for t in terms if _constant(c := t.candidate)}
    return _constant(candidate) and candidate.joint in constant


def _constant(candidate: Candidate) -> bool:
    return candidate.effect == OFFSET or candidate.variant == PRELOADED


def _met(problem: Problem, terms: tuple[Term, ...], beside: Beside) -> list[Score]:
    """Scores of the rivals, of those that explain most of what they were fitted to in their best shapes (a detent
    between two places of a grid is half of itself) and with the shapes of the terms moved for them: a shape that has
    moved to take up what a rival is there for hides it (a Stribeck speed that is too high, drag)."""
    scores = beside.scores()
    best = sorted(scores, key=lambda s: training_error(problem, (*terms, s.term), s.parts))[:TOGETHER]
    met = {id(s): m for s, m in zip(best, beside.together(best), strict=True)}
    return [met.get(id(s), s) for s in scores]


def _settled_down(
    problem: Problem, terms: tuple[Term, ...], first: int, been: Collection[tuple[str, ...]]
) -> tuple[tuple[Term, ...], list[bool]]:
    """Terms in their best shapes beside each other, without those from `first` on that no longer pay, and which of
    these stay. been:
    sets of names that stood before, to which there is no way back."""
    stays = [True] * (len(terms) - first)
    while len(terms) - first > 1:
        terms = refit(problem, terms, first)
        terms = in_other_forms(problem, terms, first) if all(stays) else terms
        weak = _superfluous(problem, terms, first)
        if weak is None or _names(rest := terms[:weak] + terms[weak + 1 :]) in been:
            break
        stays[[i for i, s in enumerate(stays) if s][weak - first]] = False
        terms = rest
    return terms, stays


def _resettled(
    problem: Problem, terms: tuple[Term, ...], first: int, been: Collection[tuple[str, ...]], settle: Settle
) -> tuple[tuple[Term, ...], list[bool]]:
    """Terms at their own loads, without what, from `first` on, stood in for the last one alone where friction by load
    is among them: at the loads of those that remain, refitted. Which of these stay."""
    stays = [True] * (len(terms) - first)
    if not any(t.candidate.effect == LOADED for t in terms):  # no loads to settle
        return terms, stays
    terms = settle(terms)[0]
    if len(stays) < 2:
        return terms, stays
    total, loss = held_out(problem, terms, normal(problem, terms)).sum(), {}
    for k in range(first, len(terms) - 1):
        if _names(terms[:k] + terms[k + 1 :]) not in been:
            rest = settle(refit(problem, settle(terms[:k] + terms[k + 1 :])[0], first))[0]
            loss[k] = 1 - total / held_out(problem, rest, normal(problem, rest)).sum(), rest
    weak = min(loss, key=lambda k: loss[k][0], default=None)
    if weak is None or loss[weak][0] >= LEAST_SHARE:
        return terms, stays
    stays[weak - first] = False
    return loss[weak][1], stays


def _superfluous(problem: Problem, terms: tuple[Term, ...], first: int) -> int | None:
    """The term, from `first` on, without which recordings left out are predicted next to as well; None where all pay.
    Friction by load has columns from the loads of a fit with all terms before it: these are in it already, and stay."""
    first = max([first, *(k for k, t in enumerate(terms) if t.candidate.effect == LOADED)])
    total, loss = held_out(problem, terms, normal(problem, terms)).sum(), {}
    for k in range(first, len(terms)):
        rest = terms[:k] + terms[k + 1 :]
        loss[k] = 1 - total / held_out(problem, rest, normal(problem, rest)).sum()
    weak = min(loss, key=lambda k: loss[k])
    return weak if loss[weak] < LEAST_SHARE else None


def _names(terms: Sequence[Term]) -> tuple[str, ...]:
    return tuple(sorted(t.candidate.key for t in terms))


def judge(none: Array, scores: Sequence[Score], problem: Problem) -> tuple[int, Step] | None:
    """Index of the winner and what the round says, or None where no candidate beats "nothing" (none (B,)) beyond doubt
    and by enough of its error. Of few recordings the splits have said what is no chance."""
    able = [k for k, s in enumerate(scores) if not any(_as_good(r, s) for r in scores)]
    if not able:
        return None
    many, some = left_out_whole(problem), [scores[k] for k in able]
    said = weigh(
        none,
        np.array([s.error for s in some]),
        [_size(s.term) for s in some],
        problem.group,
        by_chance=many,
        worth=LEAST_SHARE,
    )
    if said is None:
        return None
    rivals = tuple(
        (some[i].term.candidate.key, float(said.wins[i])) for i in np.argsort(-said.wins) if said.wins[i] > 0.005
    )
    equals = tuple(dict.fromkeys(some[k].term.candidate.effect for k in said.close))
    return able[said.chosen], Step(said.probability, rivals, said.gain, equals, tuple(able[k] for k in said.close))


def _as_good(simple: Score, rich: Score) -> bool:
    """Whether a form of the same effect with fewer parameters leaves so little more that the rest would be worth no
    name of its own; of friction by load with a constant one that turns round with it, also the constant one alone."""
    one, other = simple.term.candidate, rich.term.candidate
    part = other.variant == ALL_TURNING and one.effect == STOP
    return (
        (one.effect == other.effect or part)
        and _size(simple.term) < _size(rich.term)
        and (1 - LEAST_SHARE) * simple.error.sum() <= rich.error.sum()
    )


def _size(term: Term) -> int:
    """Its parameters; which of two forms it has is no more one than which of two variants it is."""
    return len(term.shape.keys() - DISCRETE) + len(term.candidate.amplitudes)


def borne_out(problem: Problem, few: tuple[Sequence[Term], tuple], many: tuple[Sequence[Term], tuple]) -> bool:
    """Whether more terms (with their normal equations each) predict better what took no part in their fit, however the
    training recordings are split (repeated learning and testing, Burman 1989), and by enough to be worth a name."""
    sides = [(parts, limits(problem, terms)) for terms, parts in (few, many)]
    error = np.array([[left_out(*side, out).sum() for side in sides] for out in splits(problem)])
    return bool(
        np.mean(error[:, 1] < error[:, 0]) >= BEYOND_DOUBT and error[:, 1].sum() < (1 - LEAST_SHARE) * error[:, 0].sum()
    )


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
    """Whether any declared parameter acts in one of several recordings alone (a level that the laboratory set
    there)."""
    acts = {
        t: np.any([np.any(r.columns, 0) for r in problem.rows if r.trial == t], 0)
        for t in {r.trial for r in problem.rows}
    }
    return bool(np.any(np.sum(list(acts.values()), 0) == 1))
