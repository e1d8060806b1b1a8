"""Answers to commands: how late each drive's current and motion follow its setpoints, beside the session's other
drives.

A late drive answers late in both; a late current channel answers late beside a motion that does not. A healthy drive's
motion begins when friction gives way, which differs from drive to drive by a sample or two; its current answers at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from ...effects.base import DriveState, sample_interval

Array = NDArray[np.float64]

LATE = 1.25  # sample intervals, from which an answer is late that one channel alone shows
MOSTLY = 0.7  # share of such answers that must be late
# sample intervals, from which a drive is late whose current and motion both are (446 pairs of healthy drives: 0.45 at
# most)
BOTH_LATE = 0.8
CERTAIN = 3.0  # standard errors by which the means of both are late beyond what healthy drives differ by
# standard errors by which a drive moves before its current rises, and its answers scatter more than another's
SURELY = 2.0
UNCLEAR = 0.3  # share of the lateness that the motion has too, from which it is no longer clear what is late
LEAST_ANSWERS = 5
STOOD = 0.5  # [%] a drive that moves less just before a change stands
UNLIKE = 0.4  # sample intervals by which the answers of healthy drives of one session differ
USUAL_START = 2.0  # sample intervals after which a healthy drive is seen to move
SHARES = (0.1, 0.25, 0.5)  # of a current's rise, by which a late one is told from a slow one
SLOWER = 3.0  # times as slow as another drive's, at most, is the rise of a healthy one
BIN_S, RISEN_S = 0.005, 0.35  # in which samples after all changes are averaged, and after which the rise is over
SHIFTED = 0.5  # of what a drive's answers are late, at least, is a shift of its rise and no slowness
VARIOUS, AS_FAST = 2.0, 1.5  # times another drive's scatter of answers and length of rise
RISEN_T = 6.0  # standard errors by which a current must have risen before the changes come
EARLY_S = 0.2  # by which a current's time stamps may run ahead
STAYS_S = 0.1  # a setpoint that changes again within it is no command but a path: nothing answers each point of that


@dataclass(frozen=True)
class Answers:
    """current_s, motion_s: (e,) from each change of the setpoint to its answer. step_s: sample interval. rise_s: (s,)
    time from the changes until the current, mean over them all, has risen to SHARES (s) of its most; nan where
    that is not told. lead_s: (s,) the same counted from before the changes, where it has risen for sure before they
    come; else nan. own_s: (s,) time from where the current answers each of them, so that answers that are variously late
    do not smear it. kept_out: (e,) which answers of the current are of recordings kept out; empty where none is known
    to be."""

    current_s: Array
    motion_s: Array
    step_s: float
    rise_s: Array = field(default_factory=lambda: np.full(len(SHARES), np.nan))
    lead_s: Array = field(default_factory=lambda: np.full(len(SHARES), np.nan))
    own_s: Array = field(default_factory=lambda: np.full(len(SHARES), np.nan))
    kept_out: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))


@dataclass(frozen=True)
class Lateness:
    """What a drive's answers say. drive_s: (k,) by how much the drive answers late, empty where it does not. channel_s:
    by how much its current alone is late, and doubt_s, the standard deviation of that."""

    drive_s: Array
    channel_s: float
    doubt_s: float


def answers_of(states: Sequence[DriveState], currents: Sequence[Array]) -> Answers:
    """Answers of one drive. currents: raw current (n,) of each state (its `effort` is masked at rest)."""
    of_each = [_answered(s, c, EARLY_S) for s, c in zip(states, currents, strict=True)]
    current = np.array([x for found in of_each for x in found])
    kept_out = np.repeat([s.validate for s in states], [len(found) for found in of_each])
    motion = np.array([x for s in states for x in _answered(s, s.position)])
    step = sample_interval(states)
    rises = _rise(states, currents, step)
    own = _rise_from_answers(states, currents, step)
    usual = _usual(current, step)
    return Answers(current[usual], motion[_usual(motion, step)], step, *rises, own, kept_out[usual])


def lateness(answers: Mapping[str, Answers], in_time: Collection[str] = ()) -> dict[str, Lateness]:
    """Of each drive that answers often enough, beside the least late one of the session, or a usual one where it is
    alone. in_time: drives of which it is known that their current is not late: what answers late is the drive."""
    told = {a: x for a, x in answers.items() if len(x.current_s) >= LEAST_ANSWERS}
    alone = len(told) == 1
    # who answers before it is told is early, and no measure for the others
    means = [(float(np.mean(x.current_s)), x.step_s) for x in told.values()]
    first = max(min((m for m, step_s in means if m >= -UNLIKE * step_s), default=0.0), 0.0)
    moved = {a: float(np.mean(x.motion_s)) for a, x in told.items() if len(x.motion_s) >= LEAST_ANSWERS}
    out = {}
    for actuator, x in told.items():
        usual = min(first, x.step_s) if alone else first
        late = x.current_s - usual
        begins = USUAL_START * x.step_s if alone else min(moved.values(), default=np.nan)
        # nan where too few motions are seen to answer: late is the drive then
        behind = moved.get(actuator, np.nan) - begins
        total = float(np.mean(x.current_s)) - usual
        plain = (
            not behind <= max(x.step_s, 0.5 * total)
            and np.mean(late) > LATE * x.step_s
            and np.mean(late > x.step_s) > MOSTLY
        )
        shift = _onset(x.rise_s) if alone else _shift(x.rise_s, [y.rise_s for a, y in told.items() if a != actuator])
        slow = total > 0 and shift <= SHIFTED * total and not _moves_first(x, total - behind)
        if slow and behind > 0.5 * total:  # the motion is late, too
            slow = not _variously_late(x, [y for a, y in told.items() if a != actuator])
        known = actuator in in_time
        drive = known or not slow and (plain or (not alone and _both_late(x, total, behind)))
        if known:
            channel = 0.0
        elif drive:
            channel = max(total - np.nan_to_num(behind, nan=total), 0.0)
        else:
            channel = max(shift, 0.0) if slow else total
        # Neither clearly the one nor the other: the motion's own scatter decides between the two.
        torn = total > LATE * x.step_s and UNCLEAR * total < behind < (1 - UNCLEAR) * total
        between = min(behind, total - behind) if torn else 0.0
        unlike = (1.0 if alone else UNLIKE) * x.step_s
        ahead, scatter = _ahead(x, [y for a, y in told.items() if a != actuator])
        if ahead < -unlike:  # by as much more as the drive is late, if it is, and not slower to break loose
            half = 0.5 * max(float(np.nan_to_num(behind)), 0.0)
            out[actuator] = Lateness(np.zeros(0), ahead - half, float(np.linalg.norm([unlike, scatter, half])))
            continue
        unsure = total - channel if slow else 0.0
        if drive and behind - total > USUAL_START * x.step_s:  # it breaks loose slowly, or its current is early
            unsure = 0.5 * (behind - total)
            channel = -unsure
        doubt = float(np.hypot(unlike + between + unsure, np.std(x.current_s) / np.sqrt(len(x.current_s))))
        out[actuator] = Lateness(late if drive else np.zeros(0), channel, doubt)
    return out


def _moves_first(x: Answers, apart_s: float) -> bool:
    """Whether a drive is surely seen to move before its current rises, which a current that is only slow does not let
    it; apart_s: by how much [s] more than another drive, whose friction may be as little."""
    if len(x.motion_s) < LEAST_ANSWERS:
        return False
    doubt_s = float(np.hypot(*(np.std(answers_s) / np.sqrt(len(answers_s)) for answers_s in (x.current_s, x.motion_s))))
    before_s = min(float(np.mean(x.current_s) - np.mean(x.motion_s)), apart_s)
    return before_s > UNLIKE * x.step_s + SURELY * doubt_s


def _variously_late(x: Answers, others: Sequence[Answers]) -> bool:
    """Whether a drive surely answers some changes later than others and then as fast as another drive does: a rise that
    is only slow is so after its answers, too."""
    told = [y for y in others if np.isfinite(x.own_s + y.own_s).all()]
    scatter = float(np.std(x.current_s)) * (1 - SURELY / np.sqrt(2 * max(len(x.current_s), 2)))
    return any(
        scatter > VARIOUS * max(float(np.std(y.current_s)), x.step_s)
        and np.ptp(x.own_s) < AS_FAST * max(float(np.ptp(y.own_s)), x.step_s)
        for y in told
    )


def _shift(rise_s: Array, others: Sequence[Array]) -> float:
    """By how much [s] a rise begins later than those of other drives, the least of them: one is another stretched in
    time, as by another gain, and shifted. Infinite where nothing is told."""
    told = [other for other in others if np.isfinite(other + rise_s).all()]
    return min((float(np.min(rise_s - _stretch(rise_s, other) * other)) for other in told), default=np.inf)


def _stretch(rise_s: Array, other_s: Array) -> float:
    """How many times as slow as another a rise is, at least one: a late drive that is faster would seem later still. An
    early one that is faster seems earlier than it is."""
    return float(np.clip(np.ptp(rise_s) / max(float(np.ptp(other_s)), 1e-9), 1.0, SLOWER))


def _onset(rise_s: Array) -> float:
    """When [s] a rise begins, straight on from its first two shares: a smooth controller is seen late and begins at once.
    Infinite where nothing is told."""
    if not np.isfinite(rise_s).all():
        return np.inf
    (first, second), (begun, further) = SHARES[:2], rise_s[:2]
    return float(begun - first * (further - begun) / (second - first))


def _ahead(x: Answers, others: Sequence[Answers]) -> tuple[float, float]:
    """By how much [s] a current that has risen before the changes come rises later (negative: earlier) than those of
    other drives, the most of these, or than the changes where there is none; and the doubt of that: how far its shares
    differ, and half of what the stretch between two drives makes. Zero of one that rises with them or after."""
    if not np.isfinite(x.lead_s).all():
        return 0.0, 0.0
    rises = [y.lead_s if np.isfinite(y.lead_s).all() else y.rise_s for y in others]
    shifts = [(x.lead_s - _stretch(x.lead_s, r) * r, x.lead_s - r) for r in rises if np.isfinite(r).all()]
    stretched, plain = max(shifts, key=lambda d: float(np.median(d[0])), default=(x.lead_s[:1], x.lead_s[:1]))
    ahead = float(np.median(stretched))
    return ahead, float(np.hypot(np.std(stretched), 0.5 * (ahead - float(np.median(plain)))))


def _rise(states: Sequence[DriveState], currents: Sequence[Array], step_s: float) -> tuple[Array, Array]:
    """Times (len(SHARES),) [s] at which a drive's current has risen to SHARES of its most, mean over all changes of the
    setpoint before which it stood: their moments lie anywhere between samples, so that the mean tells much less than
    one. And the same counted from before the changes, nan where it has not risen for sure when they come."""
    since, risen = [np.zeros(0)], [np.zeros(0)]
    for t, rise, k, _ in _changes(states, currents):
        after = (t > t[k] - EARLY_S) & (t < t[k] + RISEN_S)
        since.append(t[after] - t[k])
        risen.append(rise[after])
    cells, mean, count = _binned(since, risen)
    told = cells >= 0
    unknown = np.full(len(SHARES), np.nan)
    if len(since) <= LEAST_ANSWERS or told.sum() < 2:
        return unknown, unknown
    middle = BIN_S * (cells + 0.5)
    half_s = _reached(middle[told], mean[told], count[told])[-1]
    settling = _course(*(x[middle <= half_s] for x in (middle, mean, count)))
    own = _reached(middle[told], (mean - settling(middle))[told], count[told])
    return own, _reached(middle, mean, count) if _risen_before(since, risen, step_s) else unknown


def _rise_from_answers(states: Sequence[DriveState], currents: Sequence[Array], step_s: float) -> Array:
    """Times (len(SHARES),) [s] at which a drive's current has risen to SHARES of its most, counted from its answer to
    each change of the setpoint before which it stood, mean over all; nan where too few are seen."""
    since, risen = [np.zeros(0)], [np.zeros(0)]
    for t, rise, k, answer in _changes(states, currents):
        if answer is not None:
            after = (t > t[k] + answer - 2 * step_s) & (t < t[k] + answer + RISEN_S)
            since.append(t[after] - t[k] - answer)
            risen.append(rise[after])
    cells, mean, count = _binned(since, risen)
    if len(since) <= LEAST_ANSWERS or len(cells) < 2:
        return np.full(len(SHARES), np.nan)
    return _reached(BIN_S * (cells + 0.5), mean, count)


def _changes(
    states: Sequence[DriveState], currents: Sequence[Array]
) -> Iterator[tuple[Array, Array, int, float | None]]:
    """Of every change of the setpoint before which a drive stood: the recording's times (n,) [s], how far its current is
    by then beyond what it was before, towards the new setpoint (n,), the sample of the change and the time [s] from it to
    the current's answer, None where there is none."""
    for state, current in zip(states, currents, strict=True):
        setpoint, t = state.extra.get("setpoint", np.zeros(len(state.time_s))), state.time_s
        for k in commands(t, setpoint):
            before = (t > t[k] - EARLY_S) & (t < t[k])
            if before.sum() >= 5 and np.ptp(state.position[before]) < STOOD:
                rise = np.sign(setpoint[k] - setpoint[k - 1]) * (current - np.median(current[before]))
                yield t, rise, k, _latency(t, setpoint, current, k)


def _binned(since: Sequence[Array], risen: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Cells of BIN_S that hold readings at times `since` [s], in order (c,), their means and how many they hold."""
    label = np.floor(np.concatenate(since) / BIN_S).astype(int)
    cells, at, count = np.unique(label, return_inverse=True, return_counts=True)
    return cells, np.bincount(at, np.concatenate(risen)) / count, count


def _risen_before(since: Sequence[Array], risen: Sequence[Array], step_s: float) -> bool:
    """Whether what a current has risen by in the last sample before the changes is more than chance, and than a course
    that it was on."""
    parts = [
        (rise[(time_s < 0) & (time_s >= -1.5 * step_s)], rise[time_s < -0.5 * EARLY_S])
        for time_s, rise in zip(since, risen, strict=True)
    ]
    steps = [float(last.mean() - before.mean()) for last, before in parts if len(last) and len(before)]
    return len(steps) > LEAST_ANSWERS and float(np.mean(steps)) > RISEN_T * float(np.std(steps)) / np.sqrt(len(steps))


def _reached(time_s: Array, mean: Array, count: Array) -> Array:
    """Times (len(SHARES),) [s] at which means (n,) of so many readings, made to rise by least squares (Barlow 1972),
    have reached SHARES of their most; nan where they do not rise."""
    rising = isotonic_regression(mean, weights=count).x
    if rising[-1] <= 0:
        return np.full(len(SHARES), np.nan)
    return np.interp(np.array(SHARES) * rising[-1], rising, time_s)


def _course(time_s: Array, mean: Array, count: Array) -> Callable[[Array], Array]:
    """The straight course that means (n,) of so many readings leave to rise (Hinkley 1969), and its level from there
    on: what still settles while the command comes is no answer to it."""
    root, best, found = np.sqrt(count), np.inf, (0.0, 0.0, 0.0)
    for start in time_s[time_s >= 0]:
        design = np.stack([np.ones(len(time_s)), np.minimum(time_s, start), np.maximum(time_s - start, 0.0)], axis=1)
        own = np.linalg.lstsq(design * root[:, None], mean * root, rcond=None)[0]
        cost = float(np.sum(((mean - design @ own) * root) ** 2))
        if cost < best:
            best, found = cost, (float(start), float(own[0]), float(own[1]))
    start, level, slope = found
    return lambda t: level + slope * np.minimum(t, start)


def _both_late(x: Answers, current_s: float, motion_s: float) -> bool:
    """Whether current and motion are late by as much [s] beside another drive, nan where that is not known.

    Each is read to a sample and a motion begins when friction gives way, but not both to the same side: what they share
    is the delay.
    """
    late_s = np.array([current_s, motion_s])
    if not np.isfinite(late_s).all():
        return False
    doubt_s = np.array([np.std(answers_s) / np.sqrt(len(answers_s)) for answers_s in (x.current_s, x.motion_s)])
    least = float(late_s.min())
    sure = bool((late_s - CERTAIN * doubt_s > UNLIKE * x.step_s).all())
    return sure and least > BOTH_LATE * x.step_s and least > 0.5 * float(late_s.max())


def _answered(state: DriveState, channel: Array, early_s: float = 0.0) -> list[float]:
    return latencies(state.time_s, state.extra["setpoint"], channel, early_s) if "setpoint" in state.extra else []


def commands(time_s: Array, setpoint: Array) -> NDArray[np.intp]:
    """First samples (k,) of what a setpoint (n,) [%] asks for anew, at times (n,) [s]: it stood before, and stays a
    while."""
    changed = np.flatnonzero(np.diff(setpoint)) + 1
    at_s = time_s[changed]
    alone = np.diff(at_s, prepend=-np.inf, append=np.inf) > STAYS_S
    return changed[alone[:-1] & alone[1:]]


def latencies(time_s: Array, setpoint: Array, channel: Array, early_s: float = 0.0) -> list[float]:
    """Time [s] from each change of the setpoint (n,) to the first two samples of a channel (n,) beyond three standard
    deviations, in its direction.

    early_s: by how much a channel may answer before it is told; it does where that much before the change it stood, and
    no longer does at the change.
    """
    found = (_latency(time_s, setpoint, channel, k, early_s) for k in commands(time_s, setpoint))
    return [x for x in found if x is not None]


def _latency(time_s: Array, setpoint: Array, channel: Array, k: int, early_s: float = 0.0) -> float | None:
    """The same of the change at sample k; None where it is not answered."""
    way, ahead = np.sign(setpoint[k] - setpoint[k - 1]), int(np.searchsorted(time_s, time_s[k] - early_s))
    hit, away = _departure(time_s, way * channel, ahead, k + 60) if ahead < k else (None, None)
    if hit is None or hit >= k - 1 or not away[hit - ahead : k - ahead].all():
        hit, _ = _departure(time_s, way * channel, k, k + 60)
    return None if hit is None else float(time_s[hit] - time_s[k])


def _departure(t: Array, channel: Array, begin: int, end: int) -> tuple[int | None, NDArray[np.bool_]]:
    """The first of two samples from `begin` on that lie above what the channel (n,) was before, and which do (end -
    begin,); None where none are."""
    before = channel[(t > t[begin] - 0.2) & (t < t[begin])]
    if len(before) < 5:
        return None, np.zeros(0, bool)
    away = channel[begin:end] - np.median(before) > 3 * max(float(np.std(before)), 1e-9)
    hit = np.flatnonzero(away[:-1] & away[1:])
    return (begin + int(hit[0]) if len(hit) else None), away


def _usual(latency_s: Array, step_s: float) -> NDArray[np.bool_]:
    """Which latencies (k,) are none that noise answered early or that a drive already in motion hid."""
    if not len(latency_s):
        return np.zeros(0, bool)
    apart = np.abs(latency_s - np.median(latency_s))
    return apart <= 3 * max(1.4826 * float(np.median(apart)), 0.5 * step_s)
