"""Dry friction that gives before it slips: the same motion by half swings, by steps, in MuJoCo and by fine
integration; and found where it is."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rig_bench import HEAD
from rig_pendulum import PENDULUM

from hand_model.rig import replay_rig
from hand_model.rig.bristles import Bristles, slowed
from hand_model.rig.mjcf import write_effects
from hand_model.rig.swing.compete import compete_swing, fit_stages
from hand_model.rig.swing.fit import Task
from hand_model.rig.swing.free import free_errors, swings_free
from hand_model.rig.swing.simulation import INDEX, Lane, Swing, errors, vector
from hand_model.rig.swing.variants import free_declared
from hand_model.session import read_session

INERTIA, WEIGHT, DAMPING, FRICTION = 0.022, 0.981, 2e-4, 2e-3
LAW = {"inertia": INERTIA, "damping": DAMPING, "coulomb": FRICTION}
FINE = 1e-4


def fine(times: np.ndarray, start: float, reach: float, drive: float = 0.0, hz: float = 0.0) -> np.ndarray:
    """Angles at times of a pendulum let go at rest, its bristles bent from outside; driven by a sine of that size."""
    q, v, z = start, 0.0, math.copysign(1.0, start) if start else 0.0
    out, each = np.empty(len(times)), round((times[1] - times[0]) / FINE)
    for k in range(each * len(times)):
        if k % each == 0:
            out[k // each] = q
        asked = drive * math.sin(2 * math.pi * hz * k * FINE)
        v += FINE * (asked - WEIGHT * math.sin(q) - DAMPING * v - FRICTION * z) / INERTIA
        way = math.copysign(1.0, v)
        z = way + (z - way) * math.exp(-abs(FINE * v) / reach)
        q += FINE * v
    return out


def swing(recorded: np.ndarray, times: np.ndarray, **more: object) -> Swing:
    n = len(times)
    lane = Lane("a", False, np.zeros(n), 1.0, recorded, (float(recorded[0]), 0.0), np.zeros(n), np.ones(n))
    period_s = 2 * np.pi * math.sqrt(INERTIA / WEIGHT)
    return Swing((lane,), WEIGHT, 0.0, LAW, False, float(times[1] - times[0]), period_s, **more)


@pytest.mark.parametrize("start", [1.0, 0.1, 0.02])
@pytest.mark.parametrize("reach", [1e-3, 4e-3])
def test_half_swings_move_as_bristles_let_them(start: float, reach: float) -> None:
    """Where they slip, and in the end, where they hardly do; friction that turns round at once moves otherwise."""
    times = 5e-3 * np.arange(4000)
    some = swing(fine(times, start, reach), times)
    assert swings_free(some)
    left, at_once = (
        free_errors(some, vector({**LAW, "reach": r})[None], np.array([0]))[:, 0].std() for r in (reach, 0.0)
    )
    assert left < 3e-4
    assert at_once > 4 * left


def test_steps_follow_a_driven_joint_through_its_bristles() -> None:
    times = 2e-3 * np.arange(3000)
    recorded = fine(times, 0.0, 5e-3, 0.05, 0.7)
    some = swing(recorded, times)
    drive = 0.05 * np.sin(2 * np.pi * 0.7 * times)
    some = replace(some, driven=True, lanes=(replace(some.lanes[0], drive=drive, start=(0.0, 0.0)),))
    law = {**LAW, "gain": 1.0}
    left = [errors(some, vector({**law, "reach": r})[None], np.array([0])).std() for r in (5e-3, 0.0)]
    assert left[0] < 0.01 * np.std(recorded)
    assert left[1] > 3 * left[0]


def test_bristles_that_do_not_give_clip_the_impulse() -> None:
    free, stop = np.array([0.5, 0.1, -0.1, -0.5, 0.0]), np.full(5, 0.2)
    out = slowed(free, stop, np.zeros(5), np.full(5, 1e12))
    assert out == pytest.approx(free - np.clip(free, -stop, stop), abs=1e-10)


def test_bristles_hold_what_a_resting_joint_carries() -> None:
    assert Bristles(1e-3)(0.3, 0.0, 0.7, 2.0, 1e6) == pytest.approx(0.7)
    assert Bristles(1e-3)(0.3, 0.0, 3.0, 2.0, 1e6) == pytest.approx(2.0)
    moving = Bristles(1e-3)
    assert moving(0.3, -9.0, 0.0, 2.0, 1.0) == pytest.approx(-2.0)
    assert moving(0.31, 9.0, 0.0, 2.0, 1e9) == pytest.approx(2.0, rel=1e-3)  # ten reaches further


def test_mujoco_moves_as_bristles_let_it(tmp_path: Path) -> None:
    """The file with its record in MuJoCo against the fine integration."""
    text = PENDULUM.replace('<actuator><motor name="motor" joint="hinge"/></actuator>', "")
    text = text.replace('frictionloss="0.05"', f'frictionloss="{FRICTION}"').replace(
        'damping="0.02"', f'damping="{DAMPING}"'
    )
    assert f'"{DAMPING}"' in text
    (tmp_path / "log").mkdir()
    times = 5e-3 * np.arange(3000)
    table = np.stack([times, fine(times, 0.2, 4e-3)], 1)
    np.savetxt(tmp_path / "log/a.csv", table, delimiter=",", header="time,position", comments="", fmt="%.12g")
    (tmp_path / "session.toml").write_text(
        HEAD.replace('torque = "actuator:motor:force"\n', "") + '[[trial]]\nkind = "motion"\nlog = "log/a.csv"\n'
    )
    left = []
    for record in ([{"joint": "hinge", "swing": {"reach": 4e-3}}], []):
        (tmp_path / "rig.xml").write_bytes(write_effects(text.encode(), record))
        left.append(replay_rig(read_session(tmp_path)).figure("position_rmse", False))
    assert left[0] < 1e-3
    assert left[1] > 4 * left[0]


def test_a_bearing_that_gives_is_named_with_its_reach() -> None:
    """Four swings of other sizes behind an encoder of 0.1 mrad; not where friction turns round at once."""
    times, noise = 5e-3 * np.arange(1200), np.random.default_rng(3)
    for reach, named in ((0.012, ["presliding_friction"]), (1e-5, [])):
        lanes = []
        for k, start in enumerate((0.9, 0.5, 0.3, 0.15)):
            recorded = fine(times, start, reach) + 1e-4 * noise.standard_normal(len(times))
            lanes.append(replace(swing(recorded, times).lanes[0], trial=f"t{k}"))
        some = replace(swing(lanes[0].position, times, resolution=1e-4), lanes=tuple(lanes))
        declared = fit_stages([some], [Task(free_declared(some), vector(some.initial), ())], 15)[0]
        taken = compete_swing([some], declared, 1e-4, some)
        found = [v.effect for v, _ in taken]
        assert found[: len(named)] == named
        if named:
            assert taken[0][1].fit.theta[INDEX["reach"]] == pytest.approx(reach, rel=0.1)
        else:
            assert "presliding_friction" not in found
