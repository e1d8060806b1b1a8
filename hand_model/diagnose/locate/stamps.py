"""Time stamps of a log against its own motion: a row's time must be the time at which its position was read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...session import Log

REACH = 12  # samples on either side over which a cruise is judged
CRUISE = 0.3  # of the fastest speed; and of the speed: how far the halves of a cruise may differ
BELIEVED = 0.5  # share of the variation of time steps that must be in the motion too
FEWEST = 100  # steps within cruises


@dataclass(frozen=True)
class Stamps:
    """followed: share of the variation of the time steps that the motion follows (slope of travel over speed against
    time step;
    1 where stamps are right), sd its standard deviation. wrong_s: standard deviation of a stamp's error [s]."""

    followed: float
    sd: float
    wrong_s: float

    @property
    def believed(self) -> bool:
        """False where clearly less than half of the variation of the time steps is real."""
        return self.followed + 3 * self.sd > BELIEVED


def stamps(logs: Sequence[Log]) -> Stamps | None:
    """Judge the stamps of a drive's logs in its cruises; None where there are too few, or time steps do not vary.

    At constant speed the travel between two rows is speed times the time between them. Where stamps are given in
    packets or by another process, travel does not know of their steps: the slope of a regression falls (errors in
    variables, attenuation).
    """
    steps, travels = [], []
    for log in logs:
        counts = log.column("position")
        seen = np.isfinite(counts) & np.isfinite(log.time_s) & np.r_[True, np.diff(log.time_s) > 0]
        t, x = log.time_s[seen], counts[seen]
        if len(t) < 4 * REACH:
            continue
        i = np.arange(REACH, len(t) - REACH - 1)
        speed = (x[i + REACH + 1] - x[i - REACH]) / (t[i + REACH + 1] - t[i - REACH])
        before, after = (
            (x[i] - x[i - REACH]) / (t[i] - t[i - REACH]),
            (x[i + REACH + 1] - x[i + 1]) / (t[i + REACH + 1] - t[i + 1]),
        )
        cruise = (np.abs(speed) > CRUISE * np.quantile(np.abs(speed), 0.95)) & (
            np.abs(before - after) < CRUISE * np.abs(speed)
        )
        usual = float(np.median(np.diff(t)))
        steps.append((t[i + 1] - t[i])[cruise] - usual)
        travels.append(((x[i + 1] - x[i])[cruise] / speed[cruise]) - usual)
    step, travel = (np.concatenate(v) if v else np.zeros(0) for v in (steps, travels))
    power = float(step @ step)
    if len(step) < FEWEST or power <= 0:
        return None
    followed = float(step @ travel) / power
    sd = float(np.sqrt(np.mean((travel - followed * step) ** 2) / power))
    return Stamps(followed, sd, float(np.sqrt(max(1 - followed, 0.0) * power / len(step) / 2)))
