"""The search of a balance: effects come and go until no more adds evidence; and from another start, whose valley may lie
deeper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...background import Pair
from .balance import Balance, Fit
from .candidates import least_evidence, rank, settle, twice
from .evidence import oddity, parameter_price, scale_of
from .kept_out import foretold
from .lack_of_fit import LackOfFit, lack_of_fit
from .naming import ALPHA, CLASS_WIDTH, MANY, MOST_TERMS, Named, Rival, overwhelmed
from .shapes import possible
from .term import Term

NEAR = 10.0  # log evidence behind what is named, within which another start is worth a search
STARTS = 2  # of the largest findings, and of the rivals of each
DEEPER = 3.0  # log evidence by which the whole of another search must be likelier: 20 to 1


def search(
    pair: Pair,
    effects: tuple[Any, ...],
    progress: Callable[[str], None] | None,
    start: tuple[Term, ...] = (),
    held: str | None = None,
) -> tuple[Fit, dict[str, float], list[Rival]]:
    """The fit to which no effect adds evidence, what every candidate brought at its best moment, and the last ones
    refused. start: terms to begin with. held: of these, one that stays."""
    balance = pair.state
    fit, brought, ranked = settle(pair, effects, start, held) if start else balance.fit(), {}, list[Rival]()
    been, refused = {names_of(fit)}, set[str]()
    while len(fit.terms) < MOST_TERMS and not hopeless(balance, fit):
        ranked = rank(pair, effects, fit.terms, fit)
        for rival in ranked:
            brought[rival.name] = max(brought.get(rival.name, -np.inf), rival.evidence)
        best = next(
            (r for r in ranked if r.evidence >= least_evidence(balance, len(fit.terms)) and r.name not in refused), None
        )
        if best is None:
            break
        settled = settle(pair, effects, best.fit.terms, held)
        if not _tenable(balance, settled):
            refused.add(best.name)
            continue
        if names_of(settled) in been:  # it went again beside the others: round and round from here
            refused.add(best.name)
            fit = min(fit, settled, key=lambda f: f.rss) if names_of(settled) == names_of(fit) else fit
            continue
        fit = settled
        been.add(names_of(fit))
        if progress is not None:
            progress(f"{balance.states[0].drive}: {', '.join(t.effect.name for t in fit.terms)}")
    return fit, brought, ranked


def _tenable(balance: Balance, fit: Fit) -> bool:
    """Whether a machine may have every term of a fit, and none says what another does."""
    return not twice(balance, fit) and all(possible(balance, fit, i) for i in range(len(fit.terms)))


def names_of(fit: Fit) -> tuple[str, ...]:
    """The effects of a fit, sorted."""
    return tuple(sorted(t.effect.name for t in fit.terms))


def lacks(balance: Balance, declared: Fit, fit: Fit) -> tuple[LackOfFit, LackOfFit]:
    """Lack of fit of the declared model and of another fit, by one yardstick."""
    after = _lack(balance, fit)
    return _lack(balance, declared, after.unrest) if fit.terms else after, after


def _lack(balance: Balance, fit: Fit, calmest: float = np.inf) -> LackOfFit:
    return lack_of_fit(balance, fit.prediction, len(balance.names) + fit.size, ALPHA, calmest)


def hopeless(balance: Balance, fit: Fit) -> bool:
    """Whether so many effects leave a plain mismatch that nothing known is missing."""
    return len(fit.terms) >= MANY and overwhelmed(len(fit.terms), *lacks(balance, balance.fit(), fit))


def deeper(
    pair: Pair,
    every_recording: Balance,
    effects: tuple[Any, ...],
    progress: Callable[[str], None] | None,
    fit: Fit,
    found: Sequence[Named],
) -> Fit | None:
    """A likelier fit, found from another start: a rival near behind one of the largest of `found`, in its place beside
    the larger ones and held there until nothing else comes or goes. What was taken up beside the wrong one stands for
    what that lacks, so that exchanging one term at a time does not get away from it. None where there is none. pair: of
    the training recordings of the balance `every_recording`; those kept out say which of two that these cannot tell
    apart."""
    balance, best = pair.state, None
    for place, named in enumerate(found[:STARTS] if len(found) > 1 else ()):
        larger = tuple(n.term for n in found[:place])
        near = [r for r in named.rivals if named.evidence - NEAR < r.evidence and r.name not in names_of(fit)]
        for rival in near[:STARTS]:
            other, _, _ = search(pair, effects, progress, (*larger, rival.fit.terms[-1]), rival.name)
            ahead = 0.0 if best else DEEPER
            if _tenable(balance, other) and _heard_favour(balance, every_recording, other, best or fit) > ahead:
                best = other
    return best


def _heard_favour(balance: Balance, every_recording: Balance, fit: Fit, other: Fit) -> float:
    """Log evidence of a whole fit over another one, with what recordings kept out say where these cannot tell."""
    brought, kept_out = favour(balance, fit, other), not every_recording.train.all()
    if abs(brought) < CLASS_WIDTH and kept_out and all(t.effect.of_the_hand for f in (fit, other) for t in f.terms):
        mine, theirs = foretold(every_recording, [fit, other])
        brought += mine - theirs
    return brought


def favour(balance: Balance, fit: Fit, other: Fit) -> float:
    """Log evidence of a whole fit over another one (Schwarz 1978), with what machines are like."""
    scale = min(scale_of(balance, fit), scale_of(balance, other))
    cost = [0.5 * (f.rss / scale + parameter_price(balance) * f.size) / balance.inflation for f in (fit, other)]
    return float(cost[1] - cost[0] + oddity(balance, other) - oddity(balance, fit))
