"""Findings as they are written: each station read once more with its findings and nothing else of the machine.

What is left out of the list of findings (the form of another, a trifle, what no table names) is not in the model
either: sizes beside it would not be those of the model. What belongs to the recording stays in.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...background import Pair
from ...effects.base import DriveState
from ..findings import Finding
from .balance import Balance, Fit
from .entries import finding_of
from .interval import Reading, as_named, parameter_intervals, undisturbed
from .shapes import refit, reform
from .station import Station
from .term import Term

Array = NDArray[np.float64]

ROUNDS = 10  # until what is asked of a drive is what its loss lets it ask
SETTLED = 0.003  # of the noise: a round that moves the prediction less is the last


def reread(findings: Sequence[Finding], stations: Sequence[Station]) -> tuple[tuple[Finding, ...], list[Station]]:
    """Findings with the sizes that they have among themselves, and the stations so read. `declared` of those is beside
    what belongs to the recording."""
    named = [(i, frozenset(f.effect for f in findings if s.names(f))) for i, s in enumerate(stations)]
    with Pair(tuple(stations)) as pair:
        written = pair.map(_written, named, costs=[1.0 + len(names) for _, names in named])
    changed = [
        (old, new) for old, new in zip(stations, written, strict=True) if new.reading.fit.terms != old.reading.fit.terms
    ]
    out = []
    for finding in findings:
        new = next((new for old, new in changed if old.names(finding)), None)
        named = None if new is None else next((f for f in new.proven if f.term.effect.name == finding.effect), None)
        if new is not None and named is not None:
            _, again = finding_of(new, named, 0.0, 0.0)
            where = {**finding.where, "region": again.where["region"]}
            finding = replace(
                finding, where=where, statement=again.statement, parameters=again.parameters, fit=again.fit
            )
        out.append(finding)
    return tuple(out), written


def _written(stations: tuple[Station, ...], named: tuple[int, frozenset[str]]) -> Station:
    """One of the stations with the terms of some names and of the recording; as it was read where there are no others.
    named: its place and the names."""
    station, names = stations[named[0]], named[1]
    naming, out = station.naming, copy(station)
    kept = [i for i, t in enumerate(naming.fit.terms) if t.effect.name in names or t.effect.recorded]
    asking = any(naming.fit.terms[i].effect.asks for i in kept)
    if names and (asking or len(kept) < len(naming.fit.terms)):
        balance, fit = _settled(naming.balance, tuple(naming.fit.terms[i] for i in kept), ROUNDS if asking else 1)
        place = {i: k for k, i in enumerate(kept)}
        again = {
            id(f): replace(f, term=fit.terms[k], amplitudes=dict(fit.amplitudes[k]))
            for f in naming.found
            if (k := place.get(naming.fit.terms.index(f.term))) is not None
        }
        out.naming = replace(naming, balance=balance, fit=fit, found=tuple(again.values()))
        out.proven = tuple(again[id(f)] for f in station.proven if id(f) in again)
        at_ends = any(f.term.effect.name in station.at_ends for f in again.values())
        out.reading = as_named(out.naming) if at_ends else undisturbed(out.naming)
        out.parameters = {which: parameter_intervals(out.reading, which) for which in range(len(fit.terms))}
        out = out if out.beside is None else out.beside(out)
    out.naming = replace(out.naming, declared=_recorded(out.naming.balance, out.naming.fit))
    out.reading = Reading(out.reading.balance, _recorded(out.reading.balance, out.reading.fit), out.reading.fit)
    return out


def _settled(balance: Balance, terms: tuple[Term, ...], rounds: int) -> tuple[Balance, Fit]:
    """The balance and the fit of the terms, each with maps and required efforts as they are beside the others."""
    fit = refit(balance, balance.fit(terms))
    for _ in range(rounds):
        balance = balance.remapped(fit)
        if any(t.effect.asks for t in fit.terms):
            balance = balance.required(fit)
        before, fit = fit, refit(balance, balance.fit(fit.terms))
        for which, term in enumerate(fit.terms):
            fit = reform(balance, fit, which) if term.effect.asks else fit
        if np.mean(((fit.prediction - before.prediction) * balance.weight) ** 2) < SETTLED**2:
            break
    return balance, fit


def _recorded(balance: Balance, fit: Fit) -> Fit:
    return balance.fit(tuple(t for t in fit.terms if t.effect.recorded))


def of_recording(fit: Fit, state: DriveState) -> Array:
    """Effort (n,) along a recording that belongs to the recording itself: effects that are none of the machine or of a
    force that only this recording had, and, of an angle, its clock's offset and steps of slipped markers."""
    out = np.zeros(len(state.time_s))
    if any(name.startswith("power_") for name in state.declared_names):
        own = [i for i, name in enumerate(state.declared_names) if not name.startswith("power_")]
        out = out + state.declared[:, own] @ np.array([fit.declared[state.declared_names[i]] for i in own])
    for which, term in enumerate(fit.terms):
        if term.effect.recorded or term.effect.forced:
            out = out + fit.added(which, state)
    return out
