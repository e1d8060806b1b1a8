"""What an effect does from one step to the next: the law that a simulation applies where MJCF has no element for it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Moment:
    """One instant of a drive. time_s: since the simulation began [s]. step_s: since the last instant [s], zero where
    the same instant is asked again. position [%], velocity [%/s]. direction: of friction in [-1, 1], a bristle of
    length `give` [%].
    load: what the motor delivers [raw]. gravity_along, gravity_across: in the plane of the finger's first joint, along
    the open finger and where flexion takes it [m/s^2]. Of a follower: position in the driver's unit [%] or [deg], slope
    of its map there [rad per that unit]."""

    time_s: float
    step_s: float
    position: float
    velocity: float
    direction: float
    give: float
    load: float
    gravity_along: float
    gravity_across: float
    slope: float = 0.0


# Returns the effort [raw] that the drive must deliver beyond its declared model, or, from an effect of the stations
# "encoder" and "linkage", the angle [rad] by which the follower departs from its map.
Law = Callable[[Moment], float]


class Bristle:
    """Dahl friction state in [-1, 1], step by step: dz/ds = (1 - z sign(ds)) / length, exact for each step (Dahl
    1968)."""

    def __init__(self, length: float) -> None:
        self.length, self.state, self.last = max(length, 1e-9), 0.0, math.nan

    def __call__(self, position: float) -> float:
        """The state after the path has come to `position` [same unit as the length]."""
        moved = 0.0 if math.isnan(self.last) else position - self.last
        self.last = position
        if moved:
            way = math.copysign(1.0, moved)
            self.state = way + (self.state - way) * math.exp(-abs(moved) / self.length)
        return self.state


class Followed:
    """What follows a value behind a first-order low pass, step by step."""

    def __init__(self, lag_s: float) -> None:
        self.lag_s, self.state = lag_s, math.nan

    def __call__(self, value: float, step_s: float) -> float:
        """As much of it as there is by this moment."""
        if math.isnan(self.state) and step_s == 0:  # nothing has been simulated yet, and no load computed
            return value
        before = value if math.isnan(self.state) else self.state
        self.state = value + (before - value) * math.exp(-step_s / self.lag_s)
        return self.state
