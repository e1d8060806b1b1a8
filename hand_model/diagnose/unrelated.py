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
from .name.balance import Balance, Fit
from .name.naming import ALPHA
from .name.station import Station

Array = NDArray[np.float64]
Left = Mapping[str, tuple[Array, Array]]  # recording -> times [s] and what a balance leaves of its angle [deg], (n,)

FORETOLD_LEAST = 0.1  # of the variance: less is not worth another hearing
FAR = 4.0  # standard deviations, beyond which an error is no measure of the others
FEWEST = 200  # frames
PLACES = 3  # powers of the place in the range
ORDERS = 3  # powers of the time for which a clock has drifted


@dataclass(frozen=True)
class Regression:
    """A station, the recordings that it was made of, and how it is judged of others."""

    station: Station
    states: tuple[DriveState, ...]
    judge: Callable[[tuple[DriveState, ...]], Station]

    @property
    def left(self) -> Left:
        """What the station leaves of the angles as they were recorded."""
        return left_of(self.states, self.station.naming.balance, self.station.naming.fit)


def together(
    driver: Regression, follower: Regression, anew: Callable[[Station], tuple[DriveState, ...]]
) -> tuple[Station, Station]:
    """The stations of a finger's first angle against its encoder and of its next one against the first, each heard
    beside the errors of the other. anew: the follower's recordings, given the driver's station."""
    before = driver.station.naming.names
    driver = _beside(driver, follower, left_of_seen(follower, driver))
    if driver.station.naming.names != before and (states := anew(driver.station)):
        follower = Regression(follower.judge(states), states, follower.judge)
    return driver.station, _beside(follower, driver, _of_markers(driver)).station


def _of_markers(driver: Regression) -> Left:
    """What a driver's station leaves, less what its log's clock does to it, to the second order of how far that is off,
    where it drifts: the markers know nothing of it, and a drift is named to the first."""
    balance, left = driver.station.naming.balance, driver.left
    if not any(t.effect.signal == "log" for t in driver.station.naming.fit.terms):
        return left
    moved = _gathered(driver.states, balance, lambda s: s.slope[:, None] * np.stack([s.velocity, s.acceleration], 1))
    out = {}
    for trial, (time_s, motion) in balance.by_recording(moved).items():
        since = (time_s - time_s[0]) / max(float(np.ptp(time_s)), 1e-9)
        columns = (motion[:, :, None] * since[:, None, None] ** np.arange(ORDERS)).reshape(len(time_s), -1)
        own = left[trial][1]
        out[trial] = time_s, own - columns @ np.linalg.lstsq(columns, own, rcond=None)[0]
    return out


def _beside(mine: Regression, other: Regression, theirs: Left) -> Regression:
    """The same with its station heard less what errors of the other foretell; as it is where these hold more than
    noise, or a new name is the other's."""
    if other.station.naming.after.p < ALPHA:
        return mine
    states = less_foretold(mine.states, mine.left, theirs)
    if states is None:
        return mine
    again = mine.judge(states)
    if not again.naming.names <= mine.station.naming.names and not _borne_out(mine, again, theirs):
        return mine
    return replace(mine, station=again)


def left_of(states: Sequence[DriveState], balance: Balance, fit: Fit) -> Left:
    """What a fit of a balance leaves of the angles of its recordings. states: as they were recorded."""
    return balance.by_recording(_gathered(states, balance, lambda s: s.effort) - fit.prediction)


def _gathered(states: Sequence[DriveState], balance: Balance, value: Callable[[DriveState], Array]) -> Array:
    """Stack `value(state)` (n, ...) over the samples that a balance compares, of its recordings as they were: its own have
    been remapped to what was named, or are less what was foretold."""
    return np.concatenate([value(s)[mask] for s, mask in zip(states, balance.masks, strict=True)])


def left_of_seen(follower: Regression, driver: Regression) -> Left:
    """What a follower's angle is off from where its driver was seen in the same frame, by the follower's slope: the
    balance itself reckons with a smoother driver, whose errors last."""
    balance, left = follower.station.naming.balance, follower.left
    seen = {s.trial: (s.time_s, s.effort) for s in driver.states}
    course = _gathered(follower.states, balance, lambda s: np.stack([s.position, s.extra["slope"]], axis=1))
    reckoned = balance.by_recording(course)
    out = {}
    for trial, (time_s, _) in left.items():
        at, own, angle = _paired(left, seen, trial)
        smoother, slope = reckoned[trial][1][at].T
        off = own - slope * (angle - smoother)
        told = np.isfinite(off)
        out[trial] = time_s[at][told], off[told]
    return out


def less_foretold(states: Sequence[DriveState], own: Left, other: Left) -> tuple[DriveState, ...] | None:
    """Recordings whose efforts are less what the errors `other` foretell of the errors `own`, frame by frame; None where
    they foretell next to nothing."""
    rows, columns, errors = [], [], []
    for state in states:
        at, mine, theirs = _paired(own, other, state.trial)
        rows.append(np.searchsorted(state.time_s, own[state.trial][0][at]))
        columns.append(_by_place(state, rows[-1], theirs))
        errors.append(mine)
    if sum(len(mine) for mine in errors) < FEWEST:
        return None
    gain, foretold = _foretelling(np.concatenate(errors), np.concatenate(columns))
    if foretold < FORETOLD_LEAST:
        return None
    out = []
    for state, at, theirs in zip(states, rows, columns, strict=True):
        effort = state.effort.copy()
        effort[at] -= theirs @ gain
        out.append(replace(state, effort=effort))
    return tuple(out)


def _by_place(state: DriveState, rows: NDArray[np.intp], errors: Array) -> Array:
    """Errors (k,) at rows of a recording as columns (k, PLACES): what they foretell changes with the finger's posture."""
    low, span = state.position.min(), max(float(np.ptp(state.position)), 1e-9)
    share = 2 * (state.position[rows] - low) / span - 1
    return errors[:, None] * share[:, None] ** np.arange(PLACES)


def _paired(own: Left, other: Left, trial: str) -> tuple[NDArray[np.intp], Array, Array]:
    """Frames (k,) of a recording's own that the other has, too, and the values of both there."""
    (time_s, mine), (other_s, theirs) = own[trial], other.get(trial, (np.zeros(0), np.zeros(0)))
    _, at, place = np.intersect1d(time_s, other_s, assume_unique=True, return_indices=True)
    return at, mine[at], theirs[place]


def _foretelling(mine: Array, theirs: Array) -> tuple[Array, float]:
    """Coefficients (c,) by which columns (n, c) foretell errors (n,), and the share of their variance that they do."""
    near = np.ones(len(mine), bool)
    gain, left = np.zeros(theirs.shape[1]), mine
    for _ in range(3):
        gain = np.linalg.lstsq(theirs[near], mine[near], rcond=None)[0]
        left = mine - theirs @ gain
        near = np.abs(left) < FAR * max(float(np.std(left[near])), 1e-300)
    return gain, 1.0 - float(np.var(left[near]) / max(np.var(mine[near]), 1e-300))


def _borne_out(mine: Regression, again: Station, theirs: Left) -> bool:
    """Whether what new names do is told by the angle that they are of, and not better by the other, whose errors were
    taken off: of both together, with their covariance."""
    balance, fit = again.naming.balance, again.naming.fit
    without = balance.fit(tuple(t for t in fit.terms if t.effect.name in mine.station.naming.names))
    before = left_of(mine.states, balance, without)
    does, declared = (
        balance.by_recording(v) for v in (fit.prediction - without.prediction, balance.gather(lambda s: s.declared))
    )
    paired = {trial: _paired(before, theirs, trial) for trial in before}
    stacked = np.concatenate([np.stack([a, b, does[t][1][at]], axis=1) for t, (at, a, b) in paired.items()])
    design = np.concatenate([declared[t][1][at] for t, (at, _, _) in paired.items()])
    size = np.abs(design).max(0, initial=0.0)
    design = design[:, size > 0] / size[size > 0]
    own, other, shape = (stacked - design @ np.linalg.lstsq(design, stacked, rcond=1e-10)[0]).T
    precision = np.linalg.inv(np.cov(own, other))
    here = (precision[0, 0] * (shape @ own) + precision[0, 1] * (shape @ other)) ** 2 / precision[0, 0]
    there = (precision[1, 1] * (shape @ other) + precision[0, 1] * (shape @ own)) ** 2 / precision[1, 1]
    return bool(here > there)
