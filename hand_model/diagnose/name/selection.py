"""Which effects are missing: candidates compete on a balance, by forward and backward selection with joint refits.

Generic: the balance may be a motor's current, a rig's torque or one angle against another; the candidates are whatever
`effects.catalogue(station)` holds. Decided by their evidence on the training recordings; validation recordings are
asked which of a few names it is that training cannot tell apart, and of nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...background import Pair
from ...effects.base import LOST_MOTION
from .balance import Balance, Fit
from .bristles import with_bristles
from .candidates import EVIDENCE_LEAST, allowed, exchanged, rank, settle, twice
from .evidence import evidence, gain, scale_of
from .kept_out import log_likelihood, with_kept_out
from .naming import ALPHA, MANY, Named, Naming, Rival
from .search import deeper, hopeless, lacks, names_of, search
from .shapes import polish, scan
from .tangent import Tangents, turned
from .term import Term
from .wander import Wander, estimate_wander

Array = NDArray[np.float64]

MOST_SEARCHES = 3  # each with noise that knows what did not repeat beside the effects of the one before
SMALL = 0.07  # share of the explained mismatch: less beside a larger effect may be no more than its form being another
# change of the map's slope beside lost motion, from which another search is worth its time
BENT = 0.01
ABSORBED = 0.5  # of a column squared, at most, is left of what is mostly a level per while
GROWN = 1.3  # change of that noise, from which another search is worth its time


def name_effects(
    states: tuple[Any, ...],
    effects: Iterable[Any],
    progress: Callable[[str], None] | None = None,
    typical: Mapping[str, float] | None = None,
    whole: bool = False,
) -> Naming:
    """Name what is missing from the balance of `states` among `effects`; raises nothing for healthy recordings.

    states: DriveStates of one balance, validation recordings marked by `validate`. The lack-of-fit test alone decides
    whether anything is missing; without it no effect is named, however well it fits. typical: declared coefficients of
    the hand's other motors, by name. whole: learn from the validation recordings, too.
    """
    balance = Balance(tuple(states), whole, typical)
    naming = _name(balance, tuple(effects), progress)
    if naming.before.p < ALPHA and not naming.found and any(s.validate for s in states):
        # What happened in a validation recording only cannot be learned from the others.
        naming = _name(Balance(tuple(states), True, typical), tuple(effects), progress)
    if naming.after.p < ALPHA and not balance.steady.all() and len(naming.fit.terms) < MANY:
        # Where starts mislead, steady motion may still be explained; with many names, more is missing.
        calm = _name(balance.settled(), tuple(effects), progress)
        return calm if calm.found and calm.after.p >= ALPHA else naming
    return naming


def _name(balance: Balance, effects: tuple[Any, ...], progress: Callable[[str], None] | None) -> Naming:
    with ExitStack() as pairs:
        return _named(balance, lambda b: pairs.enter_context(Pair(b)), effects, progress)


def _named(
    balance: Balance,
    paired: Callable[[Balance], Pair],
    effects: tuple[Any, ...],
    progress: Callable[[str], None] | None,
) -> Naming:
    wander, other = estimate_wander(balance, balance.fit().prediction), balance
    start: tuple[Term, ...] = ()
    for _ in range(MOST_SEARCHES):
        balance = other.wandering(wander)
        pair = paired(balance.learning())
        learned, brought, ranked = search(pair, effects, progress, start)
        fit = balance.fit(learned.terms)
        wander = _unrepeated(balance, fit)
        lost = hopeless(balance, fit)
        mapped = _remapped(balance, fit)
        other, bristled = with_bristles(mapped, fit)
        same = _alike(wander, balance.wander) and mapped is balance
        if lost or same and other is balance:
            break
        start = bristled.terms if same else ()
    rival = None if lost else _calmed(pair.state, learned, ranked)
    if rival is not None:
        other = balance.wandering(estimate_wander(balance, balance.fit(rival.fit.terms).prediction))
        again, more, _ = search(paired(other.learning()), effects, progress, rival.fit.terms)
        if rival.name in names_of(again) and not twice(other, again):
            balance, brought = other.wandering(_unrepeated(other, other.fit(again.terms))), {**brought, **more}
            pair = paired(balance.learning())
            learned = settle(pair, effects, again.terms)  # beside other chance, another may explain it better
    found = _findings(pair, balance, effects, learned)
    likelier = _outdone(pair, effects, learned, found)
    if likelier is not None:
        learned = likelier
        found = _findings(pair, balance, effects, learned)
    further = None if lost else deeper(pair, balance, effects, progress, learned, found)
    if further is not None:
        learned = further
        found = _findings(pair, balance, effects, learned)
    fit, declared = balance.fit(learned.terms), balance.fit()
    before, after = lacks(balance, declared, fit)
    kept = {t.effect.name for t in fit.terms}
    rejected = tuple(sorted(((n, e) for n, e in brought.items() if n not in kept), key=lambda item: -item[1]))
    return Naming(balance, declared, fit, estimate_wander(balance, fit.prediction), before, after, found, rejected)


def _remapped(balance: Balance, fit: Fit) -> Balance:
    """The balance with the map that it has beside its lost motion, where that is another: the first map took the mean
    of the give up."""
    if not any(t.effect.family == LOST_MOTION for t in fit.terms):
        return balance
    other = balance.remapped(fit)
    before, after = (b.gather(lambda s: s.slope)[b.train] for b in (balance, other))
    return other if np.sqrt(np.mean((after - before) ** 2)) > BENT * np.sqrt(np.mean(before**2)) else balance


def _calmed(balance: Balance, fit: Fit, ranked: Iterable[Rival]) -> Rival | None:
    """The refused candidate that would be taken if what does not repeat were estimated beside it: a slow change of the
    machine looks like chance as long as nobody holds its law against it. The likeliest one; None where there is
    none."""
    if balance.wander is None:
        return None
    chance = _likelihood(balance, fit, balance.wander)
    best, most = None, EVIDENCE_LEAST
    for rival in [*ranked, *_shaped_calmly(balance, fit, ranked)]:
        calmer = estimate_wander(balance, rival.fit.prediction)
        brought = rival.evidence - gain(balance, rival.fit, fit) + _likelihood(balance, rival.fit, calmer) - chance
        if brought >= most:
            best, most = rival, brought
    return best


def _shaped_calmly(balance: Balance, fit: Fit, ranked: Iterable[Rival]) -> list[Rival]:
    """Candidates, and terms in their own place, of which chance levels take the better part, with the shapes that are
    best without such levels: beside them nothing but the stroke in which it happens tells the moment of a jump."""
    if balance.wander is None or not balance.wander.real:
        return []
    calm, out = balance.wandering(None), []
    places = [(fit.terms, r.fit.terms[-1]) for r in ranked]
    places += [(fit.terms[:i] + fit.terms[i + 1 :], term) for i, term in enumerate(fit.terms)]
    for others, term in places:
        start = scan(calm, term.effect, others) if term.shape and _absorbed(balance, term) else None
        if start is not None:
            shaped, reference = polish(calm, start, len(others)), calm.fit(others)
            free = evidence(calm, shaped, reference) - gain(calm, shaped, reference) if others == fit.terms else 0.0
            again = balance.fit(shaped.terms)
            out.append(Rival(term.effect.name, free + gain(balance, again, fit), again))
    return out


def _absorbed(balance: Balance, term: Term) -> bool:
    """Whether chance levels take the better part of a term's column."""
    weight = balance.weight * balance.train
    column = balance.columns(term.effect, term.shape) * weight[:, None]
    return bool(np.sum(balance.whiten(column, weight) ** 2) < ABSORBED * np.sum(column**2))


def _unrepeated(balance: Balance, fit: Fit) -> Wander | None:
    """What does not repeat beside `fit`. An event of one recording is never repeated: it must be likelier than a model
    without it in which the same residual is chance."""
    wander = estimate_wander(balance, fit.prediction)
    for which, term in enumerate(fit.terms):
        if "trial" not in term.shape:
            continue
        rest = balance.fit(tuple(t for i, t in enumerate(fit.terms) if i != which))
        chance = estimate_wander(balance, rest.prediction)
        if chance is None or not chance.real:
            continue
        free = evidence(balance, fit, rest, which) - gain(balance, fit, rest)
        if _likelihood(balance, fit, wander) - _likelihood(balance, rest, chance) + free < EVIDENCE_LEAST:
            wander = chance if wander is None or chance.deviation > wander.deviation else wander
    return wander


def _alike(a: Wander | None, b: Wander | None) -> bool:
    small, large = sorted(0.0 if w is None or not w.real else w.deviation for w in (a, b))
    return large <= GROWN * small


def _likelihood(balance: Balance, fit: Fit, wander: Wander | None) -> float:
    return log_likelihood(balance, fit, wander, balance.weight * balance.train)


def _findings(pair: Pair, every_recording: Balance, effects: tuple[Any, ...], fit: Fit) -> tuple[Named, ...]:
    """Each term with its rivals (every candidate in its place, small terms aside that may stand for one of them), its
    share and its probability; largest share first. pair: of the training recordings of the balance
    `every_recording`."""
    balance, found, terms = pair.state, [], fit.terms
    left = [balance.fit(tuple(t for i, t in enumerate(terms) if i != which)) for which in range(len(terms))]
    losses = [max(rest.rss - fit.rss, 0.0) for rest in left]
    large = [loss >= SMALL * sum(losses) for loss in losses]
    tangents = Tangents.of(balance, fit)
    for which, term in enumerate(terms):
        every = [i for i in range(len(terms)) if i != which]
        others = [i for i in every if large[i] or not large[which]]
        rivals = _in_place(pair, effects, fit, which, others, tangents)
        if rivals[0].name != term.effect.name and others != every:
            own, small = next(r for r in rivals if r.name == term.effect.name), [i for i in every if i not in others]
            brought = sum(max(evidence(balance, fit, left[i], i, scale_of(balance, fit)), 0.0) for i in small)
            if own.evidence + brought > rivals[0].evidence:  # they do not stand for it: together they explain more
                rivals = _in_place(pair, effects, fit, which, every, tangents)
        likeliest, rivals = rivals[0].name, with_kept_out(every_recording, rivals)
        if likeliest == term.effect.name != rivals[0].name and others != every:  # beside all, would they exchange it?
            rivals = with_kept_out(every_recording, _in_place(pair, effects, fit, which, every, tangents))
        weights = np.exp(np.array([r.evidence for r in rivals] + [0.0]) - max(rivals[0].evidence, 0.0))
        mine = [r.name for r in rivals].index(term.effect.name)
        share = losses[which] / max(sum(losses), 1e-12)
        found.append(
            Named(
                term,
                dict(fit.amplitudes[which]),
                tuple(rivals),
                float(share),
                _size(balance, fit, which),
                float(weights[mine] / weights.sum()),
            )
        )
    return tuple(sorted(found, key=lambda f: -f.share))


def _outdone(pair: Pair, effects: tuple[Any, ...], fit: Fit, found: Iterable[Named]) -> Fit | None:
    """The fit with one term exchanged for another effect that turned out likelier in its place, all else refitted; None
    where there is none. While terms are exchanged one at a time only the most promising candidate is looked at closely.
    What recordings kept out have decided, training does not exchange again."""
    balance = pair.state
    for named in found:
        which, best = fit.terms.index(named.term), named.rivals[0]
        if best.name == named.term.effect.name:
            continue
        rest = tuple(t for i, t in enumerate(fit.terms) if i != which)
        likelier = balance.fit((*rest, best.fit.terms[-1]))
        favour = best.kept_out - named.own.kept_out
        other = exchanged(balance, fit, which, balance.fit(rest), likelier, favour)
        if other is not None and allowed(balance, other):
            return other if favour > 0 else settle(pair, effects, other.terms)
    return None


def _in_place(
    pair: Pair, effects: tuple[Any, ...], fit: Fit, which: int, others: Sequence[int], tangents: Tangents
) -> list[Rival]:
    """Every candidate in the place of a term, beside the terms `others` alone, and that term; best evidence first.
    tangents: of the fit."""
    balance, term = pair.state, fit.terms[which]
    rest = tuple(fit.terms[i] for i in others)
    without, alone = balance.fit(rest), balance.fit((*rest, term))
    beside = fit if len(rest) == len(fit.terms) - 1 else alone
    own = evidence(balance, beside, without, which if beside is fit else len(rest), scale_of(balance, beside))
    ranked = rank(pair, effects, rest, without, refine=3)
    same = [r.evidence for r in ranked if r.name == term.effect.name]
    rivals = [r for r in ranked if r.name != term.effect.name] + [Rival(term.effect.name, max([own, *same]), alone)]
    if beside is fit:
        rivals = [*turned(balance, rivals[:-1], rivals[-1], without, tangents, others), rivals[-1]]
    return sorted(rivals, key=lambda r: -r.evidence)


def _size(balance: Balance, fit: Fit, which: int) -> float:
    """Root mean square over the noise of what a term adds beyond what the declared columns could, all coefficients as
    they are."""
    declared = balance.apart(())
    added = balance.whiten((fit.prediction - balance.removed(fit, which)) * declared.weight, declared.weight)
    added = added - declared.basis @ (declared.basis.T @ added)
    return float(np.sqrt(added @ added / max(balance.train.sum(), 1)))
