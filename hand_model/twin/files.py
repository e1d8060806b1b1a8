"""Writers of marker files, logs and the manifest; the same data gives the same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import HandModelError, did_you_mean

Array = NDArray[np.float64]

UNITS = {"mm": 1e3, "m": 1.0}
MOTIVE_UNITS = {"mm": "Millimeters", "m": "Meters"}


def write_markers(path: Path, markers: dict[str, Array], rate_hz: float, unit: str) -> None:
    """Write label -> (n, 3) [m] as C3D, QTM TSV, TRC or Motive CSV, chosen by the path's ending; nan is a gap.

    TSV files state no unit and are in millimetres. Raises HandModelError for another ending or unit.
    """
    writers = {".c3d": _write_c3d, ".tsv": _write_tsv, ".trc": _write_trc, ".csv": _write_motive}
    if path.suffix not in writers:
        raise HandModelError(f'the twin writes no "{path.suffix}" marker files; {did_you_mean(path.suffix, writers)}')
    if unit not in UNITS:
        raise HandModelError(f'the twin writes no lengths in "{unit}"; {did_you_mean(unit, UNITS)}')
    unit = "mm" if path.suffix == ".tsv" else unit
    position = np.stack(list(markers.values()), axis=1) * UNITS[unit]
    writers[path.suffix](path, list(markers), position, rate_hz, unit)


def _write_c3d(path: Path, labels: list[str], position: Array, rate_hz: float, unit: str) -> None:
    import ezc3d

    file = ezc3d.c3d()
    gap = ~np.isfinite(position).all(axis=2)
    points = np.ones((4, len(labels), len(position)))
    points[:3] = np.where(gap[..., None], 0.0, position).transpose(2, 1, 0)
    file["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels)
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = np.where(gap.T, -1.0, 0.0)[None]
    file.write(str(path))


def _cells(position: Array, digits: int) -> list[list[str]]:
    return [["" if np.isnan(x) else f"{x:.{digits}f}" for x in row] for row in position.reshape(len(position), -1)]


def _write_tsv(path: Path, labels: list[str], position: Array, rate_hz: float, unit: str) -> None:
    head = [
        ["NO_OF_FRAMES", len(position)],
        ["NO_OF_CAMERAS", 8],
        ["NO_OF_MARKERS", len(labels)],
        ["FREQUENCY", f"{rate_hz:g}"],
        ["NO_OF_ANALOG", 0],
        ["ANALOG_FREQUENCY", 0],
        ["DESCRIPTION", "--"],
        ["TIME_STAMP", "2024-01-01, 12:00:00"],
        ["DATA_INCLUDED", "3D"],
        ["MARKER_NAMES", *labels],
    ]
    rows = ["\t".join(map(str, line)) for line in head] + ["\t".join(row) for row in _cells(position, 3)]
    path.write_text("\n".join(rows) + "\n")


def _write_trc(path: Path, labels: list[str], position: Array, rate_hz: float, unit: str) -> None:
    n, m = len(position), len(labels)
    rate = f"{rate_hz:g}"
    camera = ["DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"]
    original = ["OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"]
    head = [
        ["PathFileType", "4", "(X/Y/Z)", path.name],
        camera + original,
        [rate, rate, str(n), str(m), unit, rate, "1", str(n)],
        ["Frame#", "Time", *(cell for label in labels for cell in (label, "", ""))],
        ["", "", *(f"{axis}{i + 1}" for i in range(m) for axis in "XYZ")],
        [],
    ]
    body = [[str(i + 1), f"{i / rate_hz:.5f}", *row] for i, row in enumerate(_cells(position, 6 if unit == "m" else 4))]
    path.write_text("\n".join("\t".join(row) for row in head + body) + "\n")


def _write_motive(path: Path, labels: list[str], position: Array, rate_hz: float, unit: str) -> None:
    m = len(labels)
    rate = f"{rate_hz:.6f}"
    head = [
        ["Format Version", "1.23", "Take Name", path.stem, "Capture Frame Rate", rate, "Export Frame Rate", rate,
         "Total Exported Frames", str(len(position)), "Length Units", MOTIVE_UNITS[unit], "Coordinate Space", "Global"],
        [],
        ["", "Type", *["Marker"] * (3 * m)],
        ["", "Name", *(label for label in labels for _ in "XYZ")],
        ["", "ID", *(f"{1000 + i}" for i in range(m) for _ in "XYZ")],
        ["", "", *["Position"] * (3 * m)],
        ["Frame", "Time (Seconds)", *["X", "Y", "Z"] * m],
    ]  # fmt: skip
    body = [[str(i), f"{i / rate_hz:.6f}", *row] for i, row in enumerate(_cells(position, 6 if unit == "m" else 4))]
    path.write_text("\n".join(",".join(row) for row in head + body) + "\n")


def write_log(path: Path, columns: dict[str, Array]) -> None:
    """Write log columns (k,) as CSV: time with five digits, whole numbers as such, an empty cell for nan."""
    cells = [[f"{t:.5f}" for t in columns["time"]]]
    cells += [[_number(x) for x in values] for name, values in columns.items() if name != "time"]
    rows = [",".join(columns)] + [",".join(row) for row in zip(*cells, strict=True)]
    path.write_text("\n".join(rows) + "\n")


def _number(value: float) -> str:
    if np.isnan(value):
        return ""
    return str(int(value)) if float(value).is_integer() else f"{value:.9g}"


def toml_text(value: Any) -> str:
    """A value as inline TOML: strings, numbers, booleans, lists, tables."""
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_text(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(toml_text(item) for item in value) + "]"
    return repr(value.item() if isinstance(value, np.generic) else value)
