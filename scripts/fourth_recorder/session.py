"""What one session is recorded with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .hand import Hand, draw_hand
from .laboratory import Laboratory, draw_laboratory


@dataclass(frozen=True)
class Session:
    """seed: of everything drawn; dead_current [raw]: what a current that is not measured reads."""

    seed: int
    laboratory: Laboratory
    hand: Hand
    dead_current: float


def draw_session(rng: np.random.Generator, kind: str, seed: int) -> Session:
    """Laboratory and healthy hand."""
    laboratory = draw_laboratory(rng, kind)
    hand = draw_hand(rng, laboratory)
    return Session(seed, laboratory, hand, float(rng.choice([0, 0, 1, 3])))
