"""Where a simulated swing starts, and how free that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_model.rig.swing.fit import jacobian
from hand_model.rig.swing.free import free_errors
from hand_model.rig.swing.free_fit import Task
from hand_model.rig.swing.simulation import PARAMETERS, Lane, Swing, simulate, vector
from hand_model.rig.swing.start import freed, started


def test_a_free_swing_starts_where_its_first_period_says() -> None:
    """Starts that are wrong by half a degree and 0.1 rad/s come back to what the recording was made with, at a friction
    that is wrong by a tenth; those of a driven joint stay."""
    theta = vector({"inertia": 0.02, "damping": 4e-4, "coulomb": 1e-3})
    starts, steps = ((1.2, 0.5), (0.3, -1.5), (-0.6, 2.0)), 1500
    blank = [
        Lane(n, False, np.zeros(steps), 1.0, np.zeros(steps), s, np.zeros(steps), np.ones(steps))
        for n, s in zip("abc", starts, strict=True)
    ]
    swing = Swing(tuple(blank), 0.8, 0.0, {"inertia": 0.02}, False, 4e-3, 1.0)
    q = simulate(swing, np.repeat(theta[None], 3, 0), np.arange(3))
    lanes = tuple(
        replace(lane, position=q[:, k], start=(lane.start[0] + 0.009, lane.start[1] - 0.1))
        for k, lane in enumerate(swing.lanes)
    )
    wrong = theta * np.where(np.isin(PARAMETERS, ("damping", "coulomb")), 1.1, 1.0)
    found = started(replace(swing, lanes=lanes), wrong)
    assert np.abs([np.subtract(lane.start, s) for lane, s in zip(found.lanes, starts, strict=True)]).max() < 0.005
    driven = replace(swing, lanes=lanes, driven=True)
    assert started(driven, wrong) is driven and freed(driven, wrong) is driven


def test_a_free_start_takes_no_part_in_what_a_law_is_held_to() -> None:
    """Under the true law nothing is left, whatever the start was taken for; of a wrong law it leaves what no start
    explains."""
    theta, steps = vector({"inertia": 0.02, "damping": 4e-4, "coulomb": 1e-3, "lateral": 4e-3}), 1500
    blank = Lane("a", False, np.zeros(steps), 1.0, np.zeros(steps), (0.5, -1.5), np.zeros(steps), np.ones(steps))
    swing = Swing((blank,), 0.8, 0.0, {"inertia": 0.02}, False, 4e-3, 1.0)
    q = free_errors(swing, theta[None], np.array([0]))[:, 0]
    swing = replace(swing, lanes=(replace(blank, position=q, start=(0.504, -1.53)),))
    zero = vector({"inertia": 0.02, "damping": 4e-4, "coulomb": 1e-3})  # whose encoder's zero is 5 mrad off

    def left(law: np.ndarray) -> float:
        residual, _ = jacobian(started(swing, law), Task(("inertia",), law, (0,)), law)
        return float(np.sqrt(np.mean(residual**2)))

    fixed = free_errors(started(swing, zero), zero[None], np.array([0]))
    assert left(theta) < 1e-4 * np.sqrt(np.mean(fixed**2))
    assert left(zero) > 0.5 * np.sqrt(np.mean(fixed**2))
