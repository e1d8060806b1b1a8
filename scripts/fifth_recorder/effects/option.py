"""One way of hiding one effect: how to put it into a plan at any strength."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fifth_recorder.finger import Finger
from fifth_recorder.lab import Lab
from fifth_recorder.plan import Plan

Figures = dict[str, float | str | list]


@dataclass
class Option:
    """`apply(plan, strength)` hides it and returns its figures there; strength 1 is what an author would type."""

    form: str
    apply: Callable[[Plan, float], Figures]
    joint: str | None = None
    marker: str | None = None
    motor: bool = True  # belongs to an actuator
    drive: bool = False  # shows in how the drive follows its command
    capped: bool = True  # may be made smaller when it dwarfs everything
    beside: Callable[[float], float] | None = None  # nats at a strength that only a comparison with other motors gives


@dataclass
class Context:
    """Where an effect is to be hidden."""

    finger: Finger
    lab: Lab
    poses_differ: bool  # whether the hand is held in another way in every trial


Draw = Callable[[np.random.Generator, Context], Option]


def pick(rng: np.random.Generator, forms: tuple[str, ...]) -> tuple[str, float]:
    """A form and its number."""
    i = int(rng.integers(len(forms)))
    return forms[i], float(i)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def set_dynamics(plan: Plan, strength: float, scaled: dict[str, float], fixed: dict[str, float]) -> Figures:
    """Put figures into the motor's dynamics, those of `scaled` multiplied by the strength."""
    figures = {name: value * strength for name, value in scaled.items()} | fixed
    for name, value in figures.items():
        setattr(plan.dyn, name, value)
    return figures
