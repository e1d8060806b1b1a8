"""CSV logs: a header with `time`, then samples. Separators `,` `;` or tab, decimal commas where the separator
allows."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..errors import SessionError, did_you_mean
from .log import COLUMNS, Log, build_log
from .text import number_table, read_lines


def read_csv_log(path: Path) -> Log:
    """Read a CSV log; an empty cell is a lost sample (nan). A column that the format does not name and that holds text is
    left out, with a note.

    Raises SessionError where the header is missing, names a column twice or has no `time`, or a line has the wrong
    width or a cell that is no finite number.
    """
    lines = read_lines(path)
    separator = max((";", "\t", ","), key=lines[0].count)
    header = [name.strip() for name in _cells(lines[0], separator)]
    while header and not header[-1]:  # a separator at the end of every line
        header.pop()
    _check_header(header, path)
    numbers = [i for i in range(1, len(lines)) if lines[i].strip()]
    if not numbers:
        raise SessionError(f"{path}: the log is empty; samples below the header are needed")
    rows = [_cells(lines[i], separator) for i in numbers]
    if separator != "," and any("," in lines[i] for i in numbers):
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
    width = len(header)
    for i, row in enumerate(rows):
        while len(row) > width and not row[-1].strip():
            row.pop()
        if len(row) != width:
            raise SessionError(
                f"{path}: line {numbers[i] + 1} has {len(row)} cells; {width} are needed, one for each column"
            )
    at, notes = [i + 1 for i in numbers], list[str]()
    try:
        table = number_table(rows, at, path)
    except SessionError:
        text = [i for i, name in enumerate(header) if name not in COLUMNS and _is_text(row[i] for row in rows)]
        if not text:
            raise
        notes = [f'column "{header[i]}" holds text and is ignored' for i in text]
        header = [name for i, name in enumerate(header) if i not in text]
        table = number_table([[cell for i, cell in enumerate(row) if i not in text] for row in rows], at, path)
    if np.isinf(table).any():
        row, column = np.argwhere(np.isinf(table))[0]
        raise SessionError(
            f'{path}: line {numbers[row] + 1}, column "{header[column]}" is infinite; '
            "a number or an empty cell is needed"
        )
    columns = {name: table[:, i] for i, name in enumerate(header)}
    return build_log(columns.pop("time"), columns, path, notes)


def _cells(line: str, separator: str) -> list[str]:
    if '"' in line:
        return next(csv.reader([line], delimiter=separator), [])
    return line.split(separator)


def _check_header(header: list[str], path: Path) -> None:
    if "time" not in header:
        if header and all(_is_number(name) for name in header if name):
            raise SessionError(
                f"{path}: no header; the first line must name the columns ({', '.join(COLUMNS[:3])}, ...)"
            )
        raise SessionError(f'{path}: no column "time"; {did_you_mean("time", header)}')
    twice = [name for name, count in Counter(header).items() if count > 1]
    if twice:
        raise SessionError(f'{path}: the column "{twice[0]}" occurs twice; each column once is needed')
    if "" in header:
        raise SessionError(
            f"{path}: column {header.index('') + 1} has no name; a header cell for each column is needed"
        )


def _is_text(cells: Iterable[str]) -> bool:
    """Whether most of a column's cells that are not empty are no numbers: of few of them, something went wrong."""
    told = [_is_number(cell) for cell in cells if cell.strip()]
    return sum(told) < 0.5 * len(told)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
