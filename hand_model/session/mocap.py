"""Marker trajectories of one trial, whatever file they came in."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError, did_you_mean

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mocap:
    """Marker trajectories in the world frame of the motion capture.

    labels: m marker labels. time_s: (n,) [s], from the file's rate or its time column.
    position_world: (n, m, 3) [m], nan where a marker was not seen. rate_hz: nominal frame rate [Hz]. path: the file.
    """

    labels: tuple[str, ...]
    time_s: Array
    position_world: Array
    rate_hz: float
    path: Path

    def markers(self, labels: Iterable[str]) -> Array:
        """Trajectories (n, k, 3) [m] of the named markers, in that order.

        Raises SessionError naming the file and a near label where one is missing.
        """
        index = {label: i for i, label in enumerate(self.labels)}
        columns = []
        for label in labels:
            if label not in index:
                raise SessionError(f'{self.path}: no marker "{label}"; {did_you_mean(label, self.labels)}')
            columns.append(index[label])
        return self.position_world[:, columns]


def read_mocap(path: Path) -> Mocap:
    """Read a C3D, QTM TSV, TRC or Motive CSV file, chosen by its ending; lengths converted to metres.

    Raises SessionError where the file is missing, truncated, foreign, empty or in an unknown unit.
    """
    readers: dict[str, Callable[[Path], Mocap]] = {}
    from .c3d import read_c3d

    readers[".c3d"] = read_c3d
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise SessionError(f'{path}: cannot read "{path.suffix}" marker files; valid: {", ".join(readers)}')
    if not path.is_file():
        raise SessionError(f"{path}: no such file")
    return reader(path)
