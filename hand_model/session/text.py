"""Text tables: decoding, and numbers out of separated cells, fast and with the line named where a cell is wrong."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError

Array = NDArray[np.float64]


def read_lines(path: Path) -> list[str]:
    """Lines of a text file in UTF-8 (with or without byte order mark), UTF-16 with a mark, or Latin-1.

    Raises SessionError where the file cannot be read, is empty, or is no text.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SessionError(f"{path}: cannot be read ({error.strerror or error})") from None
    if not data.strip():
        raise SessionError(f"{path}: the file is empty; a header and samples are needed")
    utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    if b"\0" in data and not utf16:
        raise SessionError(f"{path}: this is a binary file; a text table is needed")
    for encoding in ("utf-16",) if utf16 else ("utf-8-sig", "latin-1"):
        try:
            text = data.decode(encoding)
            break
        except UnicodeDecodeError:
            continue
    else:
        raise SessionError(f"{path}: not readable as text; UTF-8 is needed")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def number_table(rows: list[list[str]], line_numbers: list[int], path: Path) -> Array:
    """Rows of equally many cells as an array (n, k); an empty cell is nan.

    line_numbers: where each row stands in the file, counted from 1, for the error message.
    Raises SessionError naming line and cell where a cell is neither a number nor empty.
    """
    nan = float("nan")
    try:
        return np.array([[float(c) if c else nan for c in row] for row in rows], dtype=float)
    except ValueError:
        pass
    table = np.full((len(rows), len(rows[0]) if rows else 0), nan)
    for i, row in enumerate(rows):
        for j, cell in enumerate(row):
            if cell.strip():
                table[i, j] = _number(cell, path, line_numbers[i], j)
    return table


def _number(cell: str, path: Path, line: int, column: int) -> float:
    try:
        return float(cell)
    except ValueError:
        shown = cell if len(cell) < 40 else cell[:37] + "..."
        raise SessionError(
            f"{path}: line {line}, cell {column + 1} holds {shown!r}; a number or an empty cell is needed"
        ) from None


def header_number(text: str | None, name: str, path: Path) -> float:
    """A number above zero from a header field; a decimal comma is allowed. Raises SessionError naming the field."""
    try:
        value = float((text or "").strip().replace(",", "."))
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise SessionError(f"{path}: {name} is {text!r}; a number above zero is needed")
    return value
