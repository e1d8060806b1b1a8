"""Times of a log's rows against its own motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.session import Trial
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
    turns = np.delete(np.arange(3000), [700, 1500, 1503, 1504])  # rows were lost, too
    read = STEP_S * turns
    log = evened(log_read_at(read, np.sort(read + wrong_s * rng.standard_normal(len(read)))))
    inner = slice(20, -20)
    assert np.std((log.time_s - read)[inner]) < 0.35 * wrong_s
    assert np.all(np.diff(log.time_s) > 0)
    assert log.stamps_wrong_s < 0.3 * wrong_s
    assert "spread evenly" in log.notes[-1]


def test_packets_that_wait_for_each_other_lose_no_rows() -> None:
    read = STEP_S * np.delete(np.arange(3000), [700, 1500])
    stamped = read + 0.04 * (np.arange(len(read)) // 12 % 3)
    for i in range(1, len(stamped)):  # what waited comes at once
        stamped[i] = max(stamped[i], stamped[i - 1] + 1e-5)
    log = evened(log_read_at(read, stamped))
    error = (log.time_s - read)[60:-60]
    assert np.std(error) < 0.25 * np.std((stamped - read)[60:-60])
    assert abs(np.polyfit(read[60:-60], error, 1)[0]) < 5e-5  # and make no drift


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


def test_a_drive_that_stops_among_lost_rows_says_nothing_of_its_stamps() -> None:
    rng = np.random.default_rng(5)
    read = np.cumsum(rng.uniform(0.6, 1.4, 3000)) * STEP_S
    in_motion = np.flatnonzero(np.abs(np.sin(2 * np.pi * read / 5.0)) < 0.2)
    for begin in in_motion[[40, 160, 280]]:
        read[begin:] += 0.3  # it waits meanwhile, as the stroke does not go on
    log = log_read_at(read - 0.3 * np.searchsorted(in_motion[[40, 160, 280]], np.arange(3000), side="right"), read)
    assert evened(log) is log


def test_a_row_that_is_alone_keeps_its_time() -> None:
    rng = np.random.default_rng(6)
    turns = np.delete(np.arange(4000), np.r_[1000:1300, 1301:1600])
    read = STEP_S * turns
    log = evened(log_read_at(read, np.sort(read + 2e-3 * rng.standard_normal(len(read)))))
    assert np.isfinite(log.time_s).all() and np.all(np.diff(log.time_s) > 0)
    assert np.abs(log.time_s - read).max() < 8e-3


def test_a_wider_kernel_must_leave_less() -> None:
    """The interval between rows varies slowly by a third: a wide one would follow that no more."""
    rng = np.random.default_rng(7)
    read = np.cumsum(STEP_S * (1 + 0.3 * np.sin(np.arange(3000) / 60.0)))
    stamped = np.sort(read + 2e-3 * rng.standard_normal(3000))
    assert np.std((evened(log_read_at(read, stamped)).time_s - read)[20:-20]) < 3e-3


def test_a_trial_of_a_hand_reads_its_log_so(tmp_path: Path) -> None:
    read = STEP_S * np.arange(3000)
    stamped = read + 2e-3 * np.random.default_rng(8).standard_normal(3000)
    log = log_read_at(read, np.sort(stamped))
    rows = [f"{t:.6f},{p:.0f}" for t, p in zip(log.time_s, log.column("position"), strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("time,position\n" + "\n".join(rows) + "\n")
    hand, rig = (Trial(kind, "log/index.csv", log_path=path) for kind in ("flexion", "motion"))
    assert np.std(hand.log().time_s - read) < 0.5 * np.std(rig.log().time_s - read)
    assert np.array_equal(rig.log().time_s, np.round(np.sort(stamped), 6))
