"""Candidates beside the effects that are there already: ranked by what they bring, taken up, and exchanged."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...background import Pair
from ...effects.base import least_delay, position_range
from .balance import Balance, Fit
from .evidence import evidence, gain, log_prior, rough_evidence, scale_of
from .naming import Rival
from .shapes import polish, possible, refit, reform, scan
from .term import Term, additive, doubled

EVIDENCE_LEAST = 6.0  # log evidence an effect must bring: e^6 against "none", and against the search over shapes
FAINT = 3.0  # the same of the only one, to be heard: recordings that took no part may bear out the rest
REFUTED = 3.0  # standard deviations by which a delay may miss what answers to commands say
# times as long a refit takes as projecting a column, and a shape that needs refits as one that does not
REFIT, DEARER = 30.0, 4.0
FIRST = 2  # candidates that are looked at closely whatever the others are
FINER = 2.0  # times what a start of a grid brings: more its optimised shape is not expected to


def _resolved(balance: Balance, term: Term) -> bool:
    """Whether a delay exceeds what is told of one and nothing that is known of it refutes it; true of anything else."""
    if "delay" not in term.shape:
        return True
    refuted = balance.unanswered((term,)) > REFUTED**2 * balance.inflation
    return abs(term.shape["delay"]) > least_delay(balance.states) and not refuted


def rank(
    pair: Pair, effects: Iterable[Any], terms: tuple[Term, ...], fit: Fit, refine: int = 6, least: float = 0.0
) -> list[Rival]:
    """Every candidate added to `terms`, its shape optimised from several starts; best evidence first. least: log
    evidence below which none is of interest."""
    balance, taken = pair.state, {t.effect.name for t in terms}
    places = [e if e.name not in taken or e.repeats else None for e in effects]
    costs = [len(balance.grid(e).shapes) * (1.0 if additive(e) else REFIT) for e in effects]
    rough = [r for r in pair.map(_rough, places, terms, fit, least, costs=costs) if r is not None]
    rough.sort(key=lambda item: -item[0])
    out = [(f, closely) for f, closely in _looked_at(pair, rough, fit, refine) if allowed(balance, f)]
    scale = min((scale_of(balance, f) for f, _ in out), default=1.0)
    weights = pair.map(_weight, out, fit, scale)
    rivals = [Rival(f.terms[-1].effect.name, w, f) for (f, _), w in zip(out, weights, strict=True)]
    return sorted(rivals, key=lambda r: -r.evidence)


def _looked_at(pair: Pair, rough: list[tuple[float, Fit]], fit: Fit, refine: int) -> list[tuple[Fit, bool]]:
    """The candidates, and whether they were looked at closely, their shapes optimised: of the `refine` most promising the
    first ones, and those that may pass one of these. rough: evidence and fit of their starts, best first."""
    balance = pair.state
    first = _polished(pair, [start for _, start in rough[: min(refine, FIRST)]], len(fit.terms))
    passed = [_promise(balance, f, fit, scale_of(balance, f)) for f in first if allowed(balance, f)]
    least, left = max(min(passed, default=0.0), 0.0), rough[len(first) :]
    hopeful = [i < refine - len(first) and _hope(balance, *item, fit) > least for i, item in enumerate(left)]
    more = _polished(pair, [start for (_, start), may in zip(left, hopeful, strict=True) if may], len(fit.terms))
    others = [start for (_, start), may in zip(left, hopeful, strict=True) if not may]
    return [*((f, True) for f in (*first, *more)), *((f, False) for f in others)]


def _polished(pair: Pair, starts: list[Fit], which: int) -> list[Fit]:
    costs = [1.0 if additive(s.terms[-1].effect) else DEARER for s in starts]
    return pair.map(polish, starts, which, costs=costs)


def _hope(balance: Balance, rough: float, start: Fit, fit: Fit) -> float:
    """Evidence that a start of this rough evidence may come to where its shape is optimised."""
    return rough + (FINER - 1) * gain(balance, start, fit, scale_of(balance, start))


def _rough(balance: Balance, effect: Any, terms: tuple[Term, ...], fit: Fit, least: float) -> tuple[float, Fit] | None:
    best = None if effect is None else scan(balance, effect, terms, least)
    return None if best is None else (_promise(balance, best, fit, scale_of(balance, best)), best)


def _promise(balance: Balance, fit: Fit, reference: Fit, scale: float) -> float:
    """Rough evidence of a fit's last term, with what else than the balance says the same for sure."""
    term = fit.terms[-1]
    told = term.effect.told_otherwise(balance.states, term.shape)
    return rough_evidence(balance, fit, reference, scale) + (log_prior(fit, -1) if told else 0.0)


def _weight(balance: Balance, candidate: tuple[Fit, bool], fit: Fit, scale: float) -> float:
    return (evidence if candidate[1] else _promise)(balance, candidate[0], fit, scale=scale)


def twice(balance: Balance, fit: Fit) -> bool:
    """Whether a fit has one thing under two names."""
    return doubled(fit.terms, float(np.ptp(position_range(balance.states))))


def allowed(balance: Balance, fit: Fit) -> bool:
    """Whether a fit's last term may stand there: a machine may have it, no other says the same, and nothing that is
    known refutes it."""
    term = fit.terms[-1]
    if not _resolved(balance, term) or twice(balance, fit) or fit.declared.get(term.effect.needs, 1.0) <= 0:
        return False
    return possible(balance, fit, len(fit.terms) - 1)


def settle(pair: Pair, effects: tuple[Any, ...], terms: tuple[Term, ...], held: str | None = None) -> Fit:
    """Joint refit; terms that no longer pay leave; a term that another effect replaces better is exchanged. held: an
    effect that stays."""
    balance = pair.state
    fit = reform(balance, refit(balance, balance.fit(terms)), len(terms) - 1)
    for which in range(len(terms) - 1):
        if not possible(balance, fit, which):  # what came after it says the same, and each makes the other large
            fit = reform(balance, fit, which)
    for _ in range(3):
        dropped = _drop(balance, fit, held)
        if dropped is not None:
            fit = dropped
            continue
        swapped = _swap(pair, effects, fit, held) if len(fit.terms) > 1 else None
        if swapped is None:
            break
        fit = swapped
    return fit


def _drop(balance: Balance, fit: Fit, held: str | None) -> Fit | None:
    """The fit without the term that costs more than it brings; None where every term pays."""
    for which in (i for i, t in enumerate(fit.terms) if t.effect.name != held):
        rest = balance.fit(tuple(t for i, t in enumerate(fit.terms) if i != which))
        if evidence(balance, fit, rest, which, scale_of(balance, fit)) < least_evidence(balance, len(rest.terms)):
            return refit(balance, rest)
    return None


def _swap(pair: Pair, effects: tuple[Any, ...], fit: Fit, held: str | None) -> Fit | None:
    """The best exchange of one term for another effect, where it raises the evidence; else None."""
    balance = pair.state
    for which in (i for i, t in enumerate(fit.terms) if t.effect.name != held):
        rest = tuple(t for i, t in enumerate(fit.terms) if i != which)
        without = balance.fit(rest)
        own = evidence(balance, fit, without, which, scale_of(balance, fit))
        ranked = [r for r in rank(pair, effects, rest, without, 1, own - 10) if r.name != fit.terms[which].effect.name]
        if ranked and ranked[0].evidence > own - 10:
            other = exchanged(balance, fit, which, without, ranked[0].fit)
            if other is not None:
                return other
    return None


def exchanged(balance: Balance, fit: Fit, which: int, without: Fit, other: Fit, favour: float = 0.0) -> Fit | None:
    """A fit with another effect, its last, in the place of the term `which`, all refitted, where that is likelier by more
    than a unit of chance; else None. without: the fit of the other terms alone. favour: log evidence that the other one
    has from recordings kept out, which are asked once."""
    other = refit(balance, other)
    scale = min(scale_of(balance, other), scale_of(balance, fit))
    brought = evidence(balance, other, without, scale=scale) + favour
    own, chance = evidence(balance, fit, without, which, scale), 0.0 if favour > 0 else 1.0
    return other if brought > own + chance else None


def least_evidence(balance: Balance, others: int) -> float:
    """Log evidence that an effect must bring beside so many others."""
    restless = balance.wander is not None and balance.wander.real
    return EVIDENCE_LEAST if others or restless or not balance.untouched else FAINT
