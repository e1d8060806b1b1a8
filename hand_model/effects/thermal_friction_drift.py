"""Thermal friction drift: friction changes as the drive warms up."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .law import Law, Moment

ELAPSED, WORKED, LOGGED, EACH = 0.0, 1.0, 2.0, 3.0  # forms
WARM_UP, COOLING, BY_TEMPERATURE = ("warm_up_time",), ("cooling_time",), ("coldest", "warmest", "thinning")
TOLD = {ELAPSED: WARM_UP, WORKED: WARM_UP + COOLING, LOGGED: BY_TEMPERATURE, EACH: WARM_UP}  # what each form has
SOONEST_S = 5.0  # what is recorded for less than this twice over shows no more than a line
HASTY, UNLIKELY = 1.2, 8.0  # times that, within which no motor warms: log likelihood against it
THINNEST = 4.0  # over the recorded temperatures viscosity falls to exp(-4)
EVEN = 1e-3  # of that logarithm: less is none
MOVING = 1.0  # %/s: below, a drive is at rest


class ThermalFrictionDrift(Effect):
    """F = sign(v) A (1 - h): the change still to come. h rises to 1 with the time since the session began (form 0), or
    with the time in motion, and falls back at rest between recordings (form 1), with the logged temperature, whose
    sensor need not sit where the friction is (form 2: evenly, or as a lubricant's viscosity, exponentially; Reynolds
    1886), or with the time since each recording began, cold (form 3).
    """

    name = "thermal_friction_drift"
    rubs = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Warm-up time between 5 s and four times the session, cooling time at rest, form; thinning: logarithm of how
        much more friction changes per degree at the coldest than at the warmest."""
        total = max(_elapsed(states), 2 * SOONEST_S)
        forms = (ELAPSED, WORKED) if all("moving" in s.extra for s in states) else (ELAPSED,)
        forms += (LOGGED,) if _warming(states) else ()
        forms += (EACH,) if len(states) > 1 and _longest(states) >= 2 * SOONEST_S else ()
        return (
            Shape("form", "1", ELAPSED, EACH, forms),
            Shape(
                "warm_up_time",
                "s",
                SOONEST_S,
                4 * total,
                tuple(np.geomspace(max(SOONEST_S, 0.04 * total), 2 * total, 7)),
                forms=(ELAPSED, WORKED, EACH),
            ),
            Shape("cooling_time", "s", 2.0, 40 * total, (5.0, 25.0, 60.0, 120.0, 400.0), forms=(WORKED,)),
            Shape("thinning", "1", 0.0, THINNEST, (0.0, 1.5, 3.0), forms=(LOGGED,)),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """The range of temperatures goes with each point; none where it is all over too soon."""
        seen = _elapsed(states) >= 2 * SOONEST_S
        return [{**p, **_warming(states)} for p in super().grid(states)] if seen else []

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Friction above the final value when cold; lubricants thin out, yet either sign is allowed."""
        return (("cold_excess", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """sign(v) (1 - h), (n, 1)."""
        return (state.direction * _share(state, shape))[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Cold excess, also as a ratio to the warm Coulomb friction, and what its form has of times and temperatures."""
        return {
            **amplitude,
            **self.told(shape),
            "ratio": amplitude["cold_excess"] / (declared.get("coulomb") or np.nan),
        }

    def told(self, shape: Mapping[str, float]) -> dict[str, float]:
        """The form, and what it has of times and temperatures."""
        return {k: v for k, v in shape.items() if k in ("form", *TOLD[shape["form"]])}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """By how much cold friction differs, and how it fades."""
        excess = parameters["cold_excess"]
        cold = f"friction is {figure(abs(excess))} raw {'higher' if excess > 0 else 'lower'} cold than warm and"
        if parameters["form"] == LOGGED:
            return (
                f"{cold} follows the logged temperature from {parameters['coldest']:.1f} to {parameters['warmest']:.1f}"
            )
        warm_up = figure(parameters["warm_up_time"])
        if parameters["form"] == ELAPSED:
            return f"{cold} settles with a time constant of {warm_up} s from the session's first sample on"
        if parameters["form"] == EACH:
            return f"{cold} settles with a time constant of {warm_up} s from the begin of each recording on"
        cooling = figure(parameters["cooling_time"])
        return (
            f"{cold} settles with a time constant of {warm_up} s in motion; at rest it returns with one of {cooling} s"
        )

    def started(self, state: DriveState, parameters: Mapping[str, float]) -> dict[str, float]:
        """Share of the excess that is left when a recording begins."""
        if parameters.get("form", ELAPSED) == ELAPSED:
            return {"cold": math.exp(-float(state.elapsed_s[0]) / parameters["warm_up_time"])}
        if parameters["form"] == EACH:
            return {"cold": 1.0}
        if parameters["form"] == LOGGED:
            return {"cold": float(np.mean(_share(state, parameters)))}
        return {"cold": _before(state, parameters["warm_up_time"], parameters["cooling_time"])}

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Warming seldom takes more than the warm friction off, nor is it over within a few strokes."""
        ratio = abs(parameters["ratio"]) if np.isfinite(parameters["ratio"]) else 6.0
        hasty = parameters.get("form") == EACH and parameters["warm_up_time"] < HASTY * SOONEST_S
        return -2.0 * max(0.0, min(ratio, 6.0) - 1.0) ** 2 - UNLIKELY * hasty

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Friction that fades while time passes (forms 0 and 3) or while the drive moves (form 1), cold to begin with; of a
        logged temperature (form 2) it stays as a recording's was."""
        cold = [parameters.get("cold", 1.0)]

        def load(now: Moment) -> float:
            if parameters.get("form") == LOGGED:
                pass
            elif parameters.get("form", ELAPSED) in (ELAPSED, EACH) or abs(now.velocity) > MOVING:
                cold[0] *= math.exp(-now.step_s / parameters["warm_up_time"])
            else:
                cold[0] = _rested(cold[0], now.step_s, parameters["cooling_time"])
            return parameters["cold_excess"] * now.direction * cold[0]

        return load


def _elapsed(states: tuple[DriveState, ...]) -> float:
    """Time [s] from the session's first sample to its last."""
    return max(float(s.elapsed_s[-1]) for s in states)


def _longest(states: tuple[DriveState, ...]) -> float:
    """Length [s] of the longest recording."""
    return max(float(np.ptp(s.time_s)) for s in states)


def _warming(states: tuple[DriveState, ...]) -> dict[str, float]:
    """Coldest and warmest logged temperature; none where it is not logged all along, or does not change."""
    if not all("temperature" in s.extra for s in states):
        return {}
    every = np.concatenate([s.extra["temperature"] for s in states])
    low, high = float(np.min(every)), float(np.max(every))
    return {"coldest": low, "warmest": high} if high > low else {}


def _share(state: DriveState, shape: Mapping[str, float]) -> Array:
    """Share (n,) of the change that is still to come."""
    if shape["form"] == LOGGED:
        left = (shape["warmest"] - state.extra["temperature"]) / (shape["warmest"] - shape["coldest"])
        thinning = shape.get("thinning", 0.0)
        return np.expm1(thinning * left) / np.expm1(thinning) if thinning > EVEN else left
    if shape["form"] == WORKED:
        return _cold(state, shape["warm_up_time"], shape["cooling_time"])
    since = state.time_s - state.time_s[0] if shape["form"] == EACH else state.elapsed_s
    return np.exp(-since / shape["warm_up_time"])


def _rested(cold: float, rest_s: float, cooling_time_s: float) -> float:
    return 1 - (1 - cold) * math.exp(-rest_s / cooling_time_s)


def _before(state: DriveState, warm_up_s: float, cooling_s: float) -> float:
    """Share of the change that is still to come when a recording begins."""
    cold = 1.0
    for moved, rest in state.extra["history"]:
        cold = _rested(cold * math.exp(-moved / warm_up_s), rest, cooling_s)
    return cold


def _cold(state: DriveState, warm_up_s: float, cooling_s: float) -> Array:
    """Share (n,) of the change that is still to come."""
    moving = state.extra["moving"] > 0
    step = np.diff(state.time_s, prepend=state.time_s[0])
    edges = np.r_[0, np.flatnonzero(np.diff(moving)) + 1, len(moving)]
    out, cold = np.empty(len(moving)), _before(state, warm_up_s, cooling_s)
    for a, b in itertools.pairwise(edges):
        span = np.cumsum(step[a:b])
        out[a:b] = cold * np.exp(-span / warm_up_s) if moving[a] else 1 - (1 - cold) * np.exp(-span / cooling_s)
        cold = out[b - 1]
    return out


EFFECT = ThermalFrictionDrift()
