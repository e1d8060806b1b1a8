"""The noise of position and current, from the recording alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...session import resolution
from .moves import BEFORE, moves_from_rest
from .recording import MotorTrial

Array = NDArray[np.float64]

ROUNDED = 0.3  # standard deviation of what rounding leaves, over its step: 1 / sqrt(12)
SHARPEST = 2e-5  # of its range: a reading that stands still at rest has some error all the same


def white_noise(values: Array, time_s: Array) -> float:
    """Standard deviation of white noise on a smooth signal (n,): from each sample's distance to the line of its
    neighbours.

    Rice's difference estimator for irregular times, by the median, so that jumps do not count.
    """
    t0, t1, t2 = time_s[:-2], time_s[1:-1], time_s[2:]
    w = (t1 - t0) / (t2 - t0)
    d = (values[1:-1] - (1 - w) * values[:-2] - w * values[2:]) / np.sqrt(1 + (1 - w) ** 2 + w**2)
    return float(1.4826 * np.median(np.abs(d)))


def reading_noise(readings: Sequence[tuple[Array, Array]]) -> float:
    """Standard deviation of a channel's white noise, the median of its recordings, and no less than rounding leaves.

    readings: values and times (n,) [s] of each recording.
    """
    noise = float(np.median([white_noise(values, time_s) for values, time_s in readings]))
    steps = [step for values, _ in readings if (step := resolution(values)) > 0]
    rounded = ROUNDED * min(steps, default=0.0)
    return max(noise, rounded, SHARPEST * max(float(np.ptp(values)) for values, _ in readings))


def rest_noise(trials: Sequence[MotorTrial], sigma: tuple[float, float], speed_full: float) -> float:
    """Standard deviation of the current [raw] while the drive rests before a command, 0 with fewer than four rests.

    Noise with a memory is more than its differences show.
    """
    rests = []
    for t in trials:
        for m in moves_from_rest(t, sigma, speed_full):
            held = t.current[max(0, m.index - BEFORE + 1) : m.index]
            if len(held) >= 8:
                rests.append(float(np.var(held, ddof=1)))
    return float(np.sqrt(np.median(rests) * 1.07)) if len(rests) >= 4 else 0.0
