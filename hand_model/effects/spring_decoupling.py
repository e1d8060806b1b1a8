"""Spring decoupling: the finger leaves its actuator against the spring (weight, external flexion)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range, rounded
from .path import runs

WHILES, OPEN, TIPS, SLOW = 0.0, 1.0, 2.0, 3.0
UNITS = {OPEN: "effort/position", TIPS: "effort"}  # of the lead, where it is no share


class SpringDecoupling(Effect):
    """The finger runs ahead of its actuator: for a while, wherever it is, or in every cycle near the open end, or beyond
    a position, where its weight tips over, or whenever it opens, for its spring brings it back more slowly."""

    name = "spring_decoupling"
    station = "encoder"
    forced = True
    unwritten = (
        "the finger runs ahead under a force from outside, which no recording holds; the compiled push tendon lets it"
    )

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """form 0: for a while, "ahead" in `extra`; form 1: below an encoder position, at which the finger stays behind, as a
        tendon goes slack: within a corner of some width; form 2: beyond one, the whole lead reached over a way of its
        own; form 3: it comes open after its actuator by a time constant."""
        low, high = position_range(states)
        span, unit = high - low, states[0].position_unit
        below, beyond = (tuple(low + span * np.linspace(*ends)) for ends in ((0.03, 0.5, 12), (0.15, 0.8, 14)))
        return (
            Shape("form", "1", WHILES, SLOW, (WHILES, OPEN, TIPS, SLOW)),
            Shape("below", unit, low + 0.01 * span, low + 0.6 * span, below, forms=(OPEN,)),
            Shape("corner", unit, 1e-3 * span, 0.06 * span, (1e-3 * span, 0.03 * span), forms=(OPEN,)),
            Shape("beyond", unit, low + 0.1 * span, low + 0.85 * span, beyond, forms=(TIPS,)),
            Shape("over", unit, 0.03 * span, 0.3 * span, (0.08 * span, 0.2 * span), forms=(TIPS,)),
            Shape("lag", "s", 0.004, 1.0, tuple(np.geomspace(0.01, 0.4, 8)), forms=(SLOW,)),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Share of the seen excursion (form 0), angle per position that the finger stays behind (form 1), angle by which
        it tips over (form 2), or share of what it comes late (form 3)."""
        return (("lead", "1", 0.0, np.inf),)

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Of how far it stays behind for each unit of position, or runs ahead."""
        return {"lead": UNITS[shape["form"]]} if shape["form"] in UNITS else {}

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """The lead, and where."""
        where = ("lag",) if comes_late(shape) else ("beyond", "over") if tips_over(shape) else ("below", "corner")
        return {**{name: shape[name] for name in ("form", *where)}, **amplitude}

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The excursions, or max(0, below - x) with a rounded corner, or the share of the way over which it tips, (n, 1)."""
        if shape["form"] == WHILES:
            return state.extra.get("ahead", np.zeros(len(state.time_s)))[:, None]
        if comes_late(shape):
            return (state.slope * behind(state, shape["lag"]))[:, None]
        if tips_over(shape):
            return np.clip((state.position - shape["beyond"]) / shape["over"], 0.0, 1.0)[:, None]
        return rounded(shape["below"] - state.position, shape["corner"])[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """The whiles [s] by trial, or from the open end to where it follows again, or from where it tips over on."""
        if shape["form"] == WHILES:
            return {"time": {s.trial: spans(s) for s in states if spans(s)}, "unit": "s"}
        if comes_late(shape):
            return None
        low, high = position_range(states)
        ends = [shape["beyond"], high] if tips_over(shape) else [low, shape["below"]]
        return {"position": ends, "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When the finger runs ahead, or where it stays behind."""
        if comes_late(parameters):
            return (
                f"the finger opens more slowly than its motor: it comes after it by {figure(1e3 * parameters['lag'])} ms "
                "whenever that opens, and closes with it"
            )
        if tips_over(parameters):
            return (
                f"beyond {parameters['beyond']:.1f} % of the encoder's range the finger runs ahead of its motor, by "
                f"{figure(parameters['lead'])} deg after {parameters['over']:.1f} % more"
            )
        if parameters["form"] > 0.5:
            return (
                f"below {parameters['below']:.1f} % of the encoder's range the finger does not follow its motor open: "
                f"it stays bent by {figure(parameters['lead'])} deg more for every %"
            )
        times = (where.get("region") or {}).get("time") or {}
        spans = [(b - a, a, b, trial) for trial, some in times.items() for a, b in some]
        if not spans:
            return "the finger leaves its actuator and runs ahead of it for a while"
        _, begin, end, trial = max(spans)
        longest = "" if len(spans) == 1 else f"{len(spans)} times, longest "
        return (
            f"the finger leaves its actuator and runs ahead of it, {longest}from {begin:.1f} to {end:.1f} s of {trial}"
        )


def tips_over(parameters: Mapping[str, float]) -> bool:
    """Whether a finger leaves its actuator beyond a position."""
    return parameters["form"] == TIPS


def comes_late(parameters: Mapping[str, float]) -> bool:
    """Whether a finger comes open after its actuator, wherever that is."""
    return parameters["form"] == SLOW


def behind(state: DriveState, lag_s: float) -> Array:
    """How far (n,) [position unit] a finger is bent beyond where its actuator lets it: it is pushed closed, and follows
    open with a time constant [s]."""
    step, way = np.diff(state.time_s, prepend=state.time_s[0]), np.diff(state.position, prepend=state.position[0])
    kept = np.exp(-step / lag_s)
    # of a way gone evenly within a step, what is still to go at its end
    share = np.divide(lag_s * (1.0 - kept), step, out=np.ones(len(step)), where=step > 0)
    out, left = np.empty(len(step)), 0.0
    for k, (stays, gone) in enumerate(zip(kept.tolist(), (share * way).tolist(), strict=True)):
        left = max(left * stays - gone, 0.0)
        out[k] = left
    return out


def spans(state: DriveState) -> list[list[float]]:
    """[begin, end] [s of the trial] of every while in which the finger is ahead."""
    here = state.extra.get("ahead", np.zeros(len(state.time_s))) > 0
    return [[float(state.time_s[a]), float(state.time_s[b - 1])] for a, b in runs(here)]


EFFECT = SpringDecoupling()
