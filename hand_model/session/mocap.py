"""Marker trajectories of one trial, whatever file they came in."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
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
    notes: what was done to the labels, one sentence each. The arrays are read-only: readings are shared.
    """

    labels: tuple[str, ...]
    time_s: Array
    position_world: Array
    rate_hz: float
    path: Path
    notes: tuple[str, ...] = ()

    def markers(self, labels: Iterable[str]) -> Array:
        """Trajectories (n, k, 3) [m] of the named markers, in that order.

        Raises SessionError naming the file and a near label where one is missing or stands for two trajectories.
        """
        return self.position_world[:, [self._index(label) for label in labels]]

    def _index(self, label: str) -> int:
        # A manifest may carry the subject prefix that the reader took off the file's labels.
        for name in (label, label.rpartition(":")[2]):
            count = self.labels.count(name)
            if count > 1:
                raise SessionError(
                    f'{self.path}: {count} trajectories are labelled "{name}" at the same time; '
                    "each label once is needed"
                )
            if count == 1:
                return self.labels.index(name)
        raise SessionError(f'{self.path}: no marker "{label}"; {did_you_mean(label, filter(is_named, self.labels))}')


def is_named(label: str) -> bool:
    """Whether somebody named this trajectory; motion captures number what they cannot name (`*12`, `U 001`)."""
    word = label.strip().lower()
    numbered = word.startswith("u ") and word[2:].strip().isdigit()
    return bool(word) and not numbered and not word.startswith(("*", "unlabel", "unnamed", "uname*"))


def build_mocap(labels: Sequence[str], time_s: Array, position_world: Array, rate_hz: float, path: Path) -> Mocap:
    """Marker trajectories as every reader hands them over: gaps made nan, labels made plain.

    labels: m labels as the file has them. position_world: (n, m, 3) [m]; a triple of exact zeros or with a non-finite
    number is a gap. A subject prefix (`subject:label`) is dropped where the labels stay unique without it; pieces of
    one label that do not overlap are joined. Raises SessionError where no frame or no named marker is left.
    """
    if not len(position_world):
        raise SessionError(f"{path}: the file holds no frame; marker trajectories are needed")
    position = np.array(position_world, dtype=float)
    gap = ~np.isfinite(position).all(axis=2) | (position == 0.0).all(axis=2)
    position[gap] = np.nan
    named = [i for i, label in enumerate(labels) if is_named(label)]
    if not named:
        raise SessionError(f"{path}: the file holds no named marker; labelled trajectories are needed")
    plain, notes = _without_prefix([label.strip() for label in labels])
    plain, position, joined = _join_pieces(plain, position)
    position.setflags(write=False)
    time_s = np.array(time_s, dtype=float)
    time_s.setflags(write=False)
    return Mocap(tuple(plain), time_s, position, float(rate_hz), path, tuple(notes + joined))


def _without_prefix(labels: list[str]) -> tuple[list[str], list[str]]:
    short = [label.rpartition(":")[2].strip() if is_named(label) else label for label in labels]
    count, before = Counter(short), Counter(labels)
    plain = [s if s and count[s] == before[label] else label for label, s in zip(labels, short, strict=True)]
    prefixes = sorted({label.rpartition(":")[0] for label, p in zip(labels, plain, strict=True) if p != label})
    return plain, [f'the prefix "{prefix}:" of the marker labels was dropped' for prefix in prefixes]


def _join_pieces(labels: list[str], position: Array) -> tuple[list[str], Array, list[str]]:
    """Join trajectories of one label: the longest wins, the others fill its gaps; those that overlap stay apart."""
    seen = ~np.isnan(position[:, :, 0])
    drop: set[int] = set()
    notes = []
    for label in [label for label, count in Counter(labels).items() if count > 1 and is_named(label)]:
        pieces = sorted((i for i, name in enumerate(labels) if name == label), key=lambda i: -int(seen[:, i].sum()))
        first = pieces[0]
        for other in pieces[1:]:
            both = int((seen[:, first] & seen[:, other]).sum())
            if both > 0.1 * seen[:, other].sum():  # two points at once: nobody can say which one is the marker
                continue
            fill = ~seen[:, first] & seen[:, other]
            position[fill, first] = position[fill, other]
            seen[fill, first] = True
            drop.add(other)
            notes.append(f'two pieces labelled "{label}" were joined')
    keep = [i for i in range(len(labels)) if i not in drop]
    return [labels[i] for i in keep], (position[:, keep] if drop else position), notes


def frame_times(time_s: Array | None, frames: int, rate_hz: float, path: Path) -> Array:
    """Times (n,) [s] of the frames: the file's time column, or its rate where the column only repeats it, rounded.

    Raises SessionError where the time column does not increase.
    """
    regular = np.arange(frames) / rate_hz
    if time_s is None or not np.isfinite(time_s).all():
        return regular
    regular = regular + time_s[0]
    if np.abs(time_s - regular).max() <= max(0.05 / rate_hz, 0.6e-3):  # 0.6e-3: a column printed with three decimals
        return regular
    if not (np.diff(time_s) > 0).all():
        frame = int(np.argmax(np.diff(time_s) <= 0)) + 1
        raise SessionError(
            f"{path}: the time column does not increase at frame {frame + 1}; increasing times are needed"
        )
    return time_s


def read_mocap(path: Path) -> Mocap:
    """Read a C3D, QTM TSV, TRC or Motive CSV file, chosen by its ending; lengths converted to metres.

    A second call on an unchanged file returns the same object. Raises SessionError where the file is missing,
    truncated, foreign, empty or in an unknown unit.
    """
    path = Path(path)
    if path.suffix.lower() not in READERS:
        raise SessionError(f'{path}: cannot read "{path.suffix}" marker files; valid: {", ".join(READERS)}')
    if not path.is_file():
        raise SessionError(f"{path}: no such file")
    status = path.stat()
    return _read_cached(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=128)
def _read_cached(path: Path, mtime_ns: int, size: int) -> Mocap:
    return READERS[path.suffix.lower()]()(path)


def _c3d() -> Callable[[Path], Mocap]:
    from .c3d import read_c3d

    return read_c3d


def _tsv() -> Callable[[Path], Mocap]:
    from .qtm_tsv import read_qtm_tsv

    return read_qtm_tsv


def _trc() -> Callable[[Path], Mocap]:
    from .trc import read_trc

    return read_trc


def _csv() -> Callable[[Path], Mocap]:
    from .motive_csv import read_motive_csv

    return read_motive_csv


# Readers import this module, so they are imported when first needed.
READERS: dict[str, Callable[[], Callable[[Path], Mocap]]] = {".c3d": _c3d, ".tsv": _tsv, ".trc": _trc, ".csv": _csv}
