"""Two balances of one finger whose errors are alike: seemingly unrelated regressions (Zellner 1962).

Markers that tell the angle of one joint too large tell that of the next too small, so that what one balance leaves
foretells half of the noise of the other, or more, frame by frame. Either is heard again less what the other's errors
foretell. Of the linkage these are what its angle is off from where the driver was seen: whatever moved the driver has
moved both, and cancels. What the other lacks would show here as well, only fainter: a name that the other's angle bears
out better is not taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..effects.base import DriveState
from .name.naming import ALPHA, Naming
from .name.station import Station

Array = NDArray[np.float64]
Left = Mapping[str, tuple[Array, Array]]  # recording -> times [s] and what a balance leaves of its angle [deg], (n,)

FORETOLD_LEAST = 0.1  # of the variance: less is not worth another hearing
FAR = 4.0  # standard deviations, beyond which an error is no measure of the others
FEWEST = 200  # frames
PLACES = 3  # powers of the place in the range


@dataclass(frozen=True)
class Heard:
    """A station, the recordings that it was made of, and how it is heard of others."""

    station: Station
    states: tuple[DriveState, ...]
    judge: Callable[[tuple[DriveState, ...]], Station]

    @property
    def left(self) -> Left:
        """What the station leaves of the angles as they were recorded."""
        return left_of(self.states, self.station.naming)


def together(
    driver: Heard, follower: Heard, anew: Callable[[Station], tuple[DriveState, ...]]
) -> tuple[Station, Station]:
    """The stations of a finger's first angle against its encoder and of its next one against the first, each heard
    beside the errors of the other. anew: the follower's recordings, given the driver's station."""
    before = names_at(driver.station)
    driver = _beside(driver, follower, left_of_seen(follower, driver))
    if names_at(driver.station) != before and (states := anew(driver.station)):
        follower = Heard(follower.judge(states), states, follower.judge)
    return driver.station, _beside(follower, driver, driver.left).station


def names_at(station: Station) -> set[str]:
    """The effects that were named at a station, whether they stand or not."""
    return {f.term.effect.name for f in station.naming.found}


def _beside(mine: Heard, other: Heard, theirs: Left) -> Heard:
    """The same with its station heard less what errors of the other foretell; as it is where these hold more than
    noise, or a new name is the other's."""
    if other.station.naming.after.p < ALPHA:
        return mine
    states = less_foretold(mine.states, mine.left, theirs)
    if states is None:
        return mine
    again = mine.judge(states)
    if not names_at(again) <= names_at(mine.station) and not _borne_out(mine, again, theirs):
        return mine
    return replace(mine, station=again)


def left_of(states: Sequence[DriveState], naming: Naming) -> Left:
    """What a naming leaves of the angles of its recordings. states: as they were recorded."""
    out, start = {}, 0
    for state, mask in zip(states, naming.balance.masks, strict=True):
        stop = start + int(mask.sum())
        out[state.trial] = state.time_s[mask], state.effort[mask] - naming.fit.prediction[start:stop]
        start = stop
    return out


def left_of_seen(follower: Heard, driver: Heard) -> Left:
    """What a follower's angle is off from where its driver was seen in the same frame, by the follower's slope: the
    balance itself reckons with a smoother driver, whose errors last."""
    seen = {s.trial: (s.time_s, s.effort) for s in driver.states}
    out = {}
    for state, mask in zip(follower.states, follower.station.naming.balance.masks, strict=True):
        if state.trial not in seen:
            continue
        time_s, left = follower.left[state.trial]
        _, at, place = np.intersect1d(time_s, seen[state.trial][0], assume_unique=True, return_indices=True)
        smoother, slope = state.position[mask][at], state.extra["slope"][mask][at]
        off = left[at] - slope * (seen[state.trial][1][place] - smoother)
        told = np.isfinite(off)
        out[state.trial] = time_s[at][told], off[told]
    return out


def less_foretold(states: Sequence[DriveState], own: Left, other: Left) -> tuple[DriveState, ...] | None:
    """Recordings whose efforts are less what the errors `other` foretell of the errors `own`, frame by frame; None where
    they foretell next to nothing."""
    pairs = {state.trial: _paired(own, other, state.trial) for state in states if state.trial in own}
    parts = {t: _by_place(s, own[t][0][pairs[t][0]], pairs[t][3]) for s in states if (t := s.trial) in pairs}
    mine, theirs = (np.concatenate(v) for v in ([p[2] for p in pairs.values()], list(parts.values())))
    if len(mine) < FEWEST:
        return None
    gain, foretold = _foretelling(mine, theirs)
    if foretold < FORETOLD_LEAST:
        return None
    out = []
    for state in states:
        effort = state.effort.copy()
        if state.trial in pairs:
            rows = np.flatnonzero(np.isin(state.time_s, own[state.trial][0][pairs[state.trial][0]]))
            effort[rows] -= parts[state.trial] @ gain
        out.append(replace(state, effort=effort))
    return tuple(out)


def _by_place(state: DriveState, time_s: Array, errors: Array) -> Array:
    """Errors (k,) at times [s] as columns (k, PLACES): what they foretell changes with the finger's posture."""
    position = np.interp(time_s, state.time_s, state.position)
    share = 2 * (position - state.position.min()) / max(float(np.ptp(state.position)), 1e-9) - 1
    return errors[:, None] * share[:, None] ** np.arange(PLACES)


def _paired(own: Left, other: Left, trial: str) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Places of the frames (k,) of a recording that both have, in either, and the errors of both."""
    if trial not in other:
        none = np.zeros(0, np.intp)
        return none, none, np.zeros(0), np.zeros(0)
    (time_s, mine), (other_s, theirs) = own[trial], other[trial]
    _, at, place = np.intersect1d(time_s, other_s, assume_unique=True, return_indices=True)
    return at, place, mine[at], theirs[place]


def _foretelling(mine: Array, theirs: Array) -> tuple[Array, float]:
    """Coefficients (c,) by which columns (n, c) foretell errors (n,), and the share of their variance that they do."""
    near = np.ones(len(mine), bool)
    gain, left = np.zeros(theirs.shape[1]), mine
    for _ in range(3):
        gain = np.linalg.lstsq(theirs[near], mine[near], rcond=None)[0]
        left = mine - theirs @ gain
        near = np.abs(left) < FAR * max(float(np.std(left[near])), 1e-300)
    return gain, 1.0 - float(np.var(left[near]) / max(np.var(mine[near]), 1e-300))


def _borne_out(mine: Heard, again: Station, theirs: Left) -> bool:
    """Whether what new names do is told by the angle that they are of, and not better by the other, whose errors were
    taken off: of both together, with their covariance."""
    balance, fit = again.naming.balance, again.naming.fit
    known = names_at(mine.station)
    without = balance.fit(tuple(t for t in fit.terms if t.effect.name in known))
    does = left_of(tuple(replace(s, effort=np.zeros(len(s.time_s))) for s in mine.states), _with(again.naming, without))
    done = left_of(tuple(replace(s, effort=np.zeros(len(s.time_s))) for s in mine.states), again.naming)
    before = left_of(mine.states, _with(again.naming, without))
    rows, columns = [], []
    matrix = balance.gather(lambda s: s.declared)
    start = 0
    for trial, (time_s, _) in before.items():
        at, _, own, other = _paired(before, theirs, trial)
        shape = does[trial][1][at] - done[trial][1][at]
        rows.append(np.stack([own, other, shape], axis=1))
        columns.append(matrix[start : start + len(time_s)][at])
        start += len(time_s)
    stacked, design = np.concatenate(rows), np.concatenate(columns)
    size = np.abs(design).max(0, initial=0.0)
    design = design[:, size > 0] / size[size > 0]
    own, other, shape = (stacked - design @ np.linalg.lstsq(design, stacked, rcond=1e-10)[0]).T
    precision = np.linalg.inv(np.cov(own, other))
    here = (precision[0, 0] * (shape @ own) + precision[0, 1] * (shape @ other)) ** 2 / precision[0, 0]
    there = (precision[1, 1] * (shape @ other) + precision[0, 1] * (shape @ own)) ** 2 / precision[1, 1]
    return bool(here > there)


def _with(naming: Naming, fit: object) -> Naming:
    return replace(naming, fit=fit)
