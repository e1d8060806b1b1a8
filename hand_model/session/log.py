"""Actuator log of one trial: what the hand itself reports."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError, did_you_mean

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Log:
    """Columns of an actuator log on its own clock.

    time_s: (n,) [s], increasing, irregular. columns: name -> (n,), raw units as the session format states,
    nan where a sample was lost. path: the file.
    """

    time_s: Array
    columns: Mapping[str, Array]
    path: Path

    def column(self, name: str) -> Array:
        """One column (n,); raises SessionError naming the file and a near name where it is missing."""
        if name not in self.columns:
            raise SessionError(f'{self.path}: no column "{name}"; {did_you_mean(name, self.columns)}')
        return self.columns[name]


def read_log(path: Path) -> Log:
    """Read a CSV log, a rosbag2 folder or an MCAP file.

    Raises SessionError where it is missing, empty, has no `time` column, or holds a cell that is no number.
    """
    if not path.exists():
        raise SessionError(f"{path}: no such file")
    return _read_csv(path)


def _read_csv(path: Path) -> Log:
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))
    if len(rows) < 2:
        raise SessionError(f"{path}: the log is empty; a header and samples are needed")
    header = [name.strip() for name in rows[0]]
    try:
        table = np.array([[float(cell) if cell.strip() else np.nan for cell in row] for row in rows[1:] if row])
    except ValueError as error:
        raise SessionError(f"{path}: {error}") from None
    columns = {name: table[:, i] for i, name in enumerate(header)}
    if "time" not in columns:
        raise SessionError(f'{path}: no column "time"; {did_you_mean("time", columns)}')
    time_s = columns.pop("time")
    return Log(time_s, columns, path)
