"""Readings that pile up at the largest of them: there the reading clips, whatever it is of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .base import Array

FINE = 1.5  # steps of the reading, at least, is its noise: coarser, any reading may be the largest for a while
NEAR = 0.25  # of the noise, below the largest reading: over so much of it the density of readings hardly changes
FEWEST = 1.0  # readings of one size that are expected, at least


def piled_up(readings: Sequence[Array]) -> float:
    """Log odds that recordings (n,) of one channel clip at their largest reading: how unlikely chance alone would have so
    many of that size. Noise smears the density of readings, so that just below the largest there are as many to a step as
    at it, or more, at the next step, too (Poisson); what stands still counts once. Zero where that is not told."""
    known = [k for r in readings if len(k := r[np.isfinite(r)]) > 1]
    sizes = np.unique(np.concatenate(known)) if known else np.zeros(1)
    if len(sizes) < 2:
        return 0.0
    step = float(np.diff(sizes).min())
    noise = float(np.median(np.abs(np.concatenate([np.diff(r) for r in known])))) / 0.6745 / np.sqrt(2)
    if noise < FINE * step:
        return 0.0
    changed = np.concatenate([r[np.r_[True, r[1:] != r[:-1]]] for r in known])
    largest, steps = changed.max(), max(round(NEAR * noise / step), 1)
    below = np.round((largest - changed) / step)
    expected = max(np.sum((below >= 1) & (below <= steps)) / steps, np.sum(below == 1), FEWEST)
    from scipy.stats import poisson

    return -float(poisson.logsf(int(np.sum(below == 0)) - 2, expected))  # one reading is the largest, anyhow
