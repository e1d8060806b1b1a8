"""Joint wobble: a second, smaller rotation about another axis; seen in the markers by `diagnose.markers`."""

from __future__ import annotations

from .base import Amplitude, Effect


class JointWobble(Effect):
    """The segment tilts across its axis as the angle grows."""

    name = "joint_wobble"
    station = "markers"
    unwritten = "its size is kept in hand.json; over which course of the angle it tilts is not, so no joint is written"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """None: no balance holds it."""
        return ()


EFFECT = JointWobble()
