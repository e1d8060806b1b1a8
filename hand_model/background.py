"""The other cores: for independent calls where the platform can fork, elsewhere these simply run when their results are
asked for; not for threads within a matrix product."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Self

WORKERS = 2


@contextmanager
def single_threaded() -> Iterator[None]:
    """BLAS on one thread, here and in what is forked from here: matrices are small, and threads of two processes on two
    cores wait for each other. Also a decorator."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield


def _forks() -> bool:
    """Whether a process may be forked here: only while no other thread runs (spawning would import the caller's script
    again)."""
    return (
        "fork" in multiprocessing.get_all_start_methods()
        and threading.active_count() == 1
        and not multiprocessing.current_process().daemon
    )


class Background:
    """Calls of one function with several argument tuples, under way from construction on."""

    def __init__(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> None:
        self._function, self._arguments = function, tuple(arguments)
        self._pool: ProcessPoolExecutor | None = None
        self._futures: list[Future[Any]] = []
        if self._arguments and _forks():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                workers = min(WORKERS, len(self._arguments))
                self._pool = ProcessPoolExecutor(workers, multiprocessing.get_context("fork"), _leave_interrupts)
                self._futures = [self._pool.submit(function, *call) for call in self._arguments]

    def results(self) -> Iterator[Any]:
        """What the calls return, in order, each as soon as it is there; raises what a call raised."""
        if self._pool is None:
            yield from (self._function(*call) for call in self._arguments)
            return
        try:
            yield from (future.result() for future in self._futures)
        finally:
            # nobody wants what is under way, and its processes would outlive this one
            if not all(f.done() for f in self._futures):
                for process in list(self._pool._processes.values()):
                    process.terminate()
            self._pool.shutdown(cancel_futures=True)  # waited for: its thread would keep the next one from forking


class Pair:
    """This process and one forked from it, which hold the same `state` and each keep what they cache: for many short
    calls. Where nothing can be forked, this process alone. Also a context manager, which ends the other one."""

    def __init__(self, state: Any) -> None:
        self.state = state
        self._process: Any = None
        if _forks():
            fork = multiprocessing.get_context("fork")
            self._pipe, theirs = fork.Pipe()
            self._process = fork.Process(target=_serve, args=(theirs, self._pipe, state), daemon=True)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                self._process.start()
            theirs.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._process is not None:
            self._pipe.close()  # at which the other one ends
            if kind is not None and not issubclass(kind, Exception):
                self._process.kill()
            self._process.join()
            self._process = None

    def map(
        self, function: Callable[..., Any], items: Sequence[Any], *rest: Any, costs: Sequence[float] | None = None
    ) -> list[Any]:
        """`function(state, item, *rest)` of every item, some by the other process: the same places by the same process
        each time. costs:
        how long each may take, against each other. Raises what a call raised."""
        items = list(items)
        if self._process is None or len(items) < 2:
            return [function(self.state, item, *rest) for item in items]
        here, there = _shared_out(costs or [1.0] * len(items))
        self._pipe.send((function, [items[i] for i in there], rest))
        mine, error = [], None
        try:
            mine = [function(self.state, items[i], *rest) for i in here]
        # raised again, but only once the other one's answer is read: it would be taken for that of the next call
        except Exception as raised:  # noqa: BLE001
            error = raised
        try:
            theirs = self._pipe.recv()
        except EOFError:  # ended by the system, which may lack memory
            self._process = None
            theirs = [function(self.state, items[i], *rest) for i in there] if error is None else []
        if error is not None or isinstance(theirs, Exception):
            raise error or theirs
        done = dict(zip((*here, *there), (*mine, *theirs), strict=True))
        return [done[i] for i in range(len(items))]


def _shared_out(costs: Sequence[float]) -> tuple[list[int], list[int]]:
    """The places of two shares that cost alike: the dearest first, each to whom has less (Graham 1969)."""
    shares, sums = ([], []), [0.0, 0.0]
    for place in sorted(range(len(costs)), key=lambda i: -costs[i]):
        less = int(sums[1] < sums[0])
        shares[less].append(place)
        sums[less] += costs[place]
    return shares


def _leave_interrupts() -> None:
    """A terminal sends Ctrl-C to every process in it: the one that was called answers, and ends the others, which end
    what they began."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)


def _end(*_: object) -> None:
    """End this process at once, and those that it began: they would wait for it for good."""
    for process in multiprocessing.active_children():
        process.terminate()
    os._exit(1)


def _serve(pipe: Connection, inherited: Connection, state: Any) -> None:
    _leave_interrupts()
    inherited.close()  # held open here, it would never tell that the other side has ended
    while True:
        try:
            function, items, rest = pipe.recv()
        except (EOFError, ConnectionError):
            return
        try:
            pipe.send([function(state, item, *rest) for item in items])
        except BrokenPipeError:  # who asked has ended
            return
        except Exception as error:  # noqa: BLE001, raised where it was asked for
            pipe.send(error)
