"""A weight on a hand that never turns: its drive's preload is odd and its spring bent, and a weight explains both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import effect
from ..effects.base import DriveState
from ..session import Session
from .findings import UNWRITTEN, Finding
from .locate.angles import FingerAngles
from .locate.gravity import in_one_pose
from .locate.preload import SPRING, preload_findings, usual_spring
from .name.balance import Balance, Fit
from .name.candidates import EVIDENCE_LEAST
from .name.judgement import judged
from .name.least_squares import from_products
from .name.naming import CLASS_WIDTH
from .name.station import Station
from .name.term import Term, reshaped

Array = NDArray[np.float64]

BENT, WEIGHT = "nonlinear_spring", "gravity_load"
BENDING = (BENT, "detent_load", "end_stop_contact")  # names that may be a weight's bend
PULL = "weight"  # declared column of a weight that is known to be there
LOPSIDED = 0.9  # of friction, at most, is lacking in one direction
HELD = "the declared preload and spring hold what these recordings show of it: the hand never turned"
FLAT = 1e3  # standard deviations of the effort: of a coefficient of which nothing is known


def with_weights(
    session: Session, fingers: Mapping[str, FingerAngles], stations: Sequence[Station], calls: Sequence[tuple[Any, ...]]
) -> tuple[list[Station], list[tuple[float, Finding]]]:
    """The stations, those of drives on which a weight pulls judged anew, and odd preloads (with their weight), those
    that are a weight's named so.

    calls: what `judged` was given for each drive's current. Two effects in one drive must together be likelier than the
    one that explains both by as much as any further effect must bring.
    """
    out, weights, pulled = list(stations), list[tuple[float, Finding]](), set[str]()
    odd = {f.where["actuator"]: (size, f) for size, f in preload_findings(stations)}
    bent = [s.actuator for s in stations if s.signal == "current" and s.standing(BENT) is not None]
    for actuator in dict.fromkeys([*odd, *bent]):
        at = next(i for i, s in enumerate(out) if s.signal == "current" and s.actuator == actuator)
        call = next(c for c in calls if c[2] == actuator)
        states = in_one_pose(session, fingers, call[4])
        if states is None or "sweep" not in states[0].extra:
            continue
        usual = _usual([s for s in out if s.actuator not in pulled], out[at])
        pull = None if usual is None else _pulled(usual, out[at], states, actuator in odd)
        other = None if pull is None else _named(call, states, out[at])
        if pull is None or other is None and actuator not in odd:
            continue
        pulled.add(actuator)
        if other is None:
            if any(out[at].standing(name) is not None for name in BENDING):
                # a bend of the spring that a weight explains is none beside it
                out[at], pull = _beside(
                    call, states, pull, out[at], partial(_weighed, usual, out[at].naming.balance, states)
                )
            size, finding = odd[actuator]
            weights.append((size, _finding(finding, pull, _sweep(states[0]))))
        else:
            out[at] = _beside_usual(other, usual)
    # what a weight leaves of a drive's preload says nothing of the others'
    return out, [*weights, *preload_findings([s for s in out if s.actuator not in pulled])]


def _named(call: tuple[Any, ...], states: tuple[DriveState, ...], station: Station) -> Station | None:
    """The drive with a weight named in place of its bent spring; None where that does not stand."""
    bent = station.standing(BENT)
    if bent is None:
        return None
    other = judged(*call[:4], states, [e for e in call[5] if e.name != BENT], *call[6:])
    weight = other.standing(WEIGHT)
    return other if weight is not None and weight.evidence > bent.evidence - EVIDENCE_LEAST else None


@dataclass(frozen=True)
class Pull:
    """A weight along the finger and across it (2,), its covariance (2, 2) and its probability. alone: the weight without
    a bent spring, where this one is beside such a spring."""

    weight: Array
    covariance: Array
    probability: float
    alone: Pull | None = None

    @classmethod
    def of(cls, weighed: _Model, probability: float, alone: Pull | None = None) -> Pull:
        """The weight among the coefficients of a model, where it comes last."""
        return cls(weighed.mean[-2:], weighed.covariance[-2:, -2:], probability, alone)


def _beside(
    call: tuple[Any, ...],
    states: tuple[DriveState, ...],
    pull: Pull,
    station: Station,
    weighed: Callable[[tuple[Term, ...], NDArray[np.bool_]], _Model],
) -> tuple[Station, Pull]:
    """The drive judged beside a weight, and that weight: of one that needs a bent spring the one without, unless what is
    named beside that spring is then likelier by what any further effect must bring. The station as it was, where what
    it names is likelier beside the weight than what is named in its place.

    weighed: a weight beside terms, of some samples.
    """

    def heard(weight: Pull) -> Station:
        effects = [e for e in call[5] if e.name != BENT or weight.alone is not None]
        return judged(*call[:4], tuple(_declaring(s, weight.weight) for s in states), effects, *call[6:])

    found = heard(pull)

    def likelier(one: Station, other: Station) -> float:
        """Log evidence of what one names over what the other does, on the samples that neither clips."""
        both = [s.naming.fit.terms for s in (one, other)]
        inside = found.naming.balance.unclipped(both[0]) & found.naming.balance.unclipped(both[1])
        first, second = (weighed(terms, inside).log_evidence for terms in both)
        return first - second

    if pull.alone is None:
        spared = EVIDENCE_LEAST * (len(station.naming.fit.terms) - len(found.naming.fit.terms))
        return (station if likelier(station, found) > spared else found), pull
    other = heard(pull.alone)
    return (other, pull.alone) if other.believed and likelier(found, other) < EVIDENCE_LEAST else (found, pull)


Usual = Mapping[str, tuple[float, float]]  # declared coefficient -> what to expect of it, and how surely


def _usual(stations: Sequence[Station], station: Station) -> Usual | None:
    """What the hand's other drives let expect of a drive's preload and spring; None where they do not say both."""
    known = usual_spring(stations, station)
    return known if len(known) == len(SPRING) else None


def _pulled(usual: Usual, station: Station, states: tuple[DriveState, ...], odd_preload: bool) -> Pull | None:
    """The weight, where one beside a usual preload is likelier than an odd one (and what bends the spring, if that was
    named), or, where no preload is odd, plainly likelier than what bends the spring; None else.

    Marginal likelihoods of linear models with normal priors, where the preload and the spring of the weighed drive are
    those of the hand's others: an odd preload alone says nothing of the spring's shape, a weight foretells it.
    """
    balance = station.naming.balance
    terms = station.naming.fit.terms
    plain = tuple(t for t in terms if t.effect.name != BENT)
    inside = balance.unclipped(terms)
    others = {"spring": usual["spring"], "preload": (0.0, _size(balance))} if odd_preload else usual
    # two effects together are not given a choice
    odd = (_Model if odd_preload else _either)(balance, terms, inside, others)
    weighed = _weighed(usual, balance, states, plain, inside)
    spared = EVIDENCE_LEAST if len(plain) < len(terms) else 0.0  # one effect for two
    likelier = weighed.log_evidence - odd.log_evidence + (spared if odd_preload else -CLASS_WIDTH)
    alone = None
    if odd_preload and _impossible(odd, *usual["preload"]):
        # with the lowest preload that there may be, as sure as the usual one is: that is not what was recorded
        lowest = _lowest(odd, usual["preload"][0]), usual["preload"][1]
        odd = _Model(balance, terms, inside, {**others, "preload": lowest})
        likelier = weighed.log_evidence - odd.log_evidence + spared
        both = _weighed(usual, balance, states, terms, inside) if spared else weighed
        if both.log_evidence > weighed.log_evidence + spared:
            alone, weighed, likelier = weighed, both, both.log_evidence - odd.log_evidence
        likelier += CLASS_WIDTH + EVIDENCE_LEAST
    largest = {"largest": float(np.hypot(*weighed.mean[-2:]))}
    if likelier <= 0 or not effect(WEIGHT).possible(states, largest):
        return None
    probability = float(1 / (1 + np.exp(-likelier)))
    return Pull.of(weighed, probability, None if alone is None else Pull.of(alone, probability))


def _weighed(
    usual: Usual,
    balance: Balance,
    states: tuple[DriveState, ...],
    terms: tuple[Term, ...],
    inside: NDArray[np.bool_],
) -> _Model:
    """The terms and a weight as `states` have it, preload and spring as usual, of the samples `inside`."""
    posed = {s.trial: s for s in states}
    return _Model(balance, terms, inside, usual, balance.gather(lambda s: _weight(posed[s.trial])))


def _either(
    balance: Balance, terms: tuple[Term, ...], inside: NDArray[np.bool_], priors: Mapping[str, tuple[float, float]]
) -> _Model:
    """The likelier one of two models: a bent spring is usual as a whole, or where it begins."""
    both = [_Model(balance, terms, inside, priors, chords=chords) for chords in (True, False)]
    return max(both, key=lambda m: m.log_evidence)


def _size(balance: Balance) -> float:
    """Standard deviation of the effort of training recordings."""
    return float(np.std(balance.effort[balance.train]))


def _impossible(odd: _Model, usual: float, doubt: float) -> bool:
    """Whether no odd preload is as low as the one found, for sure: a spring pulls, and friction that is lopsided takes
    at most as much off a usual preload as there is of it, for it never quite vanishes in one direction."""
    preload = odd.names.index("preload")
    surely = odd.mean[preload] + 2 * np.hypot(np.sqrt(odd.covariance[preload, preload]), doubt)
    return bool(surely < _lowest(odd, usual))


def _lowest(odd: _Model, usual: float) -> float:
    """The lowest preload that may be read where there is a usual one."""
    return min(0.0, usual - LOPSIDED * float(odd.mean[odd.names.index("coulomb")]))


class _Model:
    """Declared columns and terms of a balance, and further columns (n, k), as a linear model with normal priors, of the
    samples `inside`.

    priors: coefficient -> mean and standard deviation; of the others nothing is known, the terms are of the effort's size, and
    the further ones, of a weight, no more than the drive can lift in any pose, however little of it this one shows.
    chords: whether those of preload and spring are of a bent spring as a whole, else of its tangent where it begins.
    mean, covariance: of the coefficients (m,), (m, m); possible: their mode (m,) within what physics allows.
    """

    def __init__(
        self,
        balance: Balance,
        terms: tuple[Term, ...],
        inside: NDArray[np.bool_],
        priors: Mapping[str, tuple[float, float]],
        further: Array | None = None,
        chords: bool = True,
    ) -> None:
        matrix, low, high = balance.design(terms)
        matrix = _from_chords(balance, terms, matrix) if chords else matrix
        if further is not None:
            matrix = np.c_[matrix, further]
            unbounded = np.full(further.shape[1], np.inf)
            low, high = np.r_[low, -unbounded], np.r_[high, unbounded]
        self.names = balance.names
        size = np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-12)
        mean, deviation = np.zeros(len(size)), _size(balance) / size
        deviation[: len(balance.names)] *= FLAT
        if further is not None:
            deviation[-further.shape[1] :] = 0.5 * np.max(np.abs(balance.effort[balance.train]))
        for name, (value, doubt) in priors.items():
            at = balance.names.index(name)
            mean[at], deviation[at] = value, doubt
        w = balance.weights(terms) * balance.train * inside
        columns, left = (
            balance.whiten(v, w) / np.sqrt(balance.inflation) for v in (matrix * w[:, None], balance.effort * w)
        )
        # in units of the priors' standard deviations, about their means
        columns, left = columns * deviation, left - columns @ mean
        precision = columns.T @ columns + np.eye(len(size))
        found = np.linalg.solve(precision, columns.T @ left)
        possible = from_products(precision, columns.T @ left, (low - mean) / deviation, (high - mean) / deviation)
        # at the mode within what physics allows: what a coefficient says beyond it speaks for nothing
        explained = (columns.T @ left) @ possible - 0.5 * possible @ precision @ possible
        self.log_evidence = float(explained - 0.5 * left @ left - 0.5 * np.linalg.slogdet(precision)[1])
        self.mean, self.possible = mean + deviation * found, mean + deviation * possible
        self.covariance = np.linalg.inv(precision) * np.outer(deviation, deviation)


def _from_chords(balance: Balance, terms: tuple[Term, ...], design: Array) -> Array:
    """The design (n, k) of terms, each column of a bent spring taken from the line between its ends: what is usual of
    preload and stiffness is so of the whole spring then."""
    position = balance.gather(lambda s: s.position)
    low, high = int(np.argmin(position)), int(np.argmax(position))
    way = (position - position[low]) / max(position[high] - position[low], 1e-12)
    out, at = design.copy(), len(balance.names)
    for term in terms:
        own = slice(at, at + len(term.effect.amplitudes()))
        if term.effect.name == BENT:
            out[:, own] -= design[low, own] + way[:, None] * (design[high, own] - design[low, own])
        at = own.stop
    return out


def _beside_usual(station: Station, usual: Usual) -> Station:
    """The station of a drive of which a weight is named, its sizes read where preload and spring are those of the
    hand's other drives: alone it hardly tells a weight's part in them."""
    balance, fit = station.reading.balance, station.reading.fit
    at = next((i for i, t in enumerate(fit.terms) if t.effect.name == WEIGHT), None)
    if at is None:
        return station
    rest = (*fit.terms[:at], *fit.terms[at + 1 :])
    columns, weights = balance.design(rest)[0], balance.gather(_weight)
    model = _Model(balance, rest, balance.unclipped(rest), usual, weights)
    sweep, values = _sweep(balance.states[0]), iter(model.possible.tolist())
    declared = {name: next(values) for name in balance.names}
    amplitudes = [{name: next(values) for name in a} for i, a in enumerate(fit.amplitudes) if i != at]
    own = dict(zip(fit.amplitudes[at], (*values, 0.0, 0.0), strict=True))
    prediction = np.c_[columns, weights] @ model.possible
    for term in rest:
        prediction = term.effect.clip(prediction, term.shape) if term.effect.clips else prediction
    w = balance.weights(rest) * balance.train
    read = Fit(
        reshaped(fit.terms, at, {"sweep": sweep}),
        declared,
        (*amplitudes[:at], own, *amplitudes[at:]),
        prediction,
        float(np.sum(balance.whiten((balance.effort - prediction) * w, w) ** 2)),
        fit.size,
    )
    out = copy(station)
    out.beside, out.compared = partial(_beside_usual, usual=usual), (WEIGHT,)
    out.reading = replace(station.reading, fit=read)
    figures = _figures(model.possible[-2:], model.covariance[-2:, -2:], sweep, balance.states[0].effort_unit)
    out.parameters = {**station.parameters, at: figures}
    return out


def _sweep(state: DriveState) -> float:
    """Angle [rad] that the finger's first joint turns through over the range of positions."""
    return float(state.extra["sweep"][0, 0])


def _weight(state: DriveState) -> Array:
    """What a unit weight along the finger and across it does, (n, 2)."""
    return effect(WEIGHT).columns(state, {"sweep": _sweep(state)})[:, :2]


def _declaring(state: DriveState, weight: Array) -> DriveState:
    """The state with a weight (2,) that pulls as this one does among what is declared."""
    return replace(
        state,
        declared=np.c_[state.declared, _weight(state) @ weight],
        declared_names=(*state.declared_names, PULL),
    )


def _finding(odd: Finding, pull: Pull, sweep: float) -> Finding:
    """The finding of an odd preload, as a weight's."""
    parameters = _figures(pull.weight, pull.covariance, sweep, odd.parameters["half_difference"]["unit"])
    text = effect(WEIGHT).statement(odd.where, {name: entry["value"] for name, entry in parameters.items()})
    members = (WEIGHT, *odd.members) if pull.probability < 0.95 else (WEIGHT,)
    return replace(
        odd,
        effect=WEIGHT,
        model={**UNWRITTEN, "note": HELD},
        members=members,
        probability=pull.probability * odd.probability,
        parameters=parameters,
        statement=text,
    )


def _figures(weight: Array, covariance: Array, sweep: float, unit: str) -> dict[str, dict[str, Any]]:
    """A weight's parameters as a finding has them."""
    largest = float(np.hypot(*weight))
    gradients = np.vstack([np.eye(2), weight / max(largest, 1e-12)])
    doubt = 1.96 * np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients))
    parameters = {
        name: {"value": float(value), "unit": unit, "ci95": [float(value - d), float(value + d)]}
        for name, value, d in zip(("along", "across", "largest"), [*weight, largest], doubt, strict=True)
    }
    return {**parameters, "sweep": {"value": sweep, "unit": "rad", "ci95": None}}
