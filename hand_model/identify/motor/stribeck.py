"""Friction that rises as speed falls (Stribeck), beside all other unknowns of a drive: whether the recordings show it,
and how far they tell its shape."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from . import output_error
from .controller import JUMP, STICK, SUDDEN_S
from .drive import STRIBECK
from .output_error import FINE, OutputErrorFit
from .parameters import BOUNDS
from .weak_form import Regression

EVIDENCE = 16.0  # fall of the misfit (in variances, of three parameters): once in about a thousand by chance


def with_rise(base: OutputErrorFit, curved: Regression) -> tuple[OutputErrorFit, float]:
    """The fit with a Stribeck rise, or without where it is not worth it, and the fall of the misfit by it.

    The shape of the rise is one of its unknowns: held at a wrong one, Coulomb and viscous friction make up for it.
    """
    level = max(float(curved.values[2]), 0.2 * base.values["coulomb"])
    rise = {
        "static_ratio": float(np.clip(1 + curved.static_excess / level, 1.2, 5.0)),
        "stribeck_speed": curved.stribeck_speed,
    }
    start = {
        **base.values,
        "viscous": float(curved.values[1]),
        "coulomb": level,
        **rise,
        "stribeck_exponent": curved.stribeck_exponent,
    }
    best = output_error.fit(
        base.moves, start, (*base.names, *STRIBECK), base.sigma, BOUNDS, base.controller, (FINE,), base.own
    )
    if base.cost - best.cost > EVIDENCE:  # far from where it began: once more
        best = hardened(best) or output_error.fit(
            base.moves, best.values, best.names, base.sigma, BOUNDS, base.controller, (FINE,), best.own
        )
    evidence = (base.cost - best.cost) / max(1.0, *best.chi2)
    return (base, 0.0) if evidence < EVIDENCE else (best, evidence)


def hardened(f: OutputErrorFit) -> OutputErrorFit | None:
    """The fit with friction that sticks hard and a reference whose speed jumps, where bristles and ramps were no more
    than what a rise does at low speed;
    None where the encoder sees both, or without them the moves are not explained as well."""
    bends = 0 < f.values["presliding"] < f.sigma[0]
    ramps = f.controller == "profile" and 0 < min(f.values["rise"], f.values["fall"]) < SUDDEN_S
    if not (bends or ramps):
        return None
    changed = (STICK if bends else {}) | (JUMP if ramps else {})
    names = tuple(n for n in f.names if n not in changed)
    hard = output_error.fit(f.moves, {**f.values, **changed}, names, f.sigma, BOUNDS, f.controller, (FINE,), f.own)
    return hard if hard.cost < f.cost + EVIDENCE else None


def with_other_shape(best: OutputErrorFit) -> OutputErrorFit:
    """The fit, its covariance as wide as the misfit tells between its own shape of the rise and the other usual one
    (exponential; Gaussian).

    Along this way the misfit is no parabola: the secant over it says how far the recording allows to go.
    """
    exponent = 2.0 if best.values["stribeck_exponent"] < 1.5 else 1.0
    names = tuple(n for n in best.names if n != "stribeck_exponent")
    return _widened(best, _refitted(best, {"stribeck_exponent": exponent}, names))


def with_other_speed(best: OutputErrorFit) -> OutputErrorFit:
    """The better of the fit and of one begun at half the speed of the rise, its covariance as wide as the misfit tells
    between the two.

    Coulomb and viscous friction make up for a broad rise: a long, flat valley, in which a search among kinks may end
    anywhere.
    """
    v0, exponent = best.values["stribeck_speed"], best.values["stribeck_exponent"]
    v = np.linspace(0.01, 1.0, 100) * best.values["speed_full"]
    columns = [np.column_stack([np.ones_like(v), np.exp(-((v / speed) ** exponent)), v]) for speed in (v0, 0.5 * v0)]
    level = best.values["coulomb"]
    friction = columns[0] @ [level, level * (best.values["static_ratio"] - 1), best.values["viscous"]]
    # what comes nearest to the same friction
    level, rise, viscous = map(float, np.linalg.lstsq(columns[1], friction, rcond=None)[0])
    start = {
        "coulomb": level,
        "static_ratio": max(1 + rise / level, 1.05),
        "viscous": viscous,
        "stribeck_speed": 0.5 * v0,
    }
    other = _refitted(best, start, best.names)
    return _widened(*sorted((best, other), key=lambda f: f.cost))


def _refitted(f: OutputErrorFit, changed: Mapping[str, float], names: Sequence[str]) -> OutputErrorFit:
    """The fit of the named parameters, begun at other values."""
    values = {**f.values, **changed}
    return output_error.fit(f.moves, values, names, f.sigma, BOUNDS, f.controller, (FINE,), f.own, f.memory)


def _widened(best: OutputErrorFit, other: OutputErrorFit) -> OutputErrorFit:
    """The fit, its covariance as wide as the secant of the misfit to another says."""
    if (rise := other.cost - best.cost) > EVIDENCE:
        return best
    way = np.array([other.values[n] - best.values[n] for n in best.names])
    return dataclasses.replace(best, covariance=best.covariance + np.outer(way, way) / max(rise, 3.84))
