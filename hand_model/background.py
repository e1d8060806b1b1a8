"""The other cores: for independent calls where the platform can fork, elsewhere these simply run when their results are asked
for; not for threads within a matrix product."""

from __future__ import annotations

import multiprocessing
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

WORKERS = 2


@contextmanager
def single_threaded() -> Iterator[None]:
    """BLAS on one thread, here and in what is forked from here: matrices are small, and threads of two processes on two cores
    wait for each other. Also a decorator."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield


class Background:
    """Calls of one function with several argument tuples, under way from construction on."""

    def __init__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> None:
        self._function, self._arguments = function, tuple(arguments)
        self._pool: ProcessPoolExecutor | None = None
        self._futures: list[Future[Any]] = []
        # Forking is only safe while no other thread runs; spawning would import the caller's script again.
        if self._arguments and "fork" in multiprocessing.get_all_start_methods() and threading.active_count() == 1:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                workers = min(WORKERS, len(self._arguments))
                self._pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("fork"))
                self._futures = [self._pool.submit(function, *call) for call in self._arguments]

    def results(self) -> Iterator[Any]:
        """What the calls return, in order, each as soon as it is there; raises what a call raised."""
        if self._pool is None:
            yield from (self._function(*call) for call in self._arguments)
            return
        try:
            yield from (future.result() for future in self._futures)
        finally:  # a pool that has done its work is waited for: its thread would keep the next one from forking
            self._pool.shutdown(wait=all(f.done() for f in self._futures), cancel_futures=True)
