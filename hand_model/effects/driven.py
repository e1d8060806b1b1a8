"""A map whose driver is changed before it: lost motion, a dead band, a stop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .base import Array, DriveState
from .path import strokes

# of the range: distances from its end at which a bound is looked for first, the closer the smaller it is
NEARER = np.geomspace(0.01, 0.45, 14)
LEAST_SLOPE = 0.1  # of the mean: flatter, what follows as good as stands


def driven(state: DriveState, change: Callable[[Array], Array]) -> Array:
    """Declared columns (n, k) with the powers of the driver taken of `change(driver)`, driver in the state's position
    unit.

    The columns "power_0", "power_1", ... are powers of driver / extra["scale"]; further columns stay. Changes follow
    one another: the driver is what the present columns hold.
    """
    if "power_1" not in state.declared_names:
        return state.declared
    scale = state.extra["scale"]
    first = state.declared_names.index("power_1")
    driver = change(state.declared[:, first] * scale) / scale
    out = np.array(state.declared)
    exponents = {
        i: int(name.removeprefix("power_")) for i, name in enumerate(state.declared_names) if name.startswith("power_")
    }
    powers = np.vander(driver, max(exponents.values()) + 1, increasing=True)  # sooner than a power each
    out[:, list(exponents)] = powers[:, list(exponents.values())]
    return out


def play(path: Array, gap: float, threshold: float | None = None) -> Array:
    """Play operator (n,): follows a path half the `gap` [path unit] behind, and stays while the path crosses the gap.

    The gap starts closed on the side from which the first stroke opens it (a hand at rest, pulled open by its spring).
    """
    x = np.asarray(path, float)
    out = np.empty(len(x))
    at = x[0] + 0.5 * gap
    for a, b, d in strokes(x, threshold):
        if d > 0:
            out[a:b] = np.maximum(np.maximum.accumulate(x[a:b]) - 0.5 * gap, at)
        elif d < 0:
            out[a:b] = np.minimum(np.minimum.accumulate(x[a:b]) + 0.5 * gap, at)
        else:
            out[a:b] = at
        end = x[min(b, len(x) - 1)]  # the turning point itself belongs to both strokes
        at = max(out[b - 1], end - 0.5 * gap) if d > 0 else min(out[b - 1], end + 0.5 * gap) if d < 0 else out[b - 1]
    return out


def soft_play(path: Array, gap: float, softness: float) -> Array:
    """Play with give at its ends: the mean of plays of (1 - softness), one and (1 + softness) times the gap."""
    gaps = (gap,) if softness <= 0 else ((1 - softness) * gap, gap, (1 + softness) * gap)
    return np.mean([play(path, g) for g in gaps], axis=0)


def path_behind(state: DriveState, driver: Array) -> tuple[Array, Array]:
    """The path of what follows (n,) by its map, scaled to the driver's unit at the map's mean slope, and how fast it
    goes with the driver (n,), one on the average. driver (n,): what other changes leave of the state's position."""
    order = np.argsort(state.position, kind="stable")
    slope = np.maximum(state.slope, LEAST_SLOPE * mean_slope((state,))) / mean_slope((state,))
    x, rate = state.position[order], slope[order]
    along = x[0] + np.r_[0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(x))]
    if np.allclose(driver, state.position, rtol=1e-9, atol=1e-9 * max(float(np.ptp(x)), 1e-9)):  # nothing changed it
        path = np.empty(len(x))
        path[order] = along
        return path, slope
    return np.interp(driver, x, along), np.interp(driver, x, rate)


def mean_slope(states: tuple[DriveState, ...]) -> float:
    """Slope of the map from one end of the range to the other, in the unit of what follows per driver's unit."""
    position = np.concatenate([s.position for s in states])
    slope = np.concatenate([s.slope for s in states])
    order = np.argsort(position)
    x, y = position[order], slope[order]
    return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)) / max(x[-1] - x[0], 1e-12))


def segment_gap(states: tuple[DriveState, ...], gap: Mapping[str, Any]) -> dict[str, Any]:
    """A gap (value, ci95) of the driver as what follows shows it [deg]: full width, at the map's mean slope."""
    slope = mean_slope(states)
    interval = {"ci95": [slope * x for x in gap["ci95"]]} if "ci95" in gap else {}
    return {"value": slope * gap["value"], "unit": "deg", **interval}
