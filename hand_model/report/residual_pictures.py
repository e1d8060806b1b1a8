"""Pictures of residuals: over position and velocity, and through one variable."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..rig.model import RigModel
from .style import INK, SERIES, drawing

Array = NDArray[np.float64]

CELLS = (28, 20)  # of a map, along position and velocity
BINS = 32
PICTURES = 8  # of one kind, at most


def full_colour(values: Array) -> float:
    """Residual at which colours saturate, of values (n,)."""
    return float(np.percentile(np.abs(values), 95)) or 1.0


def error_by_state(q: Array, v: Array, error: Array, scale: Array, rig: RigModel, joint: str) -> bytes:
    """Mean error (n,) of a joint over its position and velocity (n,); colours as full as `scale` (n,) has them."""
    unit = rig.unit(joint)
    return error_field(q, v, error, full_colour(scale), f"position [{unit}]", f"velocity [{unit}/s]")


def error_field(q: Array, v: Array, error: Array, limit: float, across: str, up: str) -> bytes:
    """Mean error (n,) in cells of q and v (n,), red above and blue below, colours full at limit."""
    sides = [np.linspace(*np.percentile(x, [0.5, 99.5]), n + 1) for x, n in zip((q, v), CELLS, strict=True)]
    total, _, _ = np.histogram2d(q, v, sides, weights=error)
    seen, _, _ = np.histogram2d(q, v, sides)
    mean = np.where(seen > 0, total / np.maximum(seen, 1), np.nan)
    with drawing() as d:
        d.axes.pcolormesh(*sides, mean.T, cmap="RdBu_r", vmin=-limit, vmax=limit)
        d.axes.set_xlabel(across)
        d.axes.set_ylabel(up)
    return d.svg


def before_and_after(x: Array, label: str, before: Array, after: Array, up: str) -> bytes:
    """Residual before and after (n,) against x (n,): mean and middle 80 % in bins."""
    with drawing() as d:
        for values, colour in ((before, SERIES[0]), (after, INK)):
            centre, low, mean, high = _binned(x, values)
            d.axes.fill_between(centre, low, high, color=colour, alpha=0.18, linewidth=0)
            d.axes.plot(centre, mean, color=colour)
        d.axes.set_xlabel(label)
        d.axes.set_ylabel(up)
    return d.svg


def _binned(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Centres of bins with as many samples each, or more where many share a value; tenth percentile, mean and ninetieth
    of y."""
    parts: list[Array] = []
    for part in (p for p in np.array_split(np.argsort(x), BINS) if len(p)):
        if parts and x[part].mean() - x[parts[-1]].mean() < 0.5 * np.ptp(x) / BINS:
            parts[-1] = np.concatenate([parts[-1], part])
        else:
            parts.append(part)
    low, high = (np.array([np.percentile(y[p], k) for p in parts]) for k in (10, 90))
    return np.array([x[p].mean() for p in parts]), low, np.array([y[p].mean() for p in parts]), high


def rms(values: Array) -> float:
    """Root mean square of values (n,), 0 of none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
