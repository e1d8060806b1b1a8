"""Spring decoupling: the finger leaves its actuator against the spring (weight, external flexion)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range
from .path import runs


class SpringDecoupling(Effect):
    """The finger runs ahead of its actuator: for a while, wherever it is, or in every cycle near the open end."""

    name = "spring_decoupling"
    station = "encoder"
    unwritten = (
        "the finger runs ahead under a force from outside, which no recording holds; the compiled push tendon lets it"
    )

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """form 0: for a while, "ahead" in `extra`; form 1: below an encoder position, at which the finger stays
        behind."""
        low, high = position_range(states)
        span = high - low
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape(
                "below",
                states[0].position_unit,
                low + 0.01 * span,
                low + 0.6 * span,
                tuple(low + span * np.linspace(0.03, 0.5, 12)),
            ),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """One start for what passes, several for the open end."""
        below = self.shapes(states)[1].starts
        return [{"form": 0.0, "below": below[0]}, *({"form": 1.0, "below": b} for b in below)]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Share of the seen excursion (form 0), or angle per position that the finger stays behind (form 1)."""
        return (("lead", "1", 0.0, np.inf),)

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Of how far it stays behind for each unit of position."""
        return {"lead": "effort/position"} if shape["form"] > 0.5 else {}

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The excursions, or max(0, below - x), (n, 1)."""
        if shape["form"] == 0.0:
            return state.extra.get("ahead", np.zeros(len(state.time_s)))[:, None]
        return np.maximum(shape["below"] - state.position, 0.0)[:, None]

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """The whiles [s] by trial, or from the open end to where it follows again."""
        if shape["form"] == 0.0:
            return {"time": {s.trial: spans(s) for s in states if spans(s)}, "unit": "s"}
        low, _ = position_range(states)
        return {"position": [low, shape["below"]], "unit": states[0].position_unit}

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When the finger runs ahead, or where it stays behind."""
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


def spans(state: DriveState) -> list[list[float]]:
    """[begin, end] [s of the trial] of every while in which the finger is ahead."""
    here = state.extra.get("ahead", np.zeros(len(state.time_s))) > 0
    return [[float(state.time_s[a]), float(state.time_s[b - 1])] for a, b in runs(here)]


EFFECT = SpringDecoupling()
