"""The load that a motor passes on, read from its current."""

from __future__ import annotations

import numpy as np
from drive_motion import state

from hand_model.diagnose.locate.load import transmitted_load
from hand_model.diagnose.locate.motion import estimate_motion
from hand_model.effects.path import dahl

NOISE = 5.0


def test_load_is_the_current_without_what_accelerates_the_motor_and_without_most_of_its_noise() -> None:
    s = state()
    load = 0.2 * s.position + 9.0 + 35.0 * dahl(s.position, 0.7) + 0.15 * s.velocity
    load += 6.0 * np.sin(2 * np.pi * s.time_s / 15.0)  # no function of the motion
    rng = np.random.default_rng(3)
    current = load + 0.013 * s.acceleration + rng.normal(0, NOISE, len(load))
    found = transmitted_load(s.time_s, current, estimate_motion(s.time_s, s.position + rng.normal(0, 0.02, len(load))))
    # a reversal within one sample interval is known no better than that
    steady = np.abs(s.velocity) > 5.0
    assert np.sqrt(np.mean((found - load)[steady] ** 2)) < 0.3 * NOISE


def test_a_motor_that_never_moved_passes_its_current_on() -> None:
    t = np.arange(400) * 0.02
    current = 7.0 + np.random.default_rng(1).normal(0, NOISE, len(t))
    found = transmitted_load(t, current, estimate_motion(t, np.full(len(t), 30.0)))
    assert np.abs(found - 7.0).max() < 0.6 * NOISE
