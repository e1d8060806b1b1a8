"""The load that a motor passes on, read from its current."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_motion import state
from test_kinematic_stations import joint

from hand_model.diagnose.locate.load import transmitted_loads, with_likelier_load
from hand_model.diagnose.locate.motion import estimate_motion, least_error
from hand_model.effects.base import DriveState
from hand_model.effects.path import dahl

NOISE = 5.0


def test_load_is_the_current_without_what_accelerates_the_motor_and_without_most_of_its_noise() -> None:
    s = state()
    load = 0.2 * s.position + 9.0 + 35.0 * dahl(s.position, 0.7) + 0.15 * s.velocity
    load += 6.0 * np.sin(2 * np.pi * s.time_s / 15.0)  # no function of the motion
    rng = np.random.default_rng(3)
    current = load + 0.013 * s.acceleration + rng.normal(0, NOISE, len(load))
    motion = estimate_motion(s.time_s, s.position + rng.normal(0, 0.02, len(load)))
    found = transmitted_loads(s.time_s, current, motion)[0].load
    # a reversal within one sample interval is known no better than that
    steady = np.abs(s.velocity) > 5.0
    assert np.sqrt(np.mean((found - load)[steady] ** 2)) < 0.3 * NOISE


def test_what_a_controller_does_at_rest_says_nothing_of_the_load() -> None:
    t = np.arange(2400) * 0.018
    phase = np.clip(np.mod(t, 3.0) - 1.0, 0.0, 1.0)  # a second's move, two seconds' rest
    x = 10 + 80 * np.abs(np.mod(np.floor(t / 3.0), 2) - phase)
    motion = estimate_motion(t, x + np.random.default_rng(2).normal(0, 0.02, len(t)))
    load = 0.2 * x + 9.0 + 35.0 * dahl(x, 0.7) + 0.15 * np.gradient(x, t)
    moving = np.abs(np.gradient(x, t)) > 1.0
    noise = np.random.default_rng(4).normal(0, NOISE, len(t))
    inside = moving & np.roll(moving, 3) & np.roll(moving, -3)
    for at_rest in (1.0, 0.0):
        found = transmitted_loads(t, np.where(moving, load, at_rest * load) + noise, motion)[-1].load
        assert np.sqrt(np.mean((found - load)[inside] ** 2)) < 0.5 * NOISE


def test_a_controller_that_lets_go_at_every_rest_otherwise_leaves_the_load_what_it_was() -> None:
    """Friction holds what gives where the motion left it, and what the drive is asked for as it comes to rest and leaves it
    is its controller's: where that was taken for load, plays had the better word."""
    t = np.arange(4800) * 0.018
    stroke = np.floor(t / 3.0).astype(int)
    lasting = np.array([1.0, 1.9, 0.6, 1.4])[stroke // 2 % 4]  # rests of one to two and a half seconds
    share = np.clip((np.mod(t, 3.0) - 0.5) / lasting, 0.0, 1.0)
    x = 10 + 80 * np.abs(stroke % 2 - (0.5 - 0.5 * np.cos(np.pi * share)))
    rng = np.random.default_rng(2)
    motion = estimate_motion(t, x + rng.normal(0, 0.05, len(t)))
    velocity = np.gradient(x, t)
    load = 0.2 * x + 9.0 + 35.0 * dahl(x, 0.5) + 0.15 * velocity
    moving = np.abs(velocity) > 1.0
    asked = np.where(moving, load, rng.uniform(-30, 30, 40)[stroke % 40])
    asked += np.where(moving & ~np.roll(moving, 4), 12.0 * np.sign(velocity), 0.0)
    found = transmitted_loads(t, asked + rng.normal(0, NOISE, len(t)), motion)[-1].load
    resting = ~np.any([np.roll(moving, k) for k in range(-3, 4)], axis=0)
    assert resting.sum() > 1500 and np.sqrt(np.mean((found - load)[resting] ** 2)) < NOISE


@pytest.mark.parametrize("held", [True, False])
def test_angles_tell_whether_friction_holds_the_load_at_rest(held: bool) -> None:
    """Or whether what a controller does there is passed on."""
    states, rng = joint(5, noise=0.05), np.random.default_rng(6)

    def at_rest(s: DriveState) -> DriveState:
        flows = s.extra["load"] + np.where(np.abs(s.velocity) < 20.0, rng.normal(0, 12.0, len(s.time_s)), 0.0)
        other = s.extra["load"] if held else flows
        extra = {**s.extra, "load": flows, "held_load": s.extra["load"], "held_drag": s.extra["drag"]}
        return replace(s, effort=s.effort - 0.02 * s.slope * other, extra=extra)

    told = tuple(at_rest(s) for s in states)
    for before, after in zip(told, with_likelier_load(told), strict=True):
        assert np.array_equal(after.extra["load"], before.extra["held_load" if held else "load"])
        assert not any(name.startswith("held") for name in after.extra)


def test_what_friction_has_built_up_stays_at_rest_however_the_position_is_read() -> None:
    """A give follows the load: where noise of the position undid friction at rest, plays had the better word."""
    t = np.arange(2400) * 0.018
    phase = np.clip((np.mod(t, 3.0) - 1.0) / 1.4, 0.0, 1.0)  # rests of 1.6 s
    x = 10 + 80 * np.abs(np.mod(np.floor(t / 3.0), 2) - phase)
    load = 0.2 * x + 9.0 + 35.0 * dahl(x, 0.6)
    rng = np.random.default_rng(5)
    motion = estimate_motion(t, x + rng.normal(0, 0.12, len(t)))
    found = transmitted_loads(t, load + rng.normal(0, NOISE, len(t)), motion)[-1].load
    resting = ~np.any([np.roll(motion.moving, k) for k in range(-10, 11)], axis=0)
    assert resting.sum() > 500 and np.sqrt(np.mean((found - load)[resting] ** 2)) < 0.25 * NOISE


def test_rows_that_are_stamped_in_packets_are_smoothed_all_the_same() -> None:
    t = np.repeat(np.arange(100) * 0.14, 8) + np.tile(np.arange(8) * 2e-5, 100)
    smooth, _ = least_error(t, np.sin(t) + np.random.default_rng(0).normal(0, 0.3, len(t)))
    assert np.isfinite(smooth).all() and np.sqrt(np.mean((smooth - np.sin(t)) ** 2)) < 0.3


def test_a_motor_that_never_moved_passes_its_current_on() -> None:
    t = np.arange(400) * 0.02
    current = 7.0 + np.random.default_rng(1).normal(0, NOISE, len(t))
    (found,) = (p.load for p in transmitted_loads(t, current, estimate_motion(t, np.full(len(t), 30.0))))
    assert np.abs(found - 7.0).max() < 0.6 * NOISE
