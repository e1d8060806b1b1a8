"""Moving centre: the centre of rotation travels with the angle; seen in the markers by `diagnose.markers`."""

from __future__ import annotations

from .base import Amplitude, Effect


class MovingCentre(Effect):
    """The segment is shifted across its axis as the angle grows (a rolling or a cam joint, wear)."""

    name = "moving_centre"
    station = "markers"
    unwritten = "its size is kept in hand.json; over which course of the angle it travels is not, so no joint is written"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """None: no balance holds it."""
        return ()


EFFECT = MovingCentre()
