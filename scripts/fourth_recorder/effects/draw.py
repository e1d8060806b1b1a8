"""What every effect's draw needs and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..geometry import unit
from ..hand import Finger
from ..session import Session

CLEAR, WEAK, TRACE = 1.0, 0.4, 0.1  # strengths


@dataclass(frozen=True)
class Form:
    """Random figures of one effect, each drawn when first asked for and kept while the effect is resized."""

    rng: np.random.Generator
    kept: dict[str, Any] = field(default_factory=dict)

    def keep(self, name: str, draw: Callable[[], Any]) -> Any:
        """What `draw` gave first."""
        if name not in self.kept:
            self.kept[name] = draw()
        return self.kept[name]

    def between(self, name: str, low: float, high: float) -> float:
        """Uniform."""
        return self.keep(name, lambda: float(self.rng.uniform(low, high)))

    def sign(self, name: str) -> float:
        """Plus or minus one."""
        return self.keep(name, lambda: 1.0 if self.rng.random() < 0.5 else -1.0)

    def index(self, name: str, count: int) -> int:
        """0 to count - 1."""
        return self.keep(name, lambda: int(self.rng.integers(count)))

    def direction(self, name: str) -> tuple[float, float, float]:
        """A unit vector."""
        return self.keep(name, lambda: tuple(float(value) for value in unit(self.rng.normal(0, 1, 3))))


@dataclass(frozen=True)
class Site:
    """Where an effect is drawn and how large: size 1 as it comes."""

    session: Session
    finger: Finger
    size: float
    form: Form


@dataclass(frozen=True)
class Drawn:
    """Fields that an effect sets of motor.Motor, hidden.LinkageFaults, hidden.LogFaults and hidden.MarkerFaults; figures
    for the answer, joint (0 proximal, 1 distal) and label of the marker where it was drawn with one."""

    motor: dict[str, float] = field(default_factory=dict)
    linkage: dict[str, Any] = field(default_factory=dict)
    log: dict[str, Any] = field(default_factory=dict)
    markers: dict[str, Any] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)
    joint: int | None = None
    marker: str | None = None


@dataclass(frozen=True)
class Effect:
    """How an effect is drawn. channel: where it shows and is sized by, current, motion or markers; joint: where it
    always shows; driven: belongs to an actuator."""

    draw: Callable[[Site], Drawn]
    channel: str
    joint: str | None = None
    driven: bool = True

    @property
    def name(self) -> str:
        """The name of the function that draws it."""
        return self.draw.__name__


def of_motor(**changes: float) -> Drawn:
    """An effect of the motor alone, whose figures are its fields."""
    return Drawn(motor=changes, figures=dict(changes))


def of_linkage(**changes: float) -> Drawn:
    """An effect of the linkage alone, whose figures are its fields."""
    return Drawn(linkage=changes, figures=dict(changes))
