"""A second core for one call, where the platform can fork; elsewhere the call simply runs when its result is asked for."""

from __future__ import annotations

import multiprocessing
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any


class Background:
    """One call under way: `result()` waits for it and returns what it returned, or raises what it raised."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._call = (function, arguments)
        self._pool: ProcessPoolExecutor | None = None
        # Forking is only safe while no other thread runs; spawning would import the caller's script again.
        if "fork" in multiprocessing.get_all_start_methods() and threading.active_count() == 1:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                self._pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork"))
                self._future = self._pool.submit(function, *arguments)

    def result(self) -> Any:
        """The call's result."""
        if self._pool is None:
            function, arguments = self._call
            return function(*arguments)
        try:
            return self._future.result()
        finally:
            self._pool.shutdown(wait=False, cancel_futures=True)
