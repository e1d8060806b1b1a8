"""Which effects stand at a balance: named, and heard again where a name falls or a recording kept out shows more."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from .candidates import EVIDENCE_LEAST
from .naming import ALPHA, Named, Naming
from .selection import name_effects
from .shapes import priced, refit
from .station import MAIN, UNREST, Station

# times the others are heard again, and the share of what was explained from which a fallen name has displaced others
SECOND_HEARINGS, DISPLACING = 2, 0.1
WORSE = 1.5  # times the mean square of training recordings


def _as_likely(other: Naming, naming: Naming, fallen: frozenset[str]) -> bool:
    """Whether another naming explains the training recordings as well as the names that did not fall: a search without
    those that fell may end with a worse one in the place of one of them."""
    rest = tuple(t for t in naming.fit.terms if t.effect.name not in fallen)
    if {t.effect.name for t in rest} <= {t.effect.name for t in other.fit.terms}:
        return True
    balance = naming.balance.learning()
    kept, heard = (refit(balance, balance.fit(terms)) for terms in (rest, other.fit.terms))
    cost = priced(balance)
    return cost(heard) <= cost(kept)


def _elsewhere(naming: Naming) -> bool:
    """Whether what the training recordings taught fails in those kept out: something happens there that they do not
    have."""
    balance = naming.balance
    square = ((balance.effort - naming.fit.prediction) * balance.weight) ** 2
    inside, outside = balance.steady & balance.train, balance.steady & ~balance.train
    return bool(outside.any() and inside.any() and np.mean(square[outside]) > WORSE * np.mean(square[inside]))


def _altered(naming: Naming) -> bool:
    """Whether a recording kept out is plainly that of a machine with other declared coefficients, as in another pose of
    the hand: what their own fit gains there in log likelihood, less the penalty of Schwarz (1978). A change of level
    alone is spread too thin for tests of cells."""
    balance = naming.balance
    residual, matrix = balance.effort - naming.fit.prediction, balance.gather(lambda s: s.declared)
    recording = balance.gather(lambda s: np.full(len(s.time_s), s.trial))
    outside = balance.steady & ~balance.train
    for name in np.unique(recording[outside]):
        weight = balance.weight * (outside & (recording == name))
        columns, left = (balance.whiten(v, weight) for v in (matrix * weight[:, None], residual * weight))
        own = columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
        count = max(np.count_nonzero(weight) / balance.inflation, 2.0)
        if float(own @ own) / (2 * balance.inflation) - matrix.shape[1] / 2 * np.log(count) > EVIDENCE_LEAST:
            return True
    return False


def _eventful(naming: Naming) -> bool:
    """Whether what one recording had alone is among the names, and others were kept out."""
    return not all(f.term.effect.of_the_hand for f in naming.found) and any(s.validate for s in naming.balance.states)


def _foretold(
    station: Station, states: tuple[Any, ...], effects: tuple[Any, ...], typical: Mapping[str, float] | None
) -> Station | None:
    """The station where no recording is kept out: events of one recording foretell nothing of others, so theirs are
    learned from all, where not all that they have in common need be in each. None where that brings other names."""
    told = tuple(replace(s, validate=False) for s in states)
    for among in (effects, tuple(e.apart() for e in effects)):
        naming = name_effects(told, among, typical=typical)
        other = station.renamed(naming)
        if other.believed and {f.term.effect.name for f in other.kept} <= station.naming.names:
            return other
    return None


def _among_all(
    station: Station, states: tuple[Any, ...], effects: tuple[Any, ...], typical: Mapping[str, float] | None
) -> Station:
    """A motor's station in which nothing is seen, or nothing that has a name, with what all recordings together tell, steady motion bears out and
    those kept out have as well as the others: half of them are too few for what is faint. How late a current is its
    answers to commands tell better; what one recording alone has makes the others no better."""
    learned = name_effects(states, tuple(e for e in effects if not e.warps), typical=typical, whole=True)
    other = station.renamed(learned)
    borne_out = all(other.steadily(f) and _in_both(learned, f) for f in other.proven)
    return other if other.believed and borne_out else station


def _in_both(naming: Naming, named: Named) -> bool:
    """Whether a name learned from all recordings makes those that would be kept out better, and the others."""
    balance, terms = naming.balance, naming.fit.terms
    without = balance.fit(tuple(t for t in terms if t is not named.term))
    left, right = ((balance.effort - f.prediction) * balance.weight for f in (without, naming.fit))
    held = balance.gather(lambda s: np.full(len(s.time_s), s.validate))
    return all(float(np.sum((left**2 - right**2)[part])) > 0 for part in (held, ~held) if part.any())


def judged(
    signal: str,
    finger: str | None,
    actuator: str | None,
    joint: str | None,
    states: tuple[Any, ...],
    effects: Iterable[Any],
    typical: Mapping[str, float] | None = None,
) -> Station:
    """The station of the balance of `states`, named among `effects`. Where a name does not stand, or is another's form,
    the others are heard without it."""
    left = every = tuple(effects)
    station = Station(signal, finger, actuator, joint, name_effects(states, left, typical=typical))
    elsewhere = _elsewhere(station.naming)
    for _ in range(1 if station.many else SECOND_HEARINGS):
        fallen = station.naming.names - {f.term.effect.name for f in station.proven}
        lost = sum(
            f.share for f in station.naming.found if f.term.effect.name in fallen and f.evidence >= EVIDENCE_LEAST
        )
        if lost < DISPLACING or station.naming.overwhelmed:
            break
        left = tuple(e for e in left if e.name not in fallen)
        other = station.renamed(name_effects(states, left, typical=typical))
        if other.weight <= station.weight and lost <= MAIN:
            break  # else what fell had held the better part: what it left over stands on nothing
        if not _as_likely(other.naming, station.naming, fallen):
            break
        station = other
    hopeless = station.naming.overwhelmed and not elsewhere  # in the training recordings already
    many = station.many  # more is missing than is named, whatever is learned from
    if station.missing and not (station.believed or hopeless or many) and _eventful(station.naming):
        station = _foretold(station, states, every, typical) or station
    untold = not (station.believed or many) or elsewhere and station.naming.after.p < ALPHA
    if (station.missing and untold and not hopeless or not station.proven and _altered(station.naming)) and any(
        s.validate for s in states
    ):
        # what the training recordings cannot tell, a pose that one of the others alone has may tell
        lasting = tuple(e for e in every if e.of_the_hand)  # what one recording had explains no other
        learned = name_effects(states, lasting, typical=typical, whole=True)
        before = max(station.naming.before, learned.before, key=attrgetter("excess"))
        other = station.renamed(replace(learned, before=before))
        # another pose is plain to see, whatever small is left
        seen = other.naming.after.p >= ALPHA or _altered(station.naming)
        station = other if seen and other.believed and other.wander <= max(station.wander, UNREST) else station
    unseen = station.naming.before.p >= ALPHA and not any(f.term.effect.listed for f in station.proven)
    if signal == "current" and unseen:
        station = _among_all(station, states, every, typical)
    if station.forms:
        left = tuple(e for e in left if e.name not in {f.term.effect.name for f in station.forms})
        other = station.renamed(name_effects(states, left, typical=typical))
        station = other if other.believed else station
    return station
