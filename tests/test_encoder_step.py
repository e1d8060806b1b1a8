"""Encoders that read in steps."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from hand_model.diagnose.locate.encoder_step import coarse, encoder_step


def log(step: float, noise: float, seed: int = 0) -> SimpleNamespace:
    """Positions [counts] of a drive that goes to and fro over 9000 counts and rests at both ends."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 40, 0.02)
    true = 4500 * (1 - np.clip(1.3 * np.cos(2 * np.pi * 0.11 * t * (1 + 0.01 * t)), -1, 1)) + 300
    read = step * np.round((true + 4 * rng.standard_normal(len(t))) / step) + noise * rng.standard_normal(len(t))
    return SimpleNamespace(column=lambda name: np.round(read))


@pytest.mark.parametrize(("step", "noise"), [(95.0, 0.0), (70.0, 8.0), (200.0, 10.0)])
def test_the_step_of_an_encoder_is_read_under_noise(step: float, noise: float) -> None:
    assert encoder_step([log(step, noise), log(step, noise, 1)]) == pytest.approx(step / 9000, rel=0.05)


@pytest.mark.parametrize(("step", "noise"), [(1.0, 0.0), (10.0, 2.0), (95.0, 60.0)])
def test_a_fine_encoder_or_one_whose_steps_drown_has_none(step: float, noise: float) -> None:
    assert encoder_step([log(step, noise), log(step, noise, 1)]) == 0.0


def test_a_copy_of_the_setpoint_is_no_coarse_encoder() -> None:
    setpoint = np.repeat([300.0, 4800.0, 9300.0, 2550.0], 200)
    assert encoder_step([SimpleNamespace(column=lambda name: setpoint)]) == 0.0


def test_steps_are_an_encoders_fault_where_another_of_the_hand_reads_finely() -> None:
    assert coarse({"index": 0.01, "ring": 0.0}) == {"index": 0.01}
    assert not coarse({"index": 0.01, "ring": 0.012}) and not coarse({"index": 0.01}) and not coarse({})
