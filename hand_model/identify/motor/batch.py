"""The moves that are simulated at once: what is commanded, where every drive starts, when nothing sudden happens."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .grid import NEVER

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moves:
    """Moves from rest, one per entry (B,): start_s of the command after the move's own zero [s], origin and target [%],
    speed [share of full], limit [raw], position [%] and current hold [raw] at rest, duration_s [s], velocity [%/s] of a
    drive that creeps within its deadband; when it may be simulated in long steps [s]: from when on it cruises, until
    when, and from when on it rests."""

    start_s: Array
    origin: Array
    target: Array
    speed: Array
    limit: Array
    position: Array
    hold: Array
    duration_s: Array
    velocity: Array | float = 0.0
    cruise_s: Array | float = NEVER
    stop_s: Array | float = NEVER
    rest_s: Array | float = NEVER

    def some(self, columns: NDArray[np.int64]) -> Moves:
        """The moves of these columns."""
        every = (getattr(self, f.name) + np.zeros(len(self.target)) for f in dataclasses.fields(self))
        return Moves(*(x[columns] for x in every))
