"""What an effect is: a name of the vocabulary, where it sits, and its laws."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .plan import Plan

JOINTS = ("proximal", "distal")
Settings = dict[str, object]
Law = Callable[[Plan, float, np.random.Generator], Settings]


@dataclass(frozen=True)
class Effect:
    """One effect with one or more laws; ``law(plan, strength, rng)`` puts it in and returns its settings."""

    name: str
    signal: str
    joint: str | None
    laws: tuple[Law, ...]
    joinable: bool = True

    def put(self, plan: Plan, strength: float, rng: np.random.Generator, law: int | None = None) -> Settings:
        """Put this effect into a plan by one of its laws (drawn unless given)."""
        which = int(rng.integers(len(self.laws))) if law is None else law
        return {"law": which} | self.laws[which](plan, strength, rng)


def spread(rng: np.random.Generator, low: float, high: float) -> float:
    """A size drawn log-uniformly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: np.random.Generator) -> float:
    """A random sign."""
    return float(rng.choice([-1.0, 1.0]))


def arrow(rng: np.random.Generator, strength: float, low: float, high: float, unit: float = 1.0) -> np.ndarray:
    """A vector (3,) of any direction, its length drawn log-uniformly in that unit."""
    vector = rng.normal(0, 1, 3)
    return vector * (strength * (spread(rng, low, high) * unit) / np.linalg.norm(vector))


def scaled(scalar: str, low: float, high: float, told: str | None = None, signed: bool = False) -> Law:
    """The law that adds to one scalar of the drive; told: its name in the settings."""

    def law(plan: Plan, strength: float, rng: np.random.Generator) -> Settings:
        size = strength * (either(rng) if signed else 1.0) * spread(rng, low, high)
        plan.add(scalar, size)
        return {told or scalar: size}

    return law


def bump(centre: float, width: float) -> Callable[[np.ndarray], np.ndarray]:
    """A bell over the range: exp(-((q - centre) / width)^2)."""
    return lambda q: np.exp(-(((q - centre) / width) ** 2))
