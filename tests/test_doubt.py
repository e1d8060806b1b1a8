"""What is not known of a drive's effort near its starts and stops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_diagnose import drive

from hand_model.diagnose.locate.doubt import LONGER, with_doubt
from hand_model.effects.base import DriveState
from hand_model.effects.path import from_rest

FRICTION, NOISE, GRANTED = 35.0, 5.0, 1.0


def states(departure: float = 0.0, samples: int | None = None) -> tuple[DriveState, ...]:
    """A drive whose motion is known as a simulated one is, its stops half a second long; `departure` [raw]: by how much
    its effort is off within 2 % after a start."""
    out = []
    for state in drive(3, noise=NOISE):
        keep = slice(0, samples)
        position, moving = state.position.copy(), np.abs(state.velocity) > 1
        moving &= ~((position < 1e-9) | (position > 100 - 1e-9))
        after = from_rest(position, moving)
        effort = np.where(moving, state.effort + departure * (after < 2 * GRANTED), np.nan)
        n = np.ones(len(position))
        known = {
            "steady": (moving & (after > 4.0)).astype(float),
            "smoothed": 0 * n,
            "granted": GRANTED * n,
            "give": GRANTED / LONGER * n,
            "position_noise": 0.02 * n,
        }
        cut = {k: v[keep] for k, v in {**state.extra, **known}.items()}
        values = {k: getattr(state, k)[keep] for k in ("time_s", "position", "velocity", "acceleration", "declared")}
        out.append(replace(state, effort=effort[keep], extra=cut, **values))
    return tuple(out)


def starting(state: DriveState) -> np.ndarray:
    """Samples within the reach of friction after a start."""
    moving = np.isfinite(state.effort)
    return moving & (from_rest(state.position, moving) < 2 * GRANTED)


def test_a_drive_that_starts_as_declared_is_known_there() -> None:
    doubt = np.concatenate([s.extra["sigma"][starting(s)] for s in with_doubt(states())])
    assert len(doubt) > 50
    assert np.median(doubt) < FRICTION / 3


def test_what_departs_after_starts_counts_as_unknown_by_as_much_and_never_by_more_than_friction() -> None:
    least = -np.inf
    for departure in (0.0, 12.0, 30.0, 300.0):
        told = with_doubt(states(departure))
        doubt = np.concatenate([s.extra["sigma"][starting(s)] for s in told])
        assert np.median(doubt) > min(departure, 0.9 * FRICTION)
        assert np.median(doubt) > least
        least = np.median(doubt) - 1e-9
        timing = 0.2 * FRICTION + 0.002 * 3000.0
        assert np.max(doubt) < np.hypot(1.2 * FRICTION + departure / 10, timing)


def test_stops_are_judged_apart_from_starts() -> None:
    told = with_doubt(states(30.0))
    middle = [np.isfinite(s.effort) & (np.abs(s.position - 50) < 20) for s in told]
    assert max(float(np.median(s.extra["sigma"][m])) for s, m in zip(told, middle, strict=True)) < 0.2 * NOISE
    stopping = [
        np.isfinite(s.effort)
        & (from_rest(s.position[::-1], np.isfinite(s.effort)[::-1])[::-1] < 2 * GRANTED)
        & ~starting(s)
        for s in told
    ]
    before = np.concatenate([s.extra["sigma"][m] for s, m in zip(told, stopping, strict=True)])
    after = np.concatenate([s.extra["sigma"][starting(s)] for s in told])
    assert np.median(before) < 0.5 * np.median(after)


def test_of_few_samples_all_that_friction_may_hold_is_unknown() -> None:
    few = states(samples=60)
    for state in with_doubt(few):
        at = starting(state)
        assert np.all(state.extra["slides"][at] == 0)
        assert np.all(state.extra["sigma"][at] > 0.5 * NOISE)
