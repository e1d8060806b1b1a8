"""A load that sets in within each recording and stays: something was hung on, a spring was moved, a zero was set anew."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure
from .outsider import Outsider, place_in_session


class LoadJump(Outsider):
    """F = A from the same share of each recording on, which begins anew."""

    name = "load_jump"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The moment, as a share of each recording."""
        return (Shape("since", "1", 0.05, 0.95, tuple(np.arange(0.1, 0.95, 0.05).tolist()), edge=True),)

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """The load, either sign."""
        return (("load", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """One from the moment on, (n, 1)."""
        return (place_in_session(state) % 1 >= shape["since"])[:, None].astype(float)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """When and how much."""
        return (
            f"a load of {figure(parameters['load'])} raw sets in {figure(100 * parameters['since'])} % of the way "
            "through each recording, and stays"
        )


EFFECT = LoadJump()
