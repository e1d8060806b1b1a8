"""The swing of a rig simulated: MuJoCo's motion, and the truth found again by output error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_bench import HEAD
from rig_pendulum import PENDULUM

from hand_model.rig import replay_rig
from hand_model.rig.swing.fit import Task, fit_together
from hand_model.rig.swing.simulation import Lane, Swing, errors, simulate, vector
from hand_model.session import read_session


def test_simulation_agrees_with_mujoco(tmp_path: Path) -> None:
    """A free pendulum with friction: the batch simulator and MuJoCo's replay of the written file are the same
    motion."""
    text = PENDULUM.replace('<actuator><motor name="motor" joint="hinge"/></actuator>', "").replace(
        'frictionloss="0.05"', 'frictionloss="0.02"'
    )
    (tmp_path / "log").mkdir()
    (tmp_path / "rig.xml").write_text(text)
    inertia, weight = 0.022, 0.5 * 0.2 * 9.81
    n = 2500
    lane = Lane("x", False, np.zeros(n), 1.0, np.zeros(n), (1.0, 0.0), np.zeros(n), np.ones(n))
    swing = Swing((lane,), weight, 0.0, {"inertia": inertia, "damping": 0.02, "coulomb": 0.02}, False)
    theta = vector(swing.initial)
    q = simulate(swing, theta[None], np.array([0]))[:, 0]
    table = np.stack([np.arange(n) * 2e-3, q], 1)
    np.savetxt(tmp_path / "log/a.csv", table, delimiter=",", header="time,position", comments="", fmt="%.12g")
    (tmp_path / "session.toml").write_text(
        HEAD.replace('torque = "actuator:motor:force"\n', "") + '[[trial]]\nkind = "motion"\nlog = "log/a.csv"\n'
    )
    residuals = replay_rig(read_session(tmp_path))
    assert residuals.figure("position_rmse", False) < 0.02 * np.std(q)


def test_output_error_fit_returns_to_the_truth() -> None:
    """Inertia, damping, friction and drag of a simulated swing, from a wrong start."""
    n = 2000
    lane = Lane("x", False, np.zeros(n), 1.0, np.zeros(n), (1.2, 0.0), np.zeros(n), np.ones(n))
    swing = Swing((lane,), 1.0, 0.0, {"inertia": 0.02, "damping": 0.01, "coulomb": 0.01}, False)
    truth = vector({"inertia": 0.022, "damping": 0.004, "coulomb": 0.006, "drag": 0.001})
    recorded = simulate(swing, truth[None], np.array([0]))[:, 0]
    swing = Swing(
        (Lane("x", False, lane.drive, 1.0, recorded, lane.start, lane.supply, lane.used),),
        1.0,
        0.0,
        swing.initial,
        False,
    )
    fit = fit_together(swing, [Task(("inertia", "damping", "coulomb", "drag"), vector(swing.initial), (0,))], 40)[0]
    assert np.abs(errors(swing, fit.theta[None], np.array([0]))).max() < 5e-3
    assert fit.theta[0] == pytest.approx(0.022, rel=1e-3)
