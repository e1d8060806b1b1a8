"""A reading whose scale jumps within each recording: an amplifier changes its range, a supply drops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, figure
from .load_jump import LoadJump


class GainJump(LoadJump):
    """The declared effort times A from the same share of each recording on, which begins anew."""

    name = "gain_jump"

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Relative change, either sign."""
        return (("change", "1", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """What the declared model requires, from the moment on, (n, 1)."""
        if "required" not in state.extra:
            return np.zeros((len(state.time_s), 0))
        return super().columns(state, shape) * state.extra["required"][:, None]

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When, and by how much all readings change."""
        return (
            f"all of the current changes by {100 * parameters['change']:+.0f} % {figure(100 * parameters['since'])} % of "
            "the way through each recording: its scale does, not the friction alone"
        )


EFFECT = GainJump()
