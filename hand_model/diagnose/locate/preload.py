"""Preload: a drive whose declared preload is unlike those of the hand's other drives has lopsided friction, or another preload.

From current alone the two are the same (the declared model takes up either), so the name is a class, and only what other drives
of the same hand are like speaks for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...effects import effect
from ..findings import Finding, weighed
from ..name.station import Station

SPREAD, HANDS = 0.15, 3.0  # mean absolute deviation of the logarithm of a drive's preload within one hand, as sure as from so many comparisons
LIKE = ("viscous", "coulomb", "spring")  # coefficients that say how alike the drives of a hand are
ODD_P = 0.03  # of two drives that differ as much by chance; beyond, one of them is odd
LOST = 0.2  # of the other's preload: less, or the wrong sign, and there is none
SURE_LEAST = 0.1  # of a half difference counts in the ranking, however uncertain the rest is
RESTLESS = 0.5  # of the noise
CLASS = ("asymmetric_friction", "spring_preload")


def preload_findings(stations: Sequence[Station]) -> list[tuple[float, Finding]]:
    """Drives whose preload the others' do not let expect, with their weight.

    The other drives' median is the reference. What pulls a finger off its drive pulls at its preload. Drives of which something else is missing are compared where that is no load: the preload is the same with and
    without its name.
    """
    pulled = {s.actuator for s in stations if s.believed and any(f.term.effect.name == "spring_decoupling" for f in s.kept)}
    sound = [s for s in stations if s.signal == "current" and s.actuator not in pulled and "preload" in s.naming.fit.declared and _sound(s)]
    preload = {id(s): float(s.naming.fit.declared["preload"]) for s in sound}
    spread = _spread([s.naming.fit.declared for s in sound])
    out = []
    for station in sound:
        rest = [s for s in sound if s is not station]
        if all(s.missing for s in rest):  # a drive of which something is missing accuses no other
            continue
        others = [preload[id(s)] for s in rest]
        usual = float(np.median(others))
        # Of two that differ the larger is odd, unless one has lost its preload altogether: springs do not push.
        if usual <= 0 or (len(others) == 1 and usual < LOST * preload[id(station)]):
            continue
        own, error = preload[id(station)], _standard_error(station)
        p = max(_by_chance(own, error, other, spread) for other in others)  # unlike every other
        if p < ODD_P and (len(others) > 1 or own > usual or own < LOST * usual):
            # Of two either may be odd: the odds are those of the sizes, where a usual preload may have any scale (Jeffreys 1946).
            larger = own / (own + usual) if len(others) == 1 and own > usual else 1.0
            out.append(_finding(station, own - usual, error, spread * usual, (1 - p) * larger))
    return out


def _sound(station: Station) -> bool:
    """Whether a drive's preload is told apart from whatever else is missing of it; one that does not repeat itself has none to speak of."""
    if station.wander > RESTLESS:
        return False
    if not station.missing:
        return True
    named, plain = (float(fit.declared["preload"]) for fit in (station.naming.fit, station.naming.declared))
    return station.believed and abs(named - plain) < SPREAD * max(abs(named), abs(plain))


def _spread(drives: Sequence[Mapping[str, float]]) -> float:
    """Mean absolute deviation of the logarithm of a preload among these drives: what is known of hands, and how alike the drives of this
    one are in everything else (mean of an inverse gamma prior and the drives' coefficients; of two Laplace ones a pair differs by 1.5)."""
    known, weight = HANDS * SPREAD, HANDS
    for name in LIKE:
        values = np.array([d[name] for d in drives if d.get(name, 0.0) > 0])
        if len(values) > 1:
            apart = np.abs(np.subtract.outer(np.log(values), np.log(values)))[np.triu_indices(len(values), 1)]
            known += (len(values) - 1) * float(np.mean(apart)) / 1.5
            weight += len(values) - 1
    return known / weight


def _by_chance(own: float, error: float, usual: float, spread: float) -> float:
    """Probability of two healthy preloads so far apart (logarithms by Laplace), at the nearer end of the standard error."""
    if usual <= 0:
        return 0.0
    nearer = own + np.sign(usual - own) * min(2 * error, abs(usual - own))
    x = abs(np.log(max(nearer, 1e-3 * usual) / usual))
    return float((1 + x / (2 * spread)) * np.exp(-x / spread))


def _standard_error(station: Station) -> float:
    """Of the preload [raw], beside what was named."""
    balance = station.naming.balance
    matrix = balance.design(station.naming.fit.terms)[0] * (balance.weight * balance.train)[:, None]
    at = balance.names.index("preload")
    return float(np.sqrt(np.linalg.pinv(matrix.T @ matrix)[at, at] * balance.inflation))


def _finding(station: Station, half_difference: float, error: float, spread: float, probability: float) -> tuple[float, Finding]:
    doubt = 2 * float(np.hypot(error, spread * np.sqrt(2)))
    unit = station.naming.balance.states[0].effort_unit
    parameters = {"half_difference": {"value": half_difference, "unit": unit, "ci95": [half_difference - doubt, half_difference + doubt]}}
    where: dict[str, Any] = {"finger": station.finger, "joint": None, "actuator": station.actuator, "signal": "current", "marker": None,
                             "trials": [s.trial for s in station.naming.balance.states], "region": None, "share_of_mismatch": 1.0}
    text = effect(CLASS[0]).statement(where, {"half_difference": half_difference})
    fit = {"metric": "current_rmse", "unit": unit, "before": None, "after": None, "noise_floor": station.naming.balance.sigma,
           "ci95_reduction": None, "held_out": [], "engine": "comparison of the hand's motors"}
    model = {"native": True, "mjcf": f"joint[@name='{station.actuator}']/@springref", "urdf": "kept in hand.json"}
    sure = max(abs(half_difference) - doubt, SURE_LEAST * abs(half_difference))
    return weighed(sure / station.naming.balance.sigma, station.contrast), Finding(CLASS[0], CLASS, probability, (), where, text, parameters, fit, model)
