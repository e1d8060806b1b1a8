"""The other cores."""

from __future__ import annotations

import numpy as np
import pytest

from hand_model.background import Background, single_threaded

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
