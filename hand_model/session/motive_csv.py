"""OptiTrack Motive's CSV export, format versions 1.2x.

Line 1 holds `Format Version` and further key, value pairs (`Export Frame Rate`, `Length Units`); then rows Type, Name,
ID (Parent), the quantity (Rotation, Position, ...), and the axis letters after `Frame, Time (Seconds)`. Only columns of
type `Marker` are measured markers: rigid bodies, bones and `Rigid Body Marker` columns are Motive's own fits and are
ignored.
"""

from __future__ import annotations

import csv
from pathlib import Path

from ..errors import SessionError
from .mocap import Mocap, build_mocap, frame_times
from .text import header_number, number_table, read_lines
from .units import metres_per


def read_motive_csv(path: Path) -> Mocap:
    """Read a Motive CSV file; labels keep their name, without the asset's prefix where they stay unique.

    Raises SessionError where the header is foreign, no measured marker is exported, a line has the wrong width, or
    there are fewer frames than stated.
    """
    lines = read_lines(path)
    top = next(csv.reader([lines[0]]), [])
    if not top or top[0].strip() != "Format Version":
        raise SessionError(f'{path}: not a Motive CSV file; its first line must start with "Format Version"')
    fields = {key.strip(): value.strip() for key, value in zip(top[::2], top[1::2], strict=False)}
    rate = "Export Frame Rate" if "Export Frame Rate" in fields else "Capture Frame Rate"
    rate_hz = header_number(fields.get(rate), rate, path)
    scale = metres_per(fields.get("Length Units"), path, "Length Units")
    header, start = _header(lines, path)
    labels, picked = _marker_columns(header, path)
    width = len(header[-1])
    numbers = [i for i in range(start, len(lines)) if lines[i].strip()]
    rows = []
    for i in numbers:
        row = lines[i].split(",")
        if len(row) != width and (any(row[width:]) or len(row) < width):
            raise SessionError(
                f"{path}: line {i + 1} has {len(row)} cells; {width} are needed (the file may be truncated)"
            )
        rows.append([row[j] for j in picked])
    frames = fields.get("Total Exported Frames")
    if frames and len(rows) < header_number(frames, "Total Exported Frames", path):
        raise SessionError(f"{path}: truncated file, it holds {len(rows)} of {frames} frames; export it anew")
    table = number_table(rows, [i + 1 for i in numbers], path).reshape(len(rows), len(picked))
    position = table[:, 1:].reshape(len(rows), len(labels), 3) * scale
    return build_mocap(labels, frame_times(table[:, 0], len(rows), rate_hz, path), position, rate_hz, path)


def _header(lines: list[str], path: Path) -> tuple[list[list[str]], int]:
    """The header rows, all as wide as the last one (Frame, Time, axes), and the index of the first frame's line."""
    header: list[list[str]] = []
    for i, line in enumerate(lines[1:20], start=1):
        row = [cell.strip() for cell in next(csv.reader([line]), [])]
        if not any(row):
            continue
        header.append(row)
        if row[0] == "Frame":
            width = len(row)
            return [(cells + [""] * width)[:width] for cells in header], i + 1
    raise SessionError(f'{path}: no header row that starts with "Frame"; a Motive CSV export is needed')


def _marker_columns(header: list[list[str]], path: Path) -> tuple[list[str], list[int]]:
    """Labels of the measured markers; columns to read: the time, then X, Y, Z of each."""
    kinds = next((row for row in header if "Marker" in row[2:]), None)
    if kinds is None or len(header) < 3:
        raise SessionError(f"{path}: no column of type Marker; export the marker positions, not only rigid bodies")
    names, axes = header[header.index(kinds) + 1], header[-1]
    quantities = header[-2]
    labels: list[str] = []
    picked = [1]
    wanted = [j for j, kind in enumerate(kinds) if kind == "Marker" and quantities[j] == "Position"]
    for x, y, z in zip(wanted[::3], wanted[1::3], wanted[2::3], strict=False):
        if [axes[x], axes[y], axes[z]] != ["X", "Y", "Z"] or not names[x] == names[y] == names[z]:
            raise SessionError(
                f'{path}: the columns of marker "{names[x]}" are not X, Y, Z side by side; export it anew'
            )
        labels.append(names[x])
        picked += [x, y, z]
    if not labels or len(wanted) % 3:
        raise SessionError(f"{path}: the marker columns are not complete triples of X, Y, Z; export it anew")
    return labels, picked
