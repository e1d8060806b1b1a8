"""Logs that were written faster than their hand was read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hand_model.session.log import build_log
from hand_model.session.repeats import without_repeats


def recorded(held: float, steps: float = 120.0, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Columns of strokes with rests between, and which rows were read anew: all but a share of them."""
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.009, 0.014, 3000))
    position = np.round(6000 + 50 * steps * np.clip(1.5 * np.sin(2 * np.pi * time_s / 4), -1, 1))
    current = np.round(30 * np.sign(np.cos(2 * np.pi * time_s / 4)) + rng.normal(0, 2, len(time_s)))
    fresh = (rng.random(len(time_s)) >= held) | (np.arange(len(time_s)) == 0)
    row = np.maximum.accumulate(np.where(fresh, np.arange(len(time_s)), 0))
    return {"time": time_s, "position": position[row], "current": current[row], "setpoint": position}, fresh


def log_of(columns: dict[str, np.ndarray]):
    return build_log(columns["time"], {k: v for k, v in columns.items() if k != "time"}, Path("log.csv"))


def test_rows_that_were_read_before_are_dropped() -> None:
    columns, fresh = recorded(0.4)
    log = without_repeats(log_of(columns))
    kept = np.isin(columns["time"], log.time_s)
    moving = np.minimum(*(np.abs(np.diff(columns["setpoint"], prepend=0, append=0))[k : k + 3000] for k in (0, 1))) > 6
    assert not kept[moving & ~fresh].any()
    assert kept[moving & fresh].all()
    assert np.mean(kept[~fresh]) < 0.1  # of what is the same for long some stays
    assert np.array_equal(log.column("current"), columns["current"][kept])
    assert "dropped" in log.notes[-1]
    assert without_repeats(log) is log


def test_a_long_rest_in_which_nothing_changes_is_no_gap() -> None:
    columns, _ = recorded(0.5)
    columns["current"] = np.where(np.abs(np.gradient(columns["setpoint"])) < 1, 0.0, columns["current"])
    log = without_repeats(log_of(columns))
    assert len(log.time_s) < len(columns["time"])
    assert np.diff(log.time_s).max() < 0.35


def test_a_coarse_encoder_with_one_odd_reading_keeps_its_rows() -> None:
    columns, _ = recorded(0.0, steps=20.0)
    position = np.round(columns["position"] / 16) * 16
    position[500] += 1
    log = log_of({**columns, "position": position})
    assert without_repeats(log) is log


def test_a_log_whose_rows_are_all_new_stays_as_it_is() -> None:
    log = log_of(recorded(0.0)[0])
    assert without_repeats(log) is log
    coarse = log_of(recorded(0.0, steps=0.5)[0])  # steps of the encoder as large as the travel between rows
    assert without_repeats(coarse) is coarse
