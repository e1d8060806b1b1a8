"""What an effect is: a draw of a law in a context, and how that law is hidden at an amplitude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sixth_recorder.finger import Finger
from sixth_recorder.lab import Lab
from sixth_recorder.machine import Machine
from sixth_recorder.plant import Q_GRID

SHARE = np.clip(Q_GRID, -10, 110) / 100  # of the range, over Q_GRID


@dataclass
class Law:
    """One variant of one effect: `hide(machine, amplitude)` puts it in.

    parameters: for the answers; start, most: the first amplitude to try and the largest plausible one; channel: where
    it is seen, if not where the effect's other variants are."""

    parameters: dict[str, Any]
    hide: Callable[[Machine, float], None]
    start: float
    most: float
    channel: str | None = None


class Context:
    """Where an effect is to be hidden, and what to draw with.

    alone: nothing else is hidden; coulomb: the finger's Coulomb friction, raw; flexions: trials with marker files."""

    def __init__(self, lab: Lab, finger: Finger, rng: np.random.Generator, alone: bool = True) -> None:
        self.lab, self.finger, self.rng, self.alone = lab, finger, rng, alone
        self.p = finger.plant.p
        self.coulomb = self.p["FC"]
        self.trials = [trial for trial in lab.trials if trial["finger"] == finger.name]
        self.flexions = [trial for trial in self.trials if trial["mocap"]]

    def uniform(self, low: float, high: float) -> float:
        """A number between two."""
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """A number between two whose logarithm is uniform."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def pick(self, *options: Any) -> Any:
        """One of the options."""
        return options[int(self.rng.integers(len(options)))]

    def sign(self) -> int:
        """1 or -1."""
        return int(self.rng.choice([-1, 1]))

    def direction(self, weights: tuple[float, float, float] = (1, 1, 1)) -> np.ndarray:
        """A unit vector at random."""
        d = self.rng.normal(size=3) * weights
        return d / np.linalg.norm(d)


Draw = Callable[[Context], Law]


def bump(kind: str, x: np.ndarray) -> np.ndarray:
    """0..1 over the distance x from the middle, in half widths."""
    match kind:
        case "gaussian":
            return np.exp(-0.5 * x**2)
        case "raised_cosine":
            return np.where(abs(x) < 2, 0.5 + 0.5 * np.cos(np.pi * x / 2), 0)
        case "box":
            return 1 / (1 + np.exp(np.clip((abs(x) - 1.25) * 9, -60, 60)))
        case "triangle":
            return np.clip(1 - abs(x) / 2.2, 0, None)
    raise ValueError(kind)
