"""A support that turned about its joint's own axis: markers alone cannot tell it from motion, the joint before it can."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState, position_range
from ...effects.path import strokes
from ..findings import Finding, weighed
from .angles import Step

Array = NDArray[np.float64]

BEYOND_CHANCE = 12.0  # log likelihood that a step must bring over none: for its size, and the moments that are tried
PLAINER = 3.0  # that it must bring over a drift, and a while that ends may bring over it
MOMENTS = np.linspace(0.04, 0.96, 72)  # shares of a recording that are tried
WHILES = np.linspace(0.04, 0.9, 12)  # and those between which a while is
PLACES = np.linspace(0.1, 0.8, 8)  # shares of the range, from which on an obstacle is met
NEVER = 1.1  # of a recording
FEWEST = 8  # strokes
SAMPLES = 500  # of a recording
STROKE = 0.2  # of the range, that a stroke covers
CORRECTION = "the step of the angle is taken out of the map between the joints"


@dataclass(frozen=True)
class _Record:
    """Thinned samples of a recording. share (n,): of its length; place (n,): of the range; known (n, P): declared columns
    and the way of the motion; angle (n,) [deg]; stroke (n,): number, counted on through all recordings."""

    share: Array
    place: Array
    known: Array
    angle: Array
    stroke: NDArray[np.int64]
    state: DriveState

    @property
    def index(self) -> int:
        """Number of the recording."""
        return int(self.state.extra["trial_index"][0])


@dataclass(frozen=True)
class Turned:
    """step_deg: of the angle; evidence: log likelihood over no step; records: as they were read; begins: the share of
    each from which it acts."""

    step_deg: float
    evidence: float
    records: tuple[_Record, ...]
    begins: tuple[float, ...]

    @property
    def steps(self) -> tuple[Step, ...]:
        """When, in each recording in which it acts."""
        return tuple(
            Step(r.index, float(r.state.time_s[0] + begin * np.ptp(r.state.time_s)), r.index)
            for r, begin in zip(self.records, self.begins, strict=True)
            if begin < 1
        )


def turned_support(states: Sequence[DriveState], before: Sequence[DriveState] = ()) -> Turned | None:
    """The step of a follower's angle against its driver's that sets in at one moment, the same share of each recording
    or in one and all that come later, and stays; None where none stands out of how the strokes scatter, where a drift
    or a while says as much, or where the driver's angle steps against its encoder then (before: its states), so that it
    is not the follower's support."""
    records = _records(states)
    count = _strokes_of(records)
    if count < FEWEST:
        return None
    none = _scatter(records, None)
    tried = {begins: _scatter(records, _acting(records, begins)) for begins in _moments(records)}
    best = min(tried, key=lambda begins: tried[begins])
    gain, drift = (_likelier(count, none, x) for x in (tried[best], _scatter(records, [r.share for r in records])))
    if gain - np.log(len(tried)) < BEYOND_CHANCE or gain < drift + PLAINER or _steps_too(_records(before), best):
        return None
    if _ends(records, best, tried[best]):
        return None
    best = _refined(records, best)
    return Turned(float(_fit(records, _acting(records, best))[0][-1]), gain, tuple(records), best)


def _records(states: Sequence[DriveState]) -> list[_Record]:
    if not states:
        return []
    out, first = [], 0
    low, high = position_range(states)
    for state in states:
        good = np.flatnonzero(np.isfinite(state.effort))
        good = good[:: max(1, len(good) // SAMPLES)]
        if len(good) < FEWEST:
            continue
        number = np.zeros(len(state.time_s), int)
        for k, (a, b, _) in enumerate(strokes(state.position, STROKE * float(np.ptp(state.position)))):
            number[a:b] = k
        _, number = np.unique(number[good], return_inverse=True)
        known = np.concatenate([state.declared, np.sign(state.velocity)[:, None]], axis=1)
        share = (state.time_s - state.time_s[0]) / (state.time_s[-1] - state.time_s[0])
        place = (state.position - low) / (high - low)
        out.append(_Record(share[good], place[good], known[good], state.effort[good], first + number, state))
        first = out[-1].stroke[-1] + 1
    return out


def _moments(records: Sequence[_Record]) -> Iterator[tuple[float, ...]]:
    """Shares of each recording from which it acts: the same of each, or none of those before one and all of those after
    it."""
    yield from ((float(s),) * len(records) for s in MOMENTS)
    for k in range(len(records)) if len(records) > 1 else ():
        yield from ((NEVER,) * k + (float(s),) + (0.0,) * (len(records) - k - 1) for s in MOMENTS)


def _acting(records: Sequence[_Record], begins: Sequence[float]) -> list[Array]:
    """One from those shares of each recording on, else zero."""
    return [(r.share >= begin).astype(float) for r, begin in zip(records, begins, strict=True)]


def _strokes_of(records: Sequence[_Record]) -> int:
    return int(records[-1].stroke[-1]) + 1 if records else 0


def _likelier(count: int, before: float, after: float) -> float:
    """Log likelihood by which sums of squares of so many strokes fall."""
    return 0.5 * count * float(np.log(before / after))


def _fit(records: Sequence[_Record], column: Sequence[Array] | None) -> tuple[Array, Array]:
    x, y = np.concatenate([r.known for r in records]), np.concatenate([r.angle for r in records])
    if column is not None:
        x = np.column_stack([x, np.concatenate(column)])
    size = np.linalg.norm(x, axis=0)
    size[size == 0] = 1.0  # what acts in other recordings alone, as their clocks do, gets nothing
    theta = np.linalg.lstsq(x / size, y)[0] / size
    return theta, y - x @ theta


def _scatter(records: Sequence[_Record], column: Sequence[Array] | None) -> float:
    """Sum of squares of the strokes' mean residuals [deg^2] beside the declared map, the way of the motion and a
    column."""
    left, stroke = _fit(records, column)[1], np.concatenate([r.stroke for r in records])
    counts = np.bincount(stroke)
    return float(np.sum((np.bincount(stroke, left) / np.maximum(counts, 1)) ** 2)) + 1e-12


def _ends(records: Sequence[_Record], begins: tuple[float, ...], stays: float) -> bool:
    """Whether it is over before the recordings are, rather (a while), or an obstacle pushes that was there for a while.
    begins: of the step that stays, and what that leaves."""
    count = _strokes_of(records)
    return any(_likelier(count, stays, _scatter(records, c)) > PLAINER for c in _passing(records, begins))


def _passing(records: Sequence[_Record], begins: tuple[float, ...]) -> Iterator[list[Array]]:
    """Columns of a while, the same of each recording, and of obstacles met from a place on: in such a while, or in one of
    a single recording. What stays begins or ends one, too."""
    for i, a in enumerate(WHILES):
        for b in WHILES[i + 1 :]:
            yield [((r.share >= a) & (r.share < b)).astype(float) for r in records]
    edges = sorted({0.0, *WHILES, *(s for s in begins if 0 < s < 1), 1.0})
    met = [[np.maximum(r.place - place, 0.0) for r in records] for place in PLACES]
    for i, a in enumerate(edges):
        for b in edges[i + 1 :] if a > 0 else edges[1:-1]:
            inside = [(r.share >= a) & (r.share <= b) for r in records]
            for depth in met:
                pushed = [d * there for d, there in zip(depth, inside, strict=True)]
                yield pushed
                if len(records) > 1:
                    yield from ([p * (k == one) for k, p in enumerate(pushed)] for one in range(len(records)))


def _steps_too(records: Sequence[_Record], begins: tuple[float, ...]) -> bool:
    """Whether the driver steps against its encoder at that moment."""
    count = _strokes_of(records)
    if len(records) != len(begins) or count < FEWEST:
        return False
    return _likelier(count, _scatter(records, None), _scatter(records, _acting(records, begins))) > BEYOND_CHANCE


def _refined(records: Sequence[_Record], begins: tuple[float, ...]) -> tuple[float, ...]:
    """The moment between those that were tried that suits the samples best."""

    def moved(by: float) -> tuple[float, ...]:
        return tuple(float(s + by) if 0 < s < 1 else s for s in begins)

    tried = np.linspace(-1.0, 1.0, 25) * (MOMENTS[1] - MOMENTS[0])
    return moved(min(tried, key=lambda by: float(np.sum(_fit(records, _acting(records, moved(by)))[1] ** 2))))


def turned_finding(turned: Turned, finger: str, joint: str) -> tuple[float, Finding]:
    """The finding, with its weight."""
    acting = _acting(turned.records, turned.begins)
    fit, contrast = _proof(turned.records, acting)
    turn, left = np.deg2rad([abs(turned.step_deg), fit["after"]])
    error = 1.96 * left / np.sqrt(_strokes_of(turned.records))
    trials = [r.state.trial for r, begin in zip(turned.records, turned.begins, strict=True) if begin < 1]
    moment_s = turned.steps[0].time_s
    parameters = {
        "turn": {
            "value": float(turn),
            "unit": "rad",
            "ci95": [float(max(turn - error, 0.0)), float(turn + error)],
        },
        "moment": {"value": moment_s, "unit": "s"},
    }
    share = float(np.mean(np.concatenate(acting)))
    moved = abs(turned.step_deg) * float(np.sqrt(share * (1 - share))) / fit["noise_floor"]
    where = {
        "finger": finger,
        "joint": joint,
        "actuator": None,
        "signal": "markers",
        "marker": None,
        "trials": trials,
        "region": None,
        "share_of_mismatch": max(1.0 - fit["after"] ** 2 / fit["before"] ** 2, 0.0),
    }
    text = (
        f"{finger} {joint}: the support turned about the joint's axis by {abs(turned.step_deg):.2f} deg at "
        f"{moment_s:.1f} s of {trials[0]}: the angle steps against the joint before it, and stays."
    )
    probability = float(1 - np.exp(-min(turned.evidence, 700.0)))
    return weighed(moved, contrast), Finding(
        "support_slip", ("support_slip",), probability, (), where, text, parameters, fit, None, CORRECTION
    )


def _proof(records: Sequence[_Record], acting: Sequence[Array]) -> tuple[dict[str, Any], float]:
    """`fit` of a finding: what the map between the joints leaves of recordings kept out (of all where none is) without
    the step and with it, as it is learned from the others; and how large the angle is over its noise."""
    known = [i for i, r in enumerate(records) if not r.state.validate] or list(range(len(records)))
    told = [i for i in range(len(records)) if i not in known] or known
    left = []
    for columns in (None, acting):
        theta = _fit([records[i] for i in known], columns and [columns[i] for i in known])[0]
        designs = [
            records[i].known if columns is None else np.column_stack([records[i].known, columns[i]]) for i in told
        ]
        left.append(np.concatenate([records[i].angle - x @ theta for i, x in zip(told, designs, strict=True)]))
    noise = float(np.median(np.abs(np.diff(left[1])))) / 0.6745 / 2**0.5 + 1e-12
    before, after = (float(np.sqrt(np.mean(e**2))) for e in left)
    fit = {
        "metric": "angle_rmse",
        "unit": "deg",
        "before": before,
        "after": after,
        "noise_floor": noise,
        "ci95_reduction": None,
        "held_out": [records[i].state.trial for i in told if records[i].state.validate],
        "engine": "map between the joints",
    }
    return fit, float(np.std(np.concatenate([r.angle for r in records]))) / noise
