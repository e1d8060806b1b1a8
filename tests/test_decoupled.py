"""Whiles in which a finger is off its drive where no marker looks on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from drive_motion import TO_AND_FRO, to_and_fro

from hand_model.diagnose.locate.excursions import whiles_below

SPRING, PRELOAD = TO_AND_FRO[2:]


def drive(seed: int, released: tuple[tuple[float, float], ...] = (), pushed: tuple[float, float] = (0.0, 0.0)):
    """A recording of a motor, its spring off for some whiles [s], or more load for one."""
    state = to_and_fro(seed, 10, 4.0)
    t, effort = state.time_s, state.effort.copy()
    for a, b in released:
        effort -= np.where((t > a) & (t < b), SPRING * state.position + PRELOAD, 0.0)
    effort += np.where((t > pushed[0]) & (t < pushed[1]), 20.0, 0.0)
    return replace(state, effort=effort)


def test_whiles_without_its_spring_are_found_where_no_marker_sees_them() -> None:
    whiles = ((4.0, 5.2), (12.5, 13.8))
    states = (drive(1), drive(2, whiles), drive(3), drive(4))
    found = whiles_below(states, {"log/2.csv", "log/3.csv"})
    assert not found["log/3.csv"]
    assert all(any(a - 0.3 < x and y < b + 0.3 for a, b in whiles) for x, y in found["log/2.csv"])
    during = sum(b - a for a, b in found["log/2.csv"])
    assert during > 0.5 * sum(b - a for a, b in whiles)  # where the spring is open it pulls little


def test_a_load_that_comes_for_a_while_releases_nothing() -> None:
    states = (drive(1), drive(2, pushed=(4.0, 5.5)), drive(3), drive(4))
    found = whiles_below(states, {"log/2.csv", "log/3.csv"})
    assert found == {"log/2.csv": [], "log/3.csv": []}
    assert whiles_below(states, set()) == {}
