"""The other cores."""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_model.background import Background, Pair, _shared_out, single_threaded

threadpoolctl = pytest.importorskip("threadpoolctl")


def _threads(size: int) -> list[int]:
    np.ones((size, size)) @ np.ones((size, size))
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]


def test_blas_has_one_thread_within_and_in_what_is_forked_and_as_many_as_before_after():
    with threadpoolctl.threadpool_limits(2, "blas"):
        before = _threads(4)
        with single_threaded():
            assert set(_threads(4)) == {1}
            assert all(set(found) == {1} for found in Background(_threads, [(4,), (8,)]).results())
        assert _threads(4) == before


def test_what_costs_most_is_shared_out_first_and_always_alike():
    assert _shared_out([1.0, 5.0, 3.0, 1.0, 0.0]) == ([1, 4], [2, 0, 3])
    assert _shared_out([1.0, 1.0, 1.0]) == ([0, 2], [1])


def _seen(state: dict[str, int], item: int, factor: int) -> tuple[int, int]:
    if item < 0:
        raise ValueError(item)
    state["calls"] += 1
    return factor * item, state["calls"]


@pytest.mark.parametrize("forks", [True, False])
def test_two_processes_share_a_list_in_order_and_each_keeps_its_state(forks, monkeypatch):
    if not forks:
        monkeypatch.setattr("hand_model.background._forks", lambda: False)
    with Pair({"calls": 0}) as pair:
        assert [v for v, _ in pair.map(_seen, range(5), 10)] == [0, 10, 20, 30, 40]
        count = [n for _, n in pair.map(_seen, range(4), 1)]
        assert count == ([4, 3, 5, 4] if forks else [6, 7, 8, 9])
        assert [v for v, _ in pair.map(_seen, range(4), 1, costs=[1.0, 1.0, 9.0, 1.0])] == [0, 1, 2, 3]
        for items in ([1, -2, 3], [-1, 2, 3]):
            with pytest.raises(ValueError, match="-"):
                pair.map(_seen, items, 1)
        assert [v for v, _ in pair.map(_seen, [7, 8], 1)] == [7, 8]  # no answer of a failed call is left in the way


def _paired(size: int) -> list[tuple[int, int]]:
    with Pair({"calls": 0}) as outer, Pair({"calls": 0}) as inner:
        return outer.map(_seen, range(size), 1) + inner.map(_seen, range(size), 1)


def test_pairs_end_within_each_other_and_within_a_pool():
    assert all([v for v, _ in found] == [0, 1, 2, 0, 1, 2] for found in Background(_paired, [(3,), (3,)]).results())


def _ended(state: Any, item: int) -> int:
    if item == 2 and multiprocessing.parent_process() is not None:
        os._exit(1)
    return item


def test_a_pair_whose_other_process_is_ended_goes_on_alone():
    with Pair(None) as pair:
        assert pair.map(_ended, [1, 2, 3]) == [1, 2, 3]
        assert pair.map(_ended, [4, 2]) == [4, 2]


def _nested(seconds: float) -> float:
    """Sleeps in a process of a process where it is long."""
    if seconds:
        list(Background(time.sleep, [(seconds,)]).results())
    return seconds


def test_calls_under_way_end_with_the_one_who_asked():
    begin = time.perf_counter()
    calls = Background(_nested, [(0.0,), (60.0,)])
    results = calls.results()
    assert next(results) == 0.0
    time.sleep(0.5)  # the other one has begun
    inner = _children(next(p.pid for p in multiprocessing.active_children()))
    results.close()  # as an interrupt does
    assert time.perf_counter() - begin < 30
    assert not multiprocessing.active_children()
    while any(_runs(pid) for pid in inner) and time.perf_counter() - begin < 30:  # told to end, it takes a moment
        time.sleep(0.02)
    assert not [pid for pid in inner if _runs(pid)]


def _children(pid: int) -> list[int]:
    try:
        return [int(x) for x in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:  # no such file on this system
        return []


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False
