"""Times of a log's rows against its own motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.session.log import build_log
from hand_model.session.stamps import evened

STEP_S = 0.014


def log_read_at(read_s: np.ndarray, stamped_s: np.ndarray, seed: int = 0):
    """A log of strokes between rests, read and stamped at these times, with 2 counts of noise."""
    stroke = np.clip(1.4 * np.sin(2 * np.pi * read_s / 5.0), -1, 1)
    position = np.round(6000 + 5000 * stroke + np.random.default_rng(seed).normal(0, 2, len(read_s)))
    return build_log(stamped_s, {"position": position}, Path("log.csv"))


@pytest.mark.parametrize("wrong_s", [1e-3, 3e-3])
def test_stamps_that_the_motion_does_not_follow_are_evened(wrong_s: float) -> None:
    rng = np.random.default_rng(1)
    turns = np.delete(np.arange(3000), [700, 1500, 1501, 1502])  # rows were lost, too
    read = STEP_S * turns
    log = evened(log_read_at(read, np.sort(read + wrong_s * rng.standard_normal(len(read)))))
    inner = slice(20, -20)
    assert np.std((log.time_s - read)[inner]) < 0.35 * wrong_s
    assert np.all(np.diff(log.time_s) > 0)
    assert log.uneven == (log.stamps_wrong_s > 0) and log.stamps_wrong_s < 0.3 * wrong_s
    assert "spread evenly" in log.notes[-1]


def test_what_the_motion_follows_stays_in_the_times_and_what_is_left_is_told() -> None:
    rng = np.random.default_rng(2)
    read = np.cumsum(rng.uniform(0.6, 1.4, 3000)) * STEP_S
    wrong = 4e-3
    stamped = np.sort(read + wrong * rng.standard_normal(len(read)))
    log = evened(log_read_at(read, stamped))
    error = np.std(np.diff(log.time_s) - np.diff(read)) / np.sqrt(2)
    assert error < 0.75 * np.std(np.diff(stamped) - np.diff(read)) / np.sqrt(2)
    assert log.stamps_wrong_s == pytest.approx(error, rel=0.25)


@pytest.mark.parametrize("unrest", [0.0, 0.1, 0.4])
def test_right_stamps_stay_as_they_are(unrest: float) -> None:
    rng = np.random.default_rng(3)
    read = np.cumsum(rng.uniform(1 - unrest, 1 + unrest, 3000)) * STEP_S
    log = log_read_at(read, np.round(read, 5))
    assert evened(log) is log


def test_unrest_that_harms_nothing_stays() -> None:
    read = STEP_S * np.arange(3000)
    log = log_read_at(read, read + 0.1e-3 * np.random.default_rng(4).standard_normal(3000))
    assert evened(log) is log
