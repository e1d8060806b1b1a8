"""An angle that sits differently on its encoder from a moment on: a tooth was skipped, a coupling slipped, a cable
settled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import Amplitude, Array, DriveState, Shape, figure
from .outsider import Outsider, of_its_record, place_in_session

RECORDS = 4  # recordings that may each jump by their own


class ZeroJump(Outsider):
    """angle = map(encoder) + A h: h one from a moment on, in the recordings after it too (form 0), or from the same
    share of each recording on, which begins anew (form 1)."""

    name = "zero_jump"
    station = "encoder"
    recorded = True
    part_of = "support_slip"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """The form, and the moment in recordings since the first began, or as a share of each."""
        last = 1.0 + max((place_in_session(s)[0] for s in states), default=0.0)
        starts = tuple(np.arange(0.1, last - 0.05, 0.1).tolist())
        return (
            Shape("form", "1", 0.0, 1.0, (0.0, 1.0)),
            Shape("since", "recordings", 0.05, float(last) - 0.05, starts, edge=True),
        )

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """A share of each recording is below one."""
        return [p for p in super().grid(states) if p["form"] < 0.5 or p["since"] < 0.95]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """A jump, or one for each recording; either sign."""
        return tuple((f"jump_{i}", "effort", -np.inf, np.inf) for i in range(RECORDS))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """One from the moment on, (n, RECORDS)."""
        place = place_in_session(state)
        if shape["form"] < 0.5:
            return (place >= shape["since"])[:, None] * np.eye(1, RECORDS)
        return of_its_record(state, (place % 1 >= shape["since"])[:, None].astype(float), RECORDS)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """By how much at most, and when."""
        most = max((parameters.get(f"jump_{i}", 0.0) for i in range(RECORDS)), key=abs)
        when = f"after {figure(parameters['since'])} recordings"
        if parameters["form"] > 0.5:
            when = f"{figure(100 * parameters['since'])} % of the way through its recordings"
        return f"the segment jumps by {figure(most)} deg against its encoder {when}, and stays there"


EFFECT = ZeroJump()
