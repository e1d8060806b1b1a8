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
FAR = 2.0  # usual steps, from which rows were lost between two
PACKED = 0.5  # the share that must be in the motion of rows that came in packets, and were spread evenly already
EVENED = (6.0, 12.0, 24.0, 48.0)  # rows: standard deviations of the kernels by which times are evened
BESIDE = 5  # rows on either side of a pause, by which it is told from an unsteady stamp
WORTH = 0.9  # of what a narrower kernel leaves: a wider one must leave less
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
    def most(self) -> float:
        """The share that the motion may follow at most, by three standard deviations."""
        return self.followed + 3 * self.sd

    @property
    def believed(self) -> bool:
        """False where clearly less than four fifths of the variation of the time steps are real."""
        return self.most > BELIEVED

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
        cruise &= t[i + 1] - t[i] < FAR * usual  # among lost rows the drive may have stopped
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
    does. `stamps_wrong_s` says by how much a row's time may be wrong still; times of rows that came in packets stay, and
    only that is said.

    A row's time is the local line of the stamps over the turns at which rows were read, and of what a stamp is off that
    as much as the motion follows (shrinkage; James & Stein 1961).
    """
    judged = stamps([log]) if "position" in log.columns else None
    usual = float(np.median(np.diff(log.time_s)))
    if judged is None or judged.believed or judged.wrong_s < SLIGHT * usual:
        return log
    if log.packet > 1:
        return replace(log, stamps_wrong_s=judged.wrong_s) if judged.most < PACKED else log
    turn = _turns(log.time_s, usual)
    out, least = log, np.inf
    for width in EVENED:  # rows that are stamped together need a wider one
        tried = _evened(log, turn, judged.kept, width)
        again = stamps([tried])
        left = 0.0 if again is None or again.believed else again.wrong_s
        if not left < WORTH * least:
            break
        out, least = tried, left
        if left < SLIGHT * usual:
            break
    note = f"time stamps were off by some {1e3 * judged.wrong_s:.1g} ms, as the motion shows: rows were spread evenly"
    guessed = judged.wrong_s * float(np.sqrt(judged.kept))
    return replace(out, notes=(*log.notes, note), stamps_wrong_s=float(np.hypot(guessed, least)))


def _evened(log: Log, turn: Array, kept: float, width: float) -> Log:
    line = _line(turn, log.time_s, width)
    time_s = np.maximum.accumulate(line + kept * (log.time_s - line))
    apart = max(1e-9, 2 * float(np.spacing(np.abs(time_s).max())))
    time_s = time_s + apart * np.arange(len(time_s))  # each row at a time of its own
    time_s.setflags(write=False)
    return replace(log, time_s=time_s)


def _turns(time_s: Array, usual_s: float) -> Array:
    """Turns (n,) at which rows were read: one after the other, but for those lost between two that are far apart and
    stay so."""
    early = time_s - usual_s * np.arange(len(time_s))
    lost = np.zeros(len(time_s))
    far = _not_made_up(np.diff(time_s) - usual_s, usual_s) + 1
    for i, next_far in zip(far, np.append(far, len(time_s))[1:], strict=True):
        after, before = early[i : min(i + BESIDE, next_far)], early[max(i - BESIDE, 0) : i]
        lost[i] = max(round(float(np.median(after) - np.median(before)) / usual_s), 0)
        early[i:] -= lost[i] * usual_s
    return np.arange(len(time_s)) + np.cumsum(lost)


def _not_made_up(late_s: Array, usual_s: float) -> NDArray[np.intp]:
    """Steps between rows that are longer than usual by more than half (late_s (n,): by how much [s]), but for those whose
    delay rows that follow close upon each other make up for: packets come late, and nothing is lost."""
    out, made_up = [], 0.0
    for i in reversed(range(len(late_s))):
        if late_s[i] < -0.5 * usual_s:
            made_up -= late_s[i]
        elif late_s[i] > made_up + 0.5 * usual_s:
            out.append(i)
        elif late_s[i] > 0.5 * usual_s:
            made_up = max(made_up - late_s[i], 0.0)
    return np.array(out[::-1], dtype=np.intp)


def _line(at: Array, values: Array, width: float) -> Array:
    """Values (n,) by Gaussian-weighted local lines over `at` (n,), increasing by one or more; as they are where a row is
    alone."""
    s0, s1, s2, y0, y1 = np.ones(len(at)), *np.zeros((4, len(at)))
    for k in range(1, int(3.5 * width) + 1):
        d, y = at[k:] - at[:-k], values[k:] - values[:-k]
        w = np.exp(-0.5 * (d / width) ** 2)
        for mine, sign in ((slice(None, -k), 1.0), (slice(k, None), -1.0)):  # the row after, and the row before
            s0[mine] += w
            s1[mine] += sign * w * d
            s2[mine] += w * d**2
            y0[mine] += sign * w * y
            y1[mine] += w * d * y
    determinant = s0 * s2 - s1**2
    alone = determinant < 1e-6 * s0**2
    return values + np.where(alone, 0.0, (s2 * y0 - s1 * y1) / np.where(alone, 1.0, determinant))
