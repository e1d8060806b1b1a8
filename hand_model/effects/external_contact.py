"""External contact: an object or obstacle touches the finger in one trial."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, position_range


class ExternalContact(Effect):
    """F = k max(0, x - x0) in that trial only: an elastic obstacle that was not always there."""

    name = "external_contact"
    of_the_hand = False
    unwritten = "an obstacle of one recording is no part of the hand"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Which trial (index into the states) and where the contact begins."""
        low, high = position_range(states)
        span = high - low
        return (Shape("trial", "1", 0.0, len(states) - 1.0, tuple(float(i) for i in range(len(states)))),
                Shape("begin", states[0].position_unit, low + 0.02 * span, high - 0.02 * span,
                      tuple(low + span * np.linspace(0.1, 0.9, 9))))

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Stiffness of the contact, never negative."""
        return (("stiffness", "effort/position", 0.0, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Depth into the contact, (n, 1), zero in other trials."""
        here = state.extra.get("trial_index", np.zeros(len(state.time_s))) == round(shape["trial"])
        return np.where(here, np.maximum(state.position - shape["begin"], 0.0), 0.0)[:, None]


EFFECT = ExternalContact()
