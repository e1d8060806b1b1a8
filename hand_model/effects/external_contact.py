"""External contact: an object or obstacle touches the finger for a while."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class ExternalContact(Effect):
    """F = k max(0, x - x0) (form 0) or k max(0, x - x0)^2 (form 1) from a moment of one trial on to its end: an elastic
    obstacle that was not always there, met after some free motion. Whether it is still there in validation recordings is for those to say.
    """

    name = "external_contact"
    of_the_hand = False
    unwritten = "an obstacle of one recording is no part of the hand"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Which trial (index into the states), from which share of it on, form, and where the contact begins."""
        low, high = position_range(states)
        span = high - low
        return (Shape("trial", "1", 0.0, len(states) - 1.0, tuple(float(i) for i, s in enumerate(states) if not s.validate)),
                Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
                Shape("since", "1", 0.0, 0.9, (0.0, 0.2, 0.35, 0.5, 0.65, 0.8)),
                Shape("begin", states[0].position_unit, low + 0.08 * span, high - 0.02 * span,
                      tuple(low + span * np.linspace(0.1, 0.9, 9))))

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Stiffness of the contact in that trial, and in validation recordings; never negative."""
        return (("stiffness", "effort/position", 0.0, np.inf), ("stiffness_validation", "effort/position", 0.0, np.inf))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Depth into the contact in that trial and in validation recordings, (n, 2)."""
        depth = np.maximum(state.position - shape["begin"], 0.0)
        if shape["form"] > 0.5:
            depth = depth**2 / 10.0
        index = state.extra.get("trial_index", np.zeros(len(state.time_s)))
        late = state.time_s - state.time_s[0] >= shape["since"] * np.ptp(state.time_s)
        return np.stack([depth * ((index == round(shape["trial"])) & late), depth * float(state.validate)], axis=-1)

    def parameters(self, shape: Mapping[str, float], amplitude: Mapping[str, float],
                   declared: Mapping[str, float]) -> dict[str, float]:
        """Where it begins and how stiff it is."""
        return {"trial": shape["trial"], "since": shape["since"], "begin": shape["begin"], "stiffness": amplitude["stiffness"]}


EFFECT = ExternalContact()
