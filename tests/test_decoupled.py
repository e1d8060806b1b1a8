"""Whiles in which a finger is off its drive where no marker looks on."""

from __future__ import annotations

import numpy as np

from hand_model.diagnose.locate.excursions import whiles_below
from hand_model.effects.base import DriveState

SPRING, FRICTION, NOISE = 0.4, 20.0, 4.0


def drive(seed: int, released: tuple[tuple[float, float], ...] = (), pushed: tuple[float, float] | None = None):
    """A recording of a motor that goes to and fro over its range, its spring off for some whiles [s], or more load."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 20, 0.02)
    phase = 2 * np.pi * np.cumsum(rng.uniform(0.1, 0.35, 10).repeat(100)) * 0.02
    x, v = 50 - 50 * np.cos(phase), 50 * np.sin(phase) * np.gradient(phase, t)
    declared = np.stack([v, np.sign(v), x, np.ones(len(t))], 1)
    effort = declared @ [0.1, FRICTION, SPRING, 6.0] + NOISE * rng.standard_normal(len(t))
    for a, b in released:
        effort[(t > a) & (t < b)] -= (SPRING * x + 6.0)[(t > a) & (t < b)]
    if pushed is not None:
        effort[(t > pushed[0]) & (t < pushed[1])] += 20.0
    names = ("viscous", "coulomb", "spring", "preload")
    return DriveState(f"log/{seed}.csv", "index", t, x, v, 0 * v, effort, declared, "%", "raw", {}, names)


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
