"""External contact: an object or obstacle touches the finger for a while."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure, position_range

SINCE, UNTIL, SHORTEST = (0.0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8), (0.35, 0.5, 0.65, 0.8, 0.9, 1.0), 0.15  # starts
# share of each recording, or of the session: what is there for longer in all of them is a spring or a stop
LASTING = 0.85
# instead of the number of a trial: the while is one of the whole session; it is the same one of every trial; from SOME
# downwards the same one of several trials, of each whose number is a bit of the difference
ALL, EACH, SOME = -1.0, -2.0, -3.0
MOST_SOME = 4  # trials of which any may have it
MOST_VALIDATION = 4  # validation recordings in which an obstacle can still be told


class ExternalContact(Effect):
    """F = k max(0, x - x0) (form 0) or k max(0, x - x0)^2 (form 1) for a while of one trial, of every trial or of the
    session: an elastic obstacle that was not always there, met after some free motion. Whether it is there in
    validation recordings is for each of those to say.
    """

    name = "external_contact"
    drifting = True
    held = 2 * MOST_VALIDATION
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
        elif len(trials) <= MOST_SOME:
            every = (*every, *(SOME - sum(2**t for t in some) for some in _several(trials)))
        return (
            Shape("trial", "1", min((*trials, *every)), len(states) - 1.0, (*trials, *every)),
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
        """Stiffness of the contact in that trial, and in each validation recording, for the same while of it and, of one
        that is still there, for all of it; never negative."""
        return (
            ("stiffness", "effort/position", 0.0, np.inf),
            *((f"stiffness_validation_{i}", "effort/position", 0.0, np.inf) for i in range(MOST_VALIDATION)),
            *((f"stiffness_still_{i}", "effort/position", 0.0, np.inf) for i in range(MOST_VALIDATION)),
        )

    def acts(self, state: DriveState, shape: Mapping[str, float]) -> bool:
        """In its trials and in validation recordings; nowhere, where it is there in all of them nearly all along."""
        return (state.validate or _has(shape["trial"], _index(state))) and not self._all_along(shape)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Depth into the contact in that trial and in each validation recording, (n, 1 + 2 MOST_VALIDATION)."""
        out = np.zeros((len(state.time_s), 1 + 2 * MOST_VALIDATION))
        if not self.acts(state, shape):
            return out
        several, mine = shape["trial"] < 0, _has(shape["trial"], _index(state))
        depth = np.maximum(state.position - shape["begin"], 0.0)
        if shape["form"] > 0.5:
            depth = depth**2 / 10.0
        own = (state.time_s - state.time_s[0]) / max(float(np.ptp(state.time_s)), 1e-9)
        share = state.elapsed_s / state.extra["session_s"] if shape["trial"] == ALL else own
        within = depth * ((share >= shape["since"]) & (share <= shape["until"]))
        if mine and not (several and state.validate):
            out[:, 0] = within
        if state.validate:
            rank = int(state.extra.get("validation_index", np.zeros(1))[0]) % MOST_VALIDATION
            out[:, 1 + rank] = within
            if not several:
                out[:, 1 + MOST_VALIDATION + rank] = depth
        return out

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """When it is there, where it begins and how stiff it is: over the first 10 of the position's unit, of either
        form."""
        return {
            "trial": shape["trial"],
            "form": shape["form"],
            "since": shape["since"],
            "until": shape["until"],
            "begin": shape["begin"],
            "stiffness": amplitude["stiffness"],
        }

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When, from where on, and the load a tenth of the range further (of either form the same)."""
        trials, index = where.get("trials") or (), round(parameters["trial"])
        several = {ALL: "the session", EACH: "every recording"}
        some = [name for i, name in enumerate(trials) if index <= SOME and _has(index, i)]
        name = several.get(parameters["trial"]) or ", ".join(some or trials[max(index, 0) :][:1]) or "one recording"
        since, until = (round(100 * parameters[k]) for k in ("since", "until"))
        part = "" if since <= 0 and until >= 100 else f", {since} to {until} % of the way through"
        return (
            f"in {name}{part}, the finger meets an elastic obstacle at {parameters['begin']:.1f} %: "
            f"10 % further it takes {figure(10 * parameters['stiffness'])} raw more current"
        )

    def _all_along(self, shape: Mapping[str, float]) -> bool:
        """Whether it is there for so long that it is none."""
        return shape["trial"] < 0 and shape["until"] - shape["since"] > LASTING


def _several(trials: tuple[float, ...]) -> list[tuple[int, ...]]:
    """Every choice of at least two of them and not of all."""
    numbers = [round(t) for t in trials]
    return [some for k in range(2, len(numbers)) for some in combinations(numbers, k)]


def _index(state: DriveState) -> int:
    """Number of a recording among those of its balance, 0 where that is not told."""
    return int(state.extra["trial_index"][0]) if "trial_index" in state.extra else 0


def _has(trial: float, index: int) -> bool:
    """Whether the trial of that index is among those that a shape's `trial` means."""
    chosen = round(trial)
    return chosen == index or chosen in (ALL, EACH) or chosen <= SOME and bool(round(SOME - trial) >> index & 1)


EFFECT = ExternalContact()
