"""Preload: a drive whose declared preload is unlike those of the hand's other drives has lopsided friction, or another
preload.

From current alone the two are the same (the declared model takes up either), so the name is a class, and only what
other drives of the same hand are like speaks for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...effects import effect
from ..findings import UNWRITTEN, Finding, weighed
from ..name.station import Station
from ..reduction import reduction
from .decoupled import pulls
from .known_motors import PRELOAD, kinship, preload_by_chance

# mean absolute deviation of the logarithm of a drive's preload within one hand, as sure as from so many comparisons
SPREAD, HANDS = 0.15, 3.0
LIKE = ("viscous", "coulomb", "spring")  # coefficients that say how alike the drives of a hand are
SPRING = ("preload", "spring")  # coefficients of what pulls a finger back
ODD_P = 0.03  # of two drives that differ as much by chance; beyond, one of them is odd
LOST = 0.2  # of the other's preload: less, or the wrong sign, and there is none
SURE_LEAST = 0.1  # of a half difference counts in the ranking, however uncertain the rest is
RESTLESS = 0.5  # of the noise
CLASS = ("asymmetric_friction", "spring_preload")
KIN = 0.9  # probability that a hand's motors are of the known kind, from which these do for others of its own
COMPARISON = "comparison of the hand's motors"  # what speaks for it, where others are proved by an engine


def preload_findings(stations: Sequence[Station]) -> list[tuple[float, Finding]]:
    """Drives whose preload neither the hand's others let expect nor, as far as the hand's motors are of their kind, those
    of a known hand, with their weight.

    The other drives' median is the reference; one of which something is missing is none. What pulls a finger off its
    drive pulls at its preload. A drive of which something else is missing must be unlike the others both with and
    without its name.
    """
    drives = _drives(stations)
    spread = shape, scale = _spread([s.naming.fit.declared for s in drives if s.believed or not s.missing])
    motors = [s.naming.fit.declared for s in drives]
    kin = kinship(motors)
    out = []
    for station in drives:
        rest = _others(drives, station)
        others = [float(s.naming.fit.declared["preload"]) for s in rest]
        if not others and kin < KIN:
            continue
        usual = _usual(others, kin)
        own = _preload_near(station, usual)
        error = _standard_error(station)
        unlike = [_by_chance(own, error, other, spread) for other in others if other > 0]  # every other
        alike = [_preload_near(s, PRELOAD) for s in drives if s is not station]
        p = kin * preload_by_chance(own, error, alike, motors) + (1 - kin) * max(unlike, default=1.0)
        odds = kin + (1 - kin) * (1.0 if len(others) > 1 else _odds(own, others))
        doubt = 2 * float(np.hypot(error, np.sqrt(2) * scale / shape * usual))
        if usual > 0 and p < ODD_P and odds > 0.5 and abs(own - usual) > doubt:
            out.append(_finding(station, own - usual, doubt, (1 - p) * odds))
    return out


def _preload_near(station: Station, usual: float) -> float:
    """The preload of a drive with or without its names, whichever is nearer to a usual one."""
    preloads = (float(fit.declared["preload"]) for fit in (station.naming.fit, station.naming.declared))
    return min(preloads, key=lambda preload: abs(preload - usual))


def _usual(others: Sequence[float], kin: float) -> float:
    """The preload to expect beside those of other drives, and of a known hand as far as these are of its kind."""
    return kin * PRELOAD + (1 - kin) * float(np.median(others)) if others else PRELOAD


def _odds(own: float, others: Sequence[float]) -> float:
    """Probability that of two drives whose preloads differ this one is odd: of sizes where a usual preload may have any
    scale (Jeffreys 1946) the larger, unless one has lost its preload altogether: springs do not push."""
    (its,) = others or (0.0,)
    if own < LOST * its or its < LOST * own:
        return float(own < its)
    return own / (own + its)


def expected(stations: Sequence[Station], station: Station, name: str) -> tuple[float, float] | None:
    """What the hand's other drives let expect of a positive coefficient of one drive, and how sure that is (standard
    deviation); None where they say nothing. What a drive's names changed of it is as much as they may be wrong by."""
    drives = _drives(stations)
    rest = [s.naming for s in drives if s is not station]
    usual = float(np.median([n.fit.declared[name] for n in rest])) if rest else 0.0
    if usual <= 0:
        return None
    changed = float(np.median([abs(n.fit.declared[name] - n.declared.declared[name]) for n in rest]))
    shape, scale = _spread([s.naming.fit.declared for s in drives if s.believed or not s.missing])
    return usual, float(np.hypot(np.sqrt(2) * scale / shape * usual, changed))


def usual_spring(stations: Sequence[Station], station: Station) -> dict[str, tuple[float, float]]:
    """What the hand's other drives let expect of one drive's preload and spring, as `expected`, where they say it."""
    known = {name: expected(stations, station, name) for name in SPRING}
    return {name: value for name, value in known.items() if value is not None}


def _drives(stations: Sequence[Station]) -> list[Station]:
    """Those whose preload can be spoken of."""
    pulled = {s.actuator for s in stations if pulls(s)}
    return [
        s
        for s in stations
        if s.signal == "current" and s.actuator not in pulled and "preload" in s.naming.fit.declared and _tells(s)
    ]


def _others(drives: Sequence[Station], station: Station) -> list[Station]:
    """The drives that say what is usual; none where something is missing of all: such a drive accuses no other."""
    rest = [s for s in drives if s is not station and (_settled(s) or not _lacks(s))]
    return [] if all(_lacks(s) for s in rest) else rest


def _lacks(station: Station) -> bool:
    """Whether something is missing of the drive itself: what happened in one recording is not."""
    return station.missing and not (station.believed and not any(f.term.effect.of_the_hand for f in station.kept))


def _tells(station: Station) -> bool:
    """Whether a drive's preload can be spoken of: of one that does not repeat itself, of which something unknown is
    missing, or whose reading clips at one end, it cannot."""
    ends = np.array([-np.inf, np.inf])
    lopsided = any(
        np.isinf(t.effect.clip(ends, t.shape)).any() for t in (f.term for f in station.kept) if t.effect.clips
    )
    return not lopsided and station.wander <= RESTLESS and (station.believed or not station.missing)


def _settled(station: Station) -> bool:
    """Whether what is missing of a drive is no load: its preload is the same with and without the name."""
    named, plain = (float(fit.declared["preload"]) for fit in (station.naming.fit, station.naming.declared))
    return abs(named - plain) < SPREAD * max(abs(named), abs(plain))


def _spread(drives: Sequence[Mapping[str, float]]) -> tuple[float, float]:
    """Shape and scale of what is known (inverse gamma) of the mean absolute deviation of the logarithm of a preload
    among these drives: of hands in general, and of how alike the drives of this one are in everything else (of two
    Laplace ones a pair differs by 1.5)."""
    scale, shape = HANDS * SPREAD, HANDS
    for name in LIKE:
        values = np.array([d[name] for d in drives if d.get(name, 0.0) > 0])
        if len(values) > 1:
            apart = np.abs(np.subtract.outer(np.log(values), np.log(values)))[np.triu_indices(len(values), 1)]
            scale += (len(values) - 1) * float(np.mean(apart)) / 1.5
            shape += len(values) - 1
    return shape, scale


def _by_chance(own: float, error: float, usual: float, spread: tuple[float, float]) -> float:
    """Probability of two healthy preloads so far apart (logarithms by Laplace), at the nearer end of the standard
    error: the mean over all deviations that `spread` (shape, scale) grants, for few drives tell little of it."""
    if usual <= 0:
        return 0.0
    nearer = own + np.sign(usual - own) * min(2 * error, abs(usual - own))
    x, (shape, scale) = abs(np.log(max(nearer, 1e-3 * usual) / usual)), spread
    return float((scale / (scale + x)) ** shape * (1 + 0.5 * x * shape / (scale + x)))


def _standard_error(station: Station) -> float:
    """Of the preload [raw], beside what was named, of which readings that clip say nothing."""
    balance, fit = station.naming.balance, station.naming.fit
    told = balance.weight * balance.train * balance.unclipped_by(fit)
    matrix = balance.design(fit.terms)[0] * told[:, None]
    at = balance.names.index("preload")
    return float(np.sqrt(np.linalg.pinv(matrix.T @ matrix)[at, at] * balance.inflation))


def _finding(station: Station, half_difference: float, doubt: float, probability: float) -> tuple[float, Finding]:
    """doubt: two standard deviations of the half difference."""
    unit = station.naming.balance.states[0].effort_unit
    parameters = {
        "half_difference": {
            "value": half_difference,
            "unit": unit,
            "ci95": [half_difference - doubt, half_difference + doubt],
        }
    }
    where: dict[str, Any] = {
        "finger": station.finger,
        "joint": None,
        "actuator": station.actuator,
        "signal": "current",
        "marker": None,
        "trials": [s.trial for s in station.naming.balance.states],
        "region": None,
        "share_of_mismatch": 1.0,
    }
    text = effect(CLASS[0]).statement(where, {"half_difference": half_difference})
    fit = {
        "metric": "current_rmse",
        "unit": unit,
        **_proof(station, half_difference),
        "noise_floor": station.naming.balance.sigma,
        "engine": COMPARISON,
    }
    sure = max(abs(half_difference) - doubt, SURE_LEAST * abs(half_difference))
    return weighed(sure / station.naming.balance.sigma, station.contrast), Finding(
        CLASS[0], CLASS, probability, (), where, text, parameters, fit, dict(UNWRITTEN)
    )


def _proof(station: Station, half_difference: float) -> dict[str, Any]:
    """What a drive with the preload that the hand's others let expect would leave of its steady current on recordings
    kept out (all, where there are none), and what this one leaves, as the other recordings teach it."""
    balance, fit = station.naming.balance, station.naming.fit
    held = balance.steady & ~balance.train
    use = held if held.any() else balance.steady
    left = (balance.effort - fit.prediction)[use]
    names = [s.trial for s in balance.states if s.validate] if held.any() else []
    return {**reduction([left + half_difference], [left], [balance.stroke[use]]), "held_out": names}
