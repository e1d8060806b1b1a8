"""Time stamps of a log against its own motion: a row's time must be the time at which its position was read.

Many hands are read at even intervals and stamped when an answer arrives. Where the motion knows nothing of the stamps'
unrest they are evened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .log import Log

Array = NDArray[np.float64]

REACH = 12  # samples on either side over which a cruise is judged
CRUISE = 0.3  # of the fastest speed; and of the speed: how far the halves of a cruise may differ
BELIEVED = 0.8  # share of the variation of time steps that must be in the motion too
FEWEST = 60  # steps within cruises
EVENED = (6.0, 12.0, 24.0, 48.0)  # rows: standard deviations of the kernels by which times are evened
BESIDE = 5  # rows on either side of a pause, by which it is told from an unsteady stamp
SLIGHT = 0.02  # of the step between rows: times that are wrong by less do no harm


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
        """False where clearly less than four fifths of the variation of the time steps are real."""
        return self.followed + 3 * self.sd > BELIEVED

    @property
    def kept(self) -> float:
        """Share of a stamp's unrest that is kept of it: the best linear guess of how far it was read from its turn."""
        return float(np.clip(self.followed, 0.0, 1.0))


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


@lru_cache(maxsize=128)
def evened(log: Log) -> Log:
    """The log of one drive with even times where the motion knows nothing of their unrest, with a note; itself where it
    does. `stamps_wrong_s` says by how much a row's time may be wrong still. A second call returns the same object.

    A row's time is the local line of the stamps over the turns at which rows were read, and of what a stamp is off that
    as much as the motion follows (shrinkage; James & Stein 1961).
    """
    judged = stamps([log]) if "position" in log.columns and log.packet == 1 else None
    usual = float(np.median(np.diff(log.time_s)))
    if judged is None or judged.believed or judged.wrong_s < SLIGHT * usual:
        return log
    turn = _turns(log.time_s, usual)
    guessed, left = judged.wrong_s * float(np.sqrt(judged.kept)), 0.0
    out = log
    for width in EVENED:  # rows that are stamped together need a wider one
        line = _line(turn, log.time_s, width)
        time_s = np.maximum.accumulate(line + judged.kept * (log.time_s - line))
        time_s = time_s + 1e-9 * np.arange(len(time_s))  # each row at a time of its own
        time_s.setflags(write=False)
        out = replace(log, time_s=time_s)
        again = stamps([out])
        left = 0.0 if again is None or again.believed else again.wrong_s
        if left < SLIGHT * usual:
            break
    note = f"time stamps were off by some {1e3 * judged.wrong_s:.1g} ms, as the motion shows: rows were spread evenly"
    return replace(out, notes=(*log.notes, note), stamps_wrong_s=float(np.hypot(guessed, left)))


def _turns(time_s: Array, usual_s: float) -> Array:
    """Turns (n,) at which rows were read: one after the other, but for those lost between two that are far apart and
    stay so."""
    early = time_s - usual_s * np.arange(len(time_s))
    lost = np.zeros(len(time_s))
    for i in np.flatnonzero(np.diff(time_s) > 1.5 * usual_s) + 1:
        after, before = early[i : i + BESIDE], early[max(i - BESIDE, 0) : i]
        lost[i] = max(round(float(np.median(after) - np.median(before)) / usual_s), 0)
    return np.arange(len(time_s)) + np.cumsum(lost)


def _line(at: Array, values: Array, width: float) -> Array:
    """Values (n,) by Gaussian-weighted local lines over `at` (n,), increasing by one or more."""
    reach = int(3.5 * width)
    index = np.arange(len(at))[:, None] + np.arange(-reach, reach + 1)[None]
    inside = (index >= 0) & (index < len(at))
    index = index.clip(0, len(at) - 1)
    d = at[index] - at[:, None]
    w = np.exp(-0.5 * (d / width) ** 2) * inside
    y = values[index] - values[:, None]
    s0, s1, s2 = (np.sum(w * d**k, axis=1) for k in range(3))
    return values + (s2 * np.sum(w * y, axis=1) - s1 * np.sum(w * d * y, axis=1)) / (s0 * s2 - s1**2)
