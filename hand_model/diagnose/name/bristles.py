"""Bristles of a drive's declared friction, beside what was named.

Coulomb friction turns over within a small distance in any drive (`extra["give"]`, [position unit]; Canudas de Wit 1995,
eq. 3). How small is first read from the declared model alone, where whatever builds up after a reversal lengthens it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.base import DriveState
from ...effects.path import dahl
from .balance import Balance, Fit
from .evidence import parameter_price
from .shapes import priced

FRICTION = "coulomb"
LENGTHS = np.geomspace(0.1, 1.0, 10)  # tried, of the longest that is granted to a drive


def with_bristles(balance: Balance, fit: Fit) -> tuple[Balance, Fit]:
    """The balance with the bristles that are best beside the terms of `fit`, none longer than what is granted, and the
    fit to it: without a term that has bristles of its own, where shorter ones do as much. As they were where that gains
    less than a parameter's price, or where the balance is no drive's."""
    granted = balance.states[0].extra.get("granted")
    terms = tuple(t for t in fit.terms if t.effect.replaces != FRICTION)
    if granted is None or not terms:
        return balance, fit
    told = [balance.told(lambda s, x=x: bristled(s, x)) for x in float(np.max(granted)) * LENGTHS]
    cost = priced(balance)
    other, best = min(((b, b.fit(terms)) for b in told), key=lambda found: cost(found[1]))
    return (other, best) if cost(best) < cost(fit) - parameter_price(balance) else (balance, fit)


def bristled(state: DriveState, length: float) -> DriveState:
    """The state with a Dahl column of that bristle length as its Coulomb friction."""
    declared = np.array(state.declared)
    declared[:, state.declared_names.index(FRICTION)] = dahl(state.position, length)
    return replace(state, declared=declared, extra={**state.extra, "give": np.full(len(state.time_s), length)})
