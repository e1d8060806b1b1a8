"""What an effect is: the one thing that a contributor adds to teach the tool new physics, one file each.

A module in this folder that defines `EFFECT = SomeEffect()` is found by `effects.catalogue()`; no other edit is needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DriveState:
    """One drive (a motor of a hand, a joint of a rig) during one trial, as an effect sees it.

    time_s: (n,) [s]. position, velocity, acceleration: (n,) in the drive's unit ([%], [rad] or [m], and per second).
    effort: (n,) measured current or torque, raw or SI. declared: (n, k) columns of the declared model.
    extra: further channels by name, (n,) each (setpoint, temperature, supply, transmitted load, command...).
    """

    trial: str
    drive: str
    time_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    declared: Array
    position_unit: str = "%"
    effort_unit: str = "raw"
    extra: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Shape:
    """A nonlinear parameter of an effect: its unit, bounds, and the starting values that a multi-start fit tries."""

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...]


@runtime_checkable
class DriveEffect(Protocol):
    """An effect in the balance effort = declared + columns(state, shape) @ amplitude."""

    name: str
    station: str  # "drive"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Nonlinear parameters, with bounds and starts from the recorded range."""
        ...

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Columns (n, j), linear in their amplitudes, whose sum is the effort that the effect adds."""
        ...

    def amplitudes(self) -> tuple[tuple[str, str, float, float], ...]:
        """Name, unit, lower and upper bound of each amplitude (j of them); bounds carry the sign that physics allows."""
        ...

    def statement(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """One sentence for the report."""
        ...

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Write the effect into an MJCF tree (lxml); the element's path, or None where only the passive callback can."""
        ...
