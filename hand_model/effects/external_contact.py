"""External contact: an object or obstacle touches the finger for a while."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range

SINCE, UNTIL, SHORTEST = (0.0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8), (0.35, 0.5, 0.65, 0.8, 0.9, 1.0), 0.15  # starts
# share of each recording, or of the session: what is there for longer in all of them is a spring or a stop
LASTING = 0.85
# instead of the number of a trial: the while is one of the whole session; it is the same one of every trial; the same
# one of those trials that have it, with a stiffness in each
ALL, EACH, SOME = -1.0, -2.0, -3.0
MOST_TRIALS = 8  # recordings in which an obstacle can still be told each on its own
THERE = 0.1  # of the stiffest: less, and that one has none


class ExternalContact(Effect):
    """F = k max(0, x - x0) (form 0) or k max(0, x - x0)^2 (form 1) for a while of one trial, of every trial or of the
    session: an elastic obstacle that was not always there, met after some free motion. Whether it is there in
    validation recordings is for each of those to say.
    """

    name = "external_contact"
    drifting = True
    repeats = True  # in another trial
    of_the_hand = False
    recorded = True
    unwritten = "an obstacle of one recording is no part of the hand"

    def __init__(self, several: bool = True) -> None:
        """several: whether one while of every recording, or of the session, may have it, beside those of one alone."""
        self.several = several

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Which trial (index into the states; ALL of them as one, EACH of them), from and until which share of it,
        form, and where the contact begins."""
        low, high = position_range(states)
        span = high - low
        trials = tuple(float(i) for i, s in enumerate(states) if not s.validate)
        every: tuple[float, ...] = (EACH, ALL) if all("session_s" in s.extra for s in states) else (EACH,)
        if len(trials) < 2 or not self.several:
            every = ()
        elif 2 < len(trials) and len(states) <= MOST_TRIALS:
            every = (*every, SOME)
        return (
            Shape("trial", "1", SOME, len(states) - 1.0, (*trials, *every)),
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape("since", "1", 0.0, 0.9, SINCE, edge=True),
            Shape("until", "1", 0.1, 1.0, UNTIL, edge=True),
            Shape(
                "begin",
                states[0].position_unit,
                low + 0.08 * span,
                high - 0.02 * span,
                tuple(low + span * np.linspace(0.1, 0.9, 9)),
            ),
        )

    def apart(self) -> ExternalContact:
        """The same, each of one recording: some may have it and others not."""
        return type(self)(several=False)

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Every start of trial and place, in the first form, in whiles that are neither short nor all of the trial."""
        return [
            point
            for point in super().grid(states)
            if point["form"] < 0.5 and point["until"] - point["since"] > SHORTEST and not self._all_along(point)
        ]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Stiffness of the contact in that trial, or in all; in each validation recording, or in each of those of which
        some have it; never negative."""
        names = ("stiffness", *(f"stiffness_trial_{i}" for i in range(MOST_TRIALS)))
        return tuple((name, "effort/position", 0.0, np.inf) for name in names)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Depth into the contact in that trial or in all, and in each recording of its own, (n, 1 + MOST_TRIALS); none of
        what is there in all of them nearly all along."""
        out = np.zeros((len(state.time_s), 1 + MOST_TRIALS))
        index = state.extra.get("trial_index", np.zeros(len(state.time_s)))[0]
        every, mine, own_column = shape["trial"] < 0, index == round(shape["trial"]), 1 + int(index) % MOST_TRIALS
        if not (every or mine or state.validate) or self._all_along(shape):
            return out
        depth = np.maximum(state.position - shape["begin"], 0.0)
        if shape["form"] > 0.5:
            depth = depth**2 / 10.0
        own = (state.time_s - state.time_s[0]) / max(float(np.ptp(state.time_s)), 1e-9)
        share = state.elapsed_s / state.extra["session_s"] if shape["trial"] == ALL else own
        within = depth * ((share >= shape["since"]) & (share <= shape["until"]))
        if mine or (every and not state.validate):
            out[:, own_column if shape["trial"] == SOME else 0] = within
        if state.validate:
            out[:, own_column] = within if every else depth
        return out

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """When it is there, where it begins and how stiff it is: over the first 10 of the position's unit, of either
        form; of some recordings the mean of those that have it."""
        each = [amplitude.get(f"stiffness_trial_{i}", 0.0) for i in range(MOST_TRIALS)]
        there = [k for k in each if k > THERE * max(each)]
        return {
            "trial": shape["trial"],
            "form": shape["form"],
            "since": shape["since"],
            "until": shape["until"],
            "begin": shape["begin"],
            "stiffness": amplitude["stiffness"] if shape["trial"] != SOME else float(np.mean(there or [0.0])),
        }

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When, from where on, and the load a tenth of the range further (of either form the same)."""
        trials, index = where.get("trials") or (), round(parameters["trial"])
        several = {ALL: "the session", EACH: "every recording", SOME: "some recordings"}
        name = several.get(parameters["trial"]) or (trials[index] if 0 <= index < len(trials) else "one recording")
        since, until = (round(100 * parameters[k]) for k in ("since", "until"))
        part = "" if since <= 0 and until >= 100 else f", {since} to {until} % of the way through"
        return (
            f"in {name}{part}, the finger meets an elastic obstacle at {parameters['begin']:.1f} %: "
            f"10 % further it takes {figure(10 * parameters['stiffness'])} raw more current"
        )

    def _all_along(self, shape: Mapping[str, float]) -> bool:
        """Whether it is there for so long that it is none."""
        return shape["trial"] < 0 and shape["until"] - shape["since"] > LASTING


EFFECT = ExternalContact()
