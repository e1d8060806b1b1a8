"""What every effect's draw needs and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..geometry import log_uniform
from ..hand import Finger, Session

CLEAR, WEAK, TRACE = 1.0, 0.4, 0.1  # strengths


@dataclass
class Drawn:
    """Figures of an effect for the answer; joint and label of the marker where it was drawn with one."""

    figures: dict[str, Any] = field(default_factory=dict)
    joint: int | None = None
    marker: str | None = None


Draw = Callable[[Session, Finger, float, np.random.Generator], Drawn]


@dataclass(frozen=True)
class Effect:
    """How an effect is drawn and put into a session: draw(session, finger, strength, rng), strength 1 clear, 0.4 weak,
    0.1 a trace. family: where it acts; joint: where it always shows; everywhere: belongs to no finger."""

    draw: Draw
    family: str
    joint: str | None = None
    everywhere: bool = False

    @property
    def name(self) -> str:
        """The name of the function that draws it."""
        return self.draw.__name__


def visible_deg(session: Session) -> float:
    """An angle [deg] of a segment that the cameras see well: a marker's noise over an arm of 25 mm."""
    return float(np.clip(2 * np.degrees(session.laboratory.marker_noise / 25.0), 0.4, 1.3))


def clear_angle(session: Session, rng: np.random.Generator) -> float:
    """An angle [deg] of one to two times what is seen well, for what shows in both directions of motion."""
    return visible_deg(session) * log_uniform(rng, 1.1, 2.2)


def clear_load(session: Session, rng: np.random.Generator) -> float:
    """A load [raw] of one to two times the current's noise."""
    return session.laboratory.current_noise * log_uniform(rng, 1.0, 2.0)


def sign(rng: np.random.Generator) -> int:
    """Plus or minus one."""
    return int(rng.choice([-1, 1]))


def shift_mm(session: Session, strength: float, rng: np.random.Generator) -> np.ndarray:
    """A marker's shift, well above its noise."""
    shift = rng.normal(size=3)
    length = strength * max(1.2, 6 * session.laboratory.marker_noise) * log_uniform(rng, 1, 2)
    return shift * (length / np.linalg.norm(shift))
