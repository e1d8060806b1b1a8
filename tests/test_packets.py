"""Rows that arrive in packets: they are spread over the time in which they were read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.errors import SessionError
from hand_model.session.log import build_log
from hand_model.session.packets import spread_packets


def arrivals(rows: int, together: float, jitter: float = 0.0, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """When 300 rows were read [s], and the stamps that they have where packets of `rows` are stamped on arrival."""
    step = 0.018 * (1 + jitter * np.random.default_rng(seed).uniform(-1, 1, 300))
    read = 5.0 + np.cumsum(step)
    last = np.minimum((np.arange(300) // rows + 1) * rows - 1, 299)
    return read, read[last] + together * (np.arange(300) % rows)


@pytest.mark.parametrize("rows", [2, 3, 5])
@pytest.mark.parametrize("together", [0.0, 2e-4])
def test_rows_of_a_packet_get_times_of_their_own(rows: int, together: float) -> None:
    read, stamped = arrivals(rows, together)
    found, told = spread_packets(stamped)
    np.testing.assert_allclose(found, read, atol=rows * together + 1e-9)
    assert told == pytest.approx(rows, abs=0.05)


def test_a_pause_before_a_packet_is_not_spread_over_it() -> None:
    read, stamped = arrivals(3, 0.0)
    read[150:] += 2.0
    stamped[150:] += 2.0
    np.testing.assert_allclose(spread_packets(stamped)[0], read, atol=0.01)


@pytest.mark.parametrize("jitter", [0.0, 0.35, 0.8])
def test_uneven_rows_are_no_packets(jitter: float) -> None:
    assert spread_packets(arrivals(1, 0.0, jitter)[0]) is None
    assert spread_packets(np.zeros(5)) is None and spread_packets(np.array([1.0, 2.0])) is None


def test_a_log_whose_packets_share_a_stamp_is_read_and_says_so() -> None:
    read, stamped = arrivals(3, 0.0)
    log = build_log(stamped, {"position": np.arange(300.0)}, Path("log.csv"))
    np.testing.assert_allclose(log.time_s, read, atol=1e-9)
    assert len(log.column("position")) == 300 and "packets of 3" in log.notes[0] and log.packet == pytest.approx(3)


def test_rows_that_were_written_twice_are_no_packets() -> None:
    read = arrivals(1, 0.0)[0]
    with pytest.raises(SessionError, match="repeat the time"):
        build_log(np.repeat(read, 2), {"position": np.repeat(np.arange(300.0), 2)}, Path("log.csv"))
