"""Actuator log of one trial: what the hand itself reports."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError, did_you_mean
from .packets import spread_packets

Array = NDArray[np.float64]

# Columns that the session format names; a log may hold more.
COLUMNS = ("time", "position", "current", "setpoint", "speed", "current_limit", "temperature")
# A recorder hiccups now and then. A log in which more than this share of the rows is out of order, or repeats a time,
# is not one recording.
TOLERATED_SHARE = 0.1
LOST = 3.0  # usual intervals between two rows, beyond which rows were lost


@dataclass(frozen=True, eq=False)
class Log:
    """Columns of an actuator log on its own clock.

    time_s: (n,) [s], increasing, irregular. columns: name -> (n,), raw units as the session format states,
    nan where a sample was lost. path: the file. notes: what was mended, one sentence each. packet: rows that came at
    once, on average; more than one, and their times are no more than spread evenly. stamps_wrong_s: standard deviation
    [s] by which times that were evened may be wrong still.
    The arrays are read-only: readings are shared. A log is equal to itself alone, so that what is made of it can be
    kept.
    """

    time_s: Array
    columns: Mapping[str, Array]
    path: Path
    notes: tuple[str, ...] = ()
    packet: float = 1.0
    stamps_wrong_s: float = 0.0

    @property
    def uneven(self) -> bool:
        """Whether times are known less well than they are told."""
        return self.packet > 1 or self.stamps_wrong_s > 0

    def column(self, name: str) -> Array:
        """One column (n,); raises SessionError naming the file and a near name where it is missing."""
        if name not in self.columns:
            raise SessionError(f'{self.path}: no column "{name}"; {did_you_mean(name, self.columns)}')
        return self.columns[name]


def build_log(time_s: Array, columns: Mapping[str, Array], path: Path, notes: Iterable[str] = ()) -> Log:
    """A log as every reader hands it over: rows in the order of their times, each time once.

    time_s: (n,) [s], as recorded. notes: what the reader has to say. Rows without a time, or that repeat one, are
    dropped and rows out of order sorted, with a note, as long as they are few; rows stamped in packets get times of their
    own. Raises SessionError where they are many,
    or where fewer than two rows are left.
    """
    total = len(time_s)
    notes = list(notes)
    keep = np.flatnonzero(np.isfinite(time_s))
    _tolerate(total - len(keep), total, "have no time", path)
    if len(keep) < total:
        notes.append(f"{total - len(keep)} rows without a time were dropped")
    back = int((np.diff(time_s[keep]) < 0).sum()) if len(keep) else 0
    _tolerate(back, total, "go back in time", path)
    if back:
        keep = keep[np.argsort(time_s[keep], kind="stable")]
        notes.append(f"rows were sorted by time: it went back {back} times")
    packet = 1.0
    packets = None if _copied(time_s[keep], columns, keep) else spread_packets(time_s[keep])
    if packets is not None:
        time_s = time_s.copy()
        time_s[keep], packet = packets
        notes.append(f"rows came in packets of {packet:.2g}: they were spread evenly between the packets' times")
    fresh = np.ones(len(keep), bool)
    fresh[1:] = np.diff(time_s[keep]) > 0
    repeated = int((~fresh).sum())
    _tolerate(repeated, total, "repeat the time of the row before", path)
    if repeated:
        keep = keep[fresh]
        notes.append(f"{repeated} rows that repeated a time were dropped")
    if len(keep) < 2:
        raise SessionError(f"{path}: the log holds {len(keep)} samples; two or more at increasing times are needed")
    picked = {name: np.ascontiguousarray(column[keep]) for name, column in columns.items()}
    times = time_s[keep]
    for array in (times, *picked.values()):
        array.setflags(write=False)
    return Log(times, picked, path, tuple(notes), packet)


def resolution(values: Array) -> float:
    """Step between two readings (n,) of a channel that differ by least, but for a few; 0 where none differ: one for
    whole counts."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return float(np.percentile(steps, 5)) if len(steps) else 0.0


def rows_lost(time_s: Array) -> NDArray[np.bool_]:
    """Whether rows were lost between one and the next (n - 1,), by how far apart rows (n,) [s] are. Those that come in
    packets leave many far apart, so that is usual there."""
    interval = np.diff(time_s)
    if not len(interval):
        return np.zeros(0, bool)
    return interval > LOST * float(np.percentile(interval, 90))


def between_rows(time_s: Array, then: Array) -> NDArray[np.bool_]:
    """Times (m,) [s] within a log of rows at (n,), two or more, where none are lost: what the drive does there nobody
    knows."""
    return (then >= time_s[0]) & (then <= time_s[-1]) & ~rows_lost(time_s)[row_before(time_s, then)]


def row_before(time_s: Array, then: Array) -> NDArray[np.intp]:
    """Row (m,) after which times (m,) come, of rows at (n,), two or more; there is always one after it, too."""
    return (np.searchsorted(time_s, then, side="right") - 1).clip(0, len(time_s) - 2)


def _copied(time_s: Array, columns: Mapping[str, Array], keep: NDArray[np.intp]) -> bool:
    """Whether more rows than are tolerated say nothing but what the row before them said, at the same time."""
    same = np.diff(time_s) == 0
    for column in columns.values():
        before, after = column[keep][:-1], column[keep][1:]
        same = same & ((before == after) | (np.isnan(before) & np.isnan(after)))
    return bool(same.sum() > TOLERATED_SHARE * len(keep))


def _tolerate(rows: int, total: int, what: str, path: Path) -> None:
    if rows > max(TOLERATED_SHARE * total, 1):
        raise SessionError(f"{path}: {rows} of {total} rows {what}; `time` must increase from row to row")


def read_log(path: Path, actuator: str | None = None) -> Log:
    """Read a CSV log, a rosbag2 folder or an MCAP file.

    actuator: whose channel to take from a bag that holds several; a CSV log holds one. A second call on an unchanged
    log returns the same object. Raises SessionError where the log is missing, empty, has no `time` column, or holds a
    cell that is no number.
    """
    path = Path(path)
    if not path.exists():
        raise SessionError(f"{path}: no such file")
    is_bag = path.is_dir() or path.suffix.lower() == ".mcap"
    if not is_bag and path.suffix.lower() != ".csv":
        raise SessionError(f'{path}: cannot read "{path.suffix}" logs; valid: .csv, .mcap, a rosbag2 folder')
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    state = tuple((file.name, file.stat().st_mtime_ns, file.stat().st_size) for file in files if file.is_file())
    return _read_cached(path, actuator if is_bag else None, is_bag, state)


@lru_cache(maxsize=128)
def _read_cached(path: Path, actuator: str | None, is_bag: bool, state: tuple[tuple[str, int, int], ...]) -> Log:
    # The readers import this module, so they are imported when first needed (rosbags is heavy besides).
    if is_bag:
        from .bag import read_bag

        return read_bag(path, actuator)
    from .csv_log import read_csv_log

    return read_csv_log(path)
