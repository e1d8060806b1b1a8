"""Rows of a log that was written faster than its hand was read: they repeat what was read before them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .log import Log

AROUND = 3  # rows on either side by which a row's travel is told
FAST = 5.0  # steps of the encoder from row to row, from which no position is read twice by chance
FEWEST = 30  # rows so fast
OFTEN = 0.05  # share of them that repeat a position, from which a log is such a one


@lru_cache(maxsize=128)
def without_repeats(log: Log) -> Log:
    """The log of one drive without the rows that repeat what was read before them, with a note; itself where it has
    none. A second call returns the same object.

    While a drive travels several steps of its encoder from row to row, a position repeats for no other reason, and is
    wrong at its time. Once that is plain, so are rows anywhere in which neither position nor current is new.
    """
    repeated = _repeated(log)
    if not repeated.any():
        return log
    note = f"{int(repeated.sum())} rows that repeat what was read before them were dropped"
    columns = {name: column[~repeated] for name, column in log.columns.items()}
    for array in columns.values():
        array.setflags(write=False)
    time_s = log.time_s[~repeated]
    time_s.setflags(write=False)
    return replace(log, time_s=time_s, columns=columns, notes=(*log.notes, note))


def _repeated(log: Log) -> NDArray[np.bool_]:
    """Rows (n,) that repeat; none of a log in which few do."""
    none = np.zeros(len(log.time_s), bool)
    position = log.columns.get("position")
    if position is None or len(position) <= 2 * AROUND:
        return none
    steps = np.diff(np.unique(position[np.isfinite(position)]))
    if not len(steps):
        return none
    fast = none.copy()
    travel = np.abs(position[AROUND:] - position[:-AROUND]) / AROUND > FAST * steps.min()
    fast[AROUND:-AROUND] = travel[AROUND:] & travel[:-AROUND]  # before and after: else it comes to rest
    same = np.r_[False, np.diff(position) == 0]
    if fast.sum() < FEWEST or same[fast].mean() < OFTEN:
        return none
    return same & (fast | np.r_[False, np.diff(log.columns.get("current", position)) == 0])
