"""Qualisys Track Manager's TSV export: `KEY<tab>value` lines, optionally a column header, then one line per frame.

Lengths are in millimetres (the file states no unit). Frame and Time columns may be there or not. A gap is an empty
cell, `NaN`, or a triple of exact zeros, by the exporting laboratory's settings.
"""

from __future__ import annotations

from pathlib import Path

from ..errors import SessionError
from .mocap import Mocap, build_mocap, frame_times
from .text import header_number, number_table, read_lines
from .units import metres_per


def read_qtm_tsv(path: Path) -> Mocap:
    """Read a QTM TSV file.

    Raises SessionError where it has no MARKER_NAMES or FREQUENCY, a line of the wrong width, or fewer frames than
    stated.
    """
    lines = read_lines(path)
    header, columns, start = _header(lines)
    if "MARKER_NAMES" not in header:
        raise SessionError(f"{path}: no MARKER_NAMES line; a QTM TSV export with its header is needed")
    included = (header.get("DATA_INCLUDED") or ["3D"])[0].strip()
    if included and included != "3D":
        raise SessionError(f'{path}: DATA_INCLUDED is "{included}"; an export of 3D marker positions is needed')
    labels = [label.strip() for label in header["MARKER_NAMES"]]
    while labels and not labels[-1]:
        labels.pop()
    stated = header.get("NO_OF_MARKERS")
    if stated and stated[0].strip() != str(len(labels)):
        raise SessionError(
            f"{path}: NO_OF_MARKERS is {stated[0]} and MARKER_NAMES has {len(labels)} names; both must agree"
        )
    rate_hz = header_number((header.get("FREQUENCY") or [None])[0], "FREQUENCY", path)
    numbers = [i for i in range(start, len(lines)) if lines[i].strip(" ")]
    rows = [lines[i].split("\t") for i in numbers]
    lead = _leading_columns(columns, rows, len(labels))
    width = lead + 3 * len(labels)
    rows = [_exact(row, width, path, i + 1) for row, i in zip(rows, numbers, strict=True)]
    frames = header.get("NO_OF_FRAMES")
    if frames and len(rows) < header_number(frames[0], "NO_OF_FRAMES", path):
        raise SessionError(
            f"{path}: truncated file, it holds {len(rows)} of {frames[0].strip()} frames; export it anew"
        )
    table = number_table(rows, [i + 1 for i in numbers], path).reshape(len(rows), width)
    position = table[:, lead:].reshape(len(rows), len(labels), 3) * metres_per(None, path, "unit")
    time_s = frame_times(table[:, 1] if lead == 2 else None, len(rows), rate_hz, path)
    return build_mocap(labels, time_s, position, rate_hz, path)


def _header(lines: list[str]) -> tuple[dict[str, list[str]], list[str] | None, int]:
    """Fields by key, the cells of the column header where there is one, and the index of the first frame's line."""
    fields: dict[str, list[str]] = {}
    for i, line in enumerate(lines):
        key, *values = line.split("\t")
        word = key.strip()
        if word.endswith(" X") or word in ("Frame", "Time"):
            return fields, [key, *values], i + 1
        if not word[:1].isalpha() or word.lower() == "nan":
            return fields, None, i
        fields[word] = values
    return fields, None, len(lines)


def _leading_columns(columns: list[str] | None, rows: list[list[str]], markers: int) -> int:
    """Number of columns before the first marker: 0, or 2 for Frame and Time."""
    if columns is not None:
        return sum(cell.strip() in ("Frame", "Time") for cell in columns[:2])
    return 2 if rows and max(len(row) for row in rows) >= 3 * markers + 2 else 0


def _exact(row: list[str], width: int, path: Path, line: int) -> list[str]:
    while len(row) > width and not row[-1].strip():
        row.pop()
    if len(row) != width:
        raise SessionError(f"{path}: line {line} has {len(row)} cells; {width} are needed (the file may be truncated)")
    return row
