"""An encoder whose scale changes: from a moment on its counts are worth another angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure
from .outsider import Outsider, place_in_session


class ScaleChange(Outsider):
    """angle = map(encoder (1 + A h)), h one from a moment on, in the recordings after it too: a magnet or a gear has
    slipped."""

    name = "scale_change"
    station = "encoder"
    recorded = True

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The moment, in recordings since the first began."""
        last = 1.0 + max((place_in_session(s)[0] for s in states), default=0.0)
        return (
            Shape("since", "recordings", 0.05, float(last) - 0.05, tuple(np.arange(0.1, last - 0.05, 0.1).tolist())),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Relative change, either sign."""
        return (("change", "1", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """How far the segment goes with what the encoder has counted, from then on, (n, 1)."""
        return ((place_in_session(state) >= shape["since"]) * state.slope * state.position)[:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """By how much."""
        return (
            f"the encoder's scale changes by {100 * parameters['change']:+.1f} % after "
            f"{figure(parameters['since'])} recordings"
        )


EFFECT = ScaleChange()
