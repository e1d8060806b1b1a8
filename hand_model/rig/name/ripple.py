"""Fine ripple: of a screw or a gear that turns many times over a joint's range, the periods that its effort shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..balance import Rows
from ..declared import DeclaredFit

Array = NDArray[np.float64]
SAMPLES = 4  # of the slower motion, at least, in a period that is seen
MOST_WAVES = 2000  # over the range
FINER = 4  # points of the spectrum in the width of a peak
PEAKS = 4  # that are tried


def fine_periods(fit: DeclaredFit, rows: Sequence[Rows], longest: float) -> list[float]:
    """Periods [rad or m] of the highest peaks of the spectrum over position (periodogram, Schuster 1898) of what the
    declared model leaves of the rows' effort, and those beside them, from which their width shows; shorter than
    `longest`, and no shorter than is seen."""
    rows = [r for r in rows if r.moving.any()]
    if not rows:
        return []
    left = [fit.residual(r) for r in rows]
    at = np.concatenate([r.position[:: r.step][r.moving] for r in rows])
    values = np.concatenate([v[r.moving] - np.mean(v[r.moving]) for v, r in zip(left, rows, strict=True)])
    steps = np.concatenate([np.abs(np.diff(r.position[:: r.step]))[r.moving[1:]] for r in rows])
    span = float(np.ptp(at))
    if span <= 0 or not np.any(steps > 0):
        return []
    shortest = max(SAMPLES * float(np.percentile(steps[steps > 0], 25)), span / MOST_WAVES)
    if shortest >= longest:
        return []
    cell = shortest / 4
    sums = np.bincount(((at - at.min()) / cell).astype(int), values)
    size = int(2 ** np.ceil(np.log2(FINER * span / cell)))
    power, waves = np.abs(np.fft.rfft(sums, size)), np.arange(size // 2 + 1) / (size * cell)
    inside = np.flatnonzero((waves > 1 / longest) & (waves < 1 / shortest))
    top = [i for i in inside if power[i] >= power[max(i - FINER, 0) : i + FINER + 1].max()]
    best = sorted(top, key=lambda i: -power[i])[:PEAKS]
    return [float(1 / waves[j]) for i in best for j in (i - 1, i, i + 1) if waves[j] > 0]
