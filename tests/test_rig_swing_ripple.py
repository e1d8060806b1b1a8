"""A ripple of a joint that is told by its voltage: sought at the periods that its balance shows, and simulated alike."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, HEAD, written

from hand_model.rig import diagnose_rig
from hand_model.rig.swing.fit import Task, fit_together
from hand_model.rig.swing.simulation import INDEX, Lane, Swing, simulate, vector
from hand_model.session import read_session

CONSTANT, RESISTANCE = 0.35, 3.4
INERTIA, WEIGHT, DAMPING, FRICTION = 0.022, 0.981, 0.02, 0.05
STEP = 5e-4


def servo(size: float, period: float, phase: float, seed: int) -> np.ndarray:
    """Time, position and voltage (n, 3) of a joint that follows a target, every 4 ms."""
    random = np.random.default_rng(seed)
    rate, turn = 2 * np.pi * random.uniform([0.25, 0.6], [0.45, 1.1]), random.uniform(0, 6, 2)
    q = v = 0.0
    rows = []
    for k in range(int(8 / STEP)):
        if k % 8 == 0:
            target = 0.8 * math.sin(rate[0] * k * STEP + turn[0]) + 0.3 * math.sin(rate[1] * k * STEP + turn[1])
            volts = 60.0 * (target - q) - 0.5 * v
            rows.append((k * STEP, q, volts))
        gain = CONSTANT / RESISTANCE
        effort = gain * (volts - CONSTANT * v) - WEIGHT * math.sin(q) - DAMPING * v
        effort -= size * math.sin(2 * math.pi * q / period + phase)
        free, slip = v + STEP * effort / INERTIA, STEP * FRICTION / INERTIA
        v = 0.0 if abs(free) <= slip else free - math.copysign(slip, free)
        q += STEP * v
    table = np.array(rows)
    table[:, 1] = np.round(table[:, 1] / 4e-4) * 4e-4
    return table


def test_a_ripple_is_named_with_its_period_and_simulated_in_mujoco(tmp_path: Path) -> None:
    """What is left of the motion in MuJoCo, of the file that keeps it, is a small part."""
    motor = f'<dcmotor name="motor" joint="hinge" motorconst="{CONSTANT} {CONSTANT}" resistance="{RESISTANCE}"/>'
    arm = ARM.replace('<motor name="motor" joint="hinge"/>', motor)
    tables = [servo(0.12, 0.31, 0.8, seed) for seed in range(5)]
    folder = written(tmp_path / "s", arm, HEAD.replace("motor:force", "motor:ctrl"), "torque", tables)
    found = diagnose_rig(read_session(folder))
    first = found.findings[0]
    assert first.effect == "torque_ripple"
    told = {k: v["value"] for k, v in first.parameters.items()}
    assert told["ripple_period"] == pytest.approx(0.31, rel=0.02)
    assert math.hypot(told["ripple_sine"], told["ripple_cosine"]) == pytest.approx(0.12, rel=0.1)
    assert found.lack_of_fit["after"] < 0.25 * found.lack_of_fit["before"]


def test_what_does_not_come_again_within_the_range_is_no_ripple() -> None:
    """A fit that would widen the period stops at half of the range."""
    n = 1500
    drive = 2.0 * np.sin(2 * np.pi * 0.4 * 4e-3 * np.arange(n))
    lane = Lane("a", False, drive, 1.0, np.zeros(n), (0.0, 0.0), np.zeros(n), np.ones(n))
    law = {"inertia": INERTIA, "damping": 0.1, "coulomb": 0.02, "gain": 0.3, "back_emf": 0.02}
    truth = vector({**law, "ripple_sine": 0.2, "ripple_period": 1.5})
    blank = Swing((lane,), WEIGHT, 0.0, law, True, 4e-3)
    q = simulate(blank, truth[None], np.array([0]))[:, 0]
    half = 0.5 * np.ptp(q)
    assert half < 1.5
    lane = Lane("a", False, drive, 1.0, q, (0.0, 0.0), np.zeros(n), np.ones(n))
    some = Swing((lane,), WEIGHT, 0.0, law, True, 4e-3, periods=(0.5 * half,))
    start = vector({**law, "ripple_period": 0.5 * half})
    fit = fit_together(some, [Task(("ripple_sine", "ripple_cosine", "ripple_period"), start, (0,))], 30)[0]
    assert fit.theta[INDEX["ripple_period"]] <= half
