"""Rows of a log that was written faster than its hand was read: they repeat what was read before them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .log import Log, resolution

FAST = 5.0  # steps of the encoder from row to row, from which no position is read twice by chance
SLOWED = 0.5  # of the speed before: slower, and a drive comes to rest
FEWEST = 30  # rows so fast, before and after
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
    position = log.columns.get("position", np.zeros(0))
    none = np.zeros(len(log.time_s), bool)
    step = resolution(position)
    new = np.r_[True, np.diff(position) != 0][: len(position)]
    first = np.flatnonzero(new)
    if step == 0 or len(first) < 3:
        return none
    rows = np.diff(first)  # that hold a position
    speed = np.abs(np.diff(position[first])) / rows  # until the next
    # before and after, and without coming to rest meanwhile
    fast = np.r_[False, (speed[:-1] > FAST * step) & (speed[1:] > np.maximum(FAST * step, SLOWED * speed[:-1]))]
    held = int((rows - 1)[fast].sum())
    if rows[fast].sum() < FEWEST or held < OFTEN * rows[fast].sum():
        return none
    row = np.arange(len(position))
    since_new = row - np.maximum.accumulate(np.where(new, row, 0))
    # at rest readings may be the same for long: one stays of more than repeat in motion
    longest = 2 * int(np.percentile((rows - 1)[fast & (rows > 1)], 98))
    in_motion = np.repeat(np.r_[fast & (rows - 1 <= longest), False], np.diff(np.r_[first, len(position)]))
    same = since_new > 0
    if "current" in log.columns:
        same &= in_motion | np.r_[False, np.diff(log.columns["current"]) == 0]
    return same & (since_new % (longest + 1) > 0)
