"""OpenSim's TRC: five header lines (path, field names, field values, labels, X1 Y1 Z1 ...), then one line per frame.

`Units` states the length unit; a gap is an empty cell, `NaN`, or a triple of exact zeros.
"""

from __future__ import annotations

from pathlib import Path

from ..errors import SessionError
from .mocap import Mocap, build_mocap, frame_times
from .text import header_number, number_table, read_lines
from .units import metres_per


def read_trc(path: Path) -> Mocap:
    """Read a TRC file.

    Raises SessionError where the header is foreign, a line has the wrong width, or there are fewer frames than stated.
    """
    lines = read_lines(path)
    if len(lines) < 5 or not lines[0].startswith("PathFileType"):
        raise SessionError(f'{path}: not a TRC file; its first line must start with "PathFileType"')
    separator = "\t" if "\t" in lines[3] else None
    names, values = lines[1].split(), lines[2].split()
    fields = dict(zip(names, values, strict=False))
    rate_hz = header_number(fields.get("DataRate"), "DataRate", path)
    scale = metres_per(fields.get("Units"), path, "Units")
    labels = [cell.strip() for cell in lines[3].split(separator)[2:] if cell.strip()]
    if fields.get("NumMarkers", str(len(labels))) != str(len(labels)):
        raise SessionError(
            f"{path}: NumMarkers is {fields['NumMarkers']} and line 4 has {len(labels)} labels; both must agree"
        )
    width = 2 + 3 * len(labels)
    numbers = [i for i in range(5, len(lines)) if lines[i].strip()]
    rows = [_padded(lines[i].split(separator), width, path, i + 1) for i in numbers]
    frames = fields.get("NumFrames")
    if frames and len(rows) < header_number(frames, "NumFrames", path):
        raise SessionError(f"{path}: truncated file, it holds {len(rows)} of {frames} frames; export it anew")
    table = number_table(rows, [i + 1 for i in numbers], path).reshape(len(rows), width)
    position = table[:, 2:].reshape(len(rows), len(labels), 3) * scale
    return build_mocap(labels, frame_times(table[:, 1], len(rows), rate_hz, path), position, rate_hz, path)


def _padded(row: list[str], width: int, path: Path, line: int) -> list[str]:
    """A line of exactly `width` cells: writers add an empty cell, or trim the empty ones of a gap at the end."""
    while len(row) > width and not row[-1].strip():
        row.pop()
    while 2 < len(row) < width and not row[-1].strip():
        row.pop()
    if len(row) > width or len(row) < 2 or (width - len(row)) % 3:
        raise SessionError(f"{path}: line {line} has {len(row)} cells; {width} are needed (the file may be truncated)")
    return row + [""] * (width - len(row))
