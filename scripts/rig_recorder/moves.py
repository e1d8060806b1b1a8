"""Motions that a bench asks for, on the grid of its controller, and the controllers that follow them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TICK_S = 1e-3


def sines(seconds: float, amplitude: float, rate_hz: float, random: np.random.Generator, count: int = 3) -> Array:
    """A sum of sines (n,) that starts at zero, of about the given amplitude."""
    t = np.arange(0, seconds + 1, TICK_S)
    rates, phases = rate_hz * random.uniform(0.4, 1.6, count), random.uniform(0, 2 * np.pi, count)
    sizes = random.uniform(0.4, 1.0, count) / rates**0.5
    out = sum(s * np.sin(2 * np.pi * r * t + p) for s, r, p in zip(sizes, rates, phases, strict=True))
    return amplitude * np.clip(t / 0.7, 0, 1) * out / np.abs(out).max()


def cycles(seconds: float, low: float, high: float, period_s: float, share: float) -> Array:
    """Strokes there and back (n,) with accelerations that take a share of each stroke."""
    t = np.arange(0, seconds + 1, TICK_S)
    phase = (t / period_s) % 1.0
    stroke = np.where(phase < 0.5, 2 * phase, 2 - 2 * phase)
    x = np.clip((stroke - 0.05) / 0.9, 0, 1)
    ramp = np.where(
        x < share, x**2 / (2 * share), np.where(x > 1 - share, 1 - share - (1 - x) ** 2 / (2 * share), x - share / 2)
    )
    return low + (high - low) * ramp / (1 - share)


def steps(seconds: float, amplitude: float, random: np.random.Generator) -> Array:
    """Smoothed moves between places (n,), with pauses."""
    t = np.arange(0, seconds + 1, TICK_S)
    out, at, begin = np.zeros(len(t)), 0.0, 0.2
    while begin < seconds:
        to, takes = amplitude * random.uniform(-1, 1), random.uniform(0.4, 1.2)
        x = np.clip((t - begin) / takes, 0, 1)
        out += (to - at) * x**2 * (3 - 2 * x)
        at, begin = to, begin + takes + random.uniform(0.1, 0.8)
    return out


def growing(seconds: float, amplitude: float, rate_hz: float) -> Array:
    """A sine of time squared (n,)."""
    t = np.arange(0, seconds + 1, TICK_S)
    return amplitude * np.sin(2 * np.pi * rate_hz * t**2 / seconds)


def follow(target: Array, stiffness: float, damping: float, limit: float) -> Callable[[int, float, float], float]:
    """A proportional and derivative controller with a limit."""
    rate = np.gradient(target, TICK_S)

    def control(tick: int, q: float, v: float) -> float:
        return min(max(stiffness * (target[tick] - q) + damping * (rate[tick] - v), -limit), limit)

    return control


def play(values: Array) -> Callable[[int, float, float], float]:
    """Inputs over time, whatever the motion."""
    return lambda tick, q, v: values[tick]
