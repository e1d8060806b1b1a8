"""A support that turned about its joint's own axis: markers alone cannot tell it from motion, the joint before it can."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...effects.path import strokes
from ..findings import Finding, weighed
from .angles import Step

Array = NDArray[np.float64]

BEYOND_CHANCE = 12.0  # log likelihood that a step must bring over none: for its size, and the moments that are tried
PLAINER = 3.0  # that it must bring over a drift, and a while that ends may bring over it
MOMENTS, WHILES = 72, 12  # that are tried along a recording
FEWEST = 8  # strokes
SAMPLES = 500  # of a recording
STROKE = 0.2  # of the range, that a stroke covers
CORRECTION = "the step of the angle is taken out of the map between the joints"


@dataclass(frozen=True)
class _Record:
    """Thinned samples of a recording. share (n,): of its length; known (n, P): declared columns, the way of the motion
    and the time; angle (n,) [deg]; stroke (n,): number, counted on through all recordings."""

    share: Array
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
    """step_deg: of the angle; evidence: log likelihood over no step; steps: when, in each recording in which it sets
    in."""

    step_deg: float
    evidence: float
    steps: tuple[Step, ...]


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
    if gain - np.log(len(tried)) < BEYOND_CHANCE or gain < drift + PLAINER or _ends(records, tried[best]):
        return None
    if _steps_too(_records(before), best):
        return None
    best = _refined(records, best)
    steps = tuple(
        Step(r.index, float(r.state.time_s[0] + max(s, 0.0) * np.ptp(r.state.time_s)), r.index)
        for r, s in zip(records, best, strict=True)
        if s < 1
    )
    return Turned(float(_fit(records, _acting(records, best))[0][-1]), gain, steps)


def _records(states: Sequence[DriveState]) -> list[_Record]:
    out, first = [], 0
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
        out.append(_Record(share[good], known[good], state.effort[good], first + number, state))
        first = out[-1].stroke[-1] + 1
    return out


def _moments(records: Sequence[_Record]) -> Iterator[tuple[float, ...]]:
    """Shares of each recording from which it acts: the same of each, or none of those before one and all of those after
    it."""
    grid = np.linspace(0.04, 0.96, MOMENTS)
    yield from ((float(s),) * len(records) for s in grid)
    for k in range(len(records)) if len(records) > 1 else ():
        yield from ((1.1,) * k + (float(s),) + (0.0,) * (len(records) - k - 1) for s in grid)


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
    size = np.linalg.norm(x, axis=0) + 1e-300
    theta = np.linalg.lstsq(x / size, y)[0] / size
    return theta, y - x @ theta


def _scatter(records: Sequence[_Record], column: Sequence[Array] | None) -> float:
    """Sum of squares of the strokes' mean residuals [deg^2] beside the declared map, the way of the motion and a
    column."""
    left, stroke = _fit(records, column)[1], np.concatenate([r.stroke for r in records])
    counts = np.bincount(stroke)
    return float(np.sum((np.bincount(stroke, left) / np.maximum(counts, 1)) ** 2)) + 1e-12


def _ends(records: Sequence[_Record], stays: float) -> bool:
    """Whether it is over before the recordings are, rather: an obstacle, a while."""
    grid = np.linspace(0.04, 0.9, WHILES)
    least = min(
        _scatter(records, [((r.share >= a) & (r.share < b)).astype(float) for r in records])
        for i, a in enumerate(grid)
        for b in grid[i + 1 :]
    )
    return _likelier(_strokes_of(records), stays, least) > PLAINER


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

    tried = np.linspace(-1.0, 1.0, 25) * 0.92 / (MOMENTS - 1)
    return moved(min(tried, key=lambda by: float(np.sum(_fit(records, _acting(records, moved(by)))[1] ** 2))))


def turned_finding(turned: Turned, states: Sequence[DriveState], finger: str, joint: str) -> tuple[float, Finding]:
    """The finding, with its weight."""
    records, begins = _records(states), {s.record: s.time_s for s in turned.steps}
    acting = [
        (r.state.time_s[0] + r.share * np.ptp(r.state.time_s) >= begins.get(r.index, np.inf)) * 1.0 for r in records
    ]
    fit, contrast = _proof(records, acting)
    turn, steps = np.deg2rad([abs(turned.step_deg), fit["after"]]), max(_strokes_of(records), 1)
    error = 1.96 * turn[1] / np.sqrt(steps)
    first = turned.steps[0]
    name = next(r.state.trial for r in records if r.index == first.record)
    parameters = {
        "turn": {
            "value": float(turn[0]),
            "unit": "rad",
            "ci95": [float(max(turn[0] - error, 0.0)), float(turn[0] + error)],
        },
        "moment": {"value": first.time_s, "unit": "s"},
    }
    share = float(np.mean(np.concatenate(acting)))
    moved = abs(turned.step_deg) * float(np.sqrt(share * (1 - share))) / fit["noise_floor"]
    where = {
        "finger": finger,
        "joint": joint,
        "actuator": None,
        "signal": "markers",
        "marker": None,
        "trials": [r.state.trial for r in records if r.index in begins],
        "region": None,
        "share_of_mismatch": max(1.0 - fit["after"] ** 2 / fit["before"] ** 2, 0.0),
    }
    text = (
        f"{finger} {joint}: the support turned about the joint's axis by {abs(turned.step_deg):.2f} deg at "
        f"{first.time_s:.1f} s of {name}: the angle steps against the joint before it, and stays."
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
