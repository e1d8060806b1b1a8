"""Shapes shared by effects: bumps in one part of the range, periodic waves, play (backlash) operators."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BUMPS = ("gaussian", "trapezoid", "cosine")
WAVES = ("sine", "triangle", "harmonic")


def bump(form: str, centre: float, width: float) -> Callable[[float], float]:
    """A bump of height one; width: the standard deviation of the Gaussian, and half the base's half width of the
    others.
    """

    def gaussian(x: float) -> float:
        return math.exp(-0.5 * ((x - centre) / width) ** 2)

    def trapezoid(x: float) -> float:
        return max(0.0, min(1.0, 2.0 - abs(x - centre) / width))

    def cosine(x: float) -> float:
        away = abs(x - centre) / (2.0 * width)
        return 0.5 + 0.5 * math.cos(math.pi * away) if away < 1.0 else 0.0

    return {"gaussian": gaussian, "trapezoid": trapezoid, "cosine": cosine}[form]


def wave(form: str, phase_rad: float) -> Callable[[float], float]:
    """A periodic function of an angle [rad], of amplitude about one."""

    def sine(x: float) -> float:
        return math.sin(x + phase_rad)

    def triangle(x: float) -> float:
        return 2.0 / math.pi * math.asin(math.sin(x + phase_rad))

    def harmonic(x: float) -> float:
        return 0.85 * math.sin(x + phase_rad) + 0.4 * math.sin(2.0 * x + 2.3 * phase_rad)

    return {"sine": sine, "triangle": triangle, "harmonic": harmonic}[form]


def play(path: Array, gap: float) -> Array:
    """Lost motion: follows a path (n,) upwards `gap` late and downwards at once; the gap starts closed on the lower
    side.
    """
    out = np.empty_like(path)
    at = float(path[0])
    for i, x in enumerate(path.tolist()):
        at = min(max(at, x - gap), x)
        out[i] = at
    return out


def soft_play(path: Array, gap: float) -> Array:
    """Lost motion with give at its ends: the mean of plays of a half, one and three halves of the gap."""
    return (play(path, 0.5 * gap) + play(path, gap) + play(path, 1.5 * gap)) / 3.0
