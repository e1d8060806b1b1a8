"""Marker recordings as C3D, QTM TSV or TRC files."""

from __future__ import annotations

from pathlib import Path

import ezc3d
import numpy as np

from .geometry import Array
from .laboratory import Laboratory


def write_mocap(laboratory: Laboratory, path: Path, labels: list[str], points: Array) -> None:
    """Points (n, k, 3) [mm], NaN where lost, in the laboratory's format."""
    if laboratory.mocap_format == "c3d":
        write_c3d(path, labels, points, laboratory.mocap_hz)
    elif laboratory.mocap_format == "tsv":
        write_tsv(path, labels, points, laboratory.mocap_hz, laboratory.tsv_time)
    else:
        write_trc(path, labels, points, laboratory.mocap_hz, laboratory.trc_metres)


def write_c3d(path: Path, labels: list[str], points: Array, rate: float) -> None:
    """Points [mm] at a rate [Hz]; what is lost has residual -1."""
    c3d = ezc3d.c3d()
    header = c3d["parameters"]["POINT"]
    header["RATE"]["value"] = [rate]
    header["LABELS"]["value"] = labels
    header["UNITS"]["value"] = ["mm"]
    data = np.ones((4, len(labels), len(points)))
    data[:3] = points.transpose(2, 1, 0)
    c3d["data"]["points"] = data
    c3d["data"]["meta_points"]["residuals"] = np.where(np.isnan(points[:, :, 0]).T[None], -1.0, 0.0)
    c3d.write(str(path))


def cells(points: Array, digits: int) -> list[str]:
    """The numbers of each frame between tabs; empty where lost."""
    flat = points.reshape(len(points), -1)
    text = np.char.mod(f"%.{digits}f", flat)
    text[np.isnan(flat)] = ""
    return ["\t".join(row) for row in text]


def write_tsv(path: Path, labels: list[str], points: Array, rate: float, timed: bool) -> None:
    """As QTM exports it; timed: with a line of column names and columns Frame and Time."""
    lines = [
        f"NO_OF_FRAMES\t{len(points)}",
        "NO_OF_CAMERAS\t8",
        f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{rate:g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2024-03-05, 10:12:44.512\t4012.1204",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(labels),
    ]
    if timed:
        lines.append("Frame\tTime\t" + "\t".join(f"{label} {axis}" for label in labels for axis in "XYZ"))
    for i, row in enumerate(cells(points, 3)):
        lines.append((f"{i + 1}\t{i / rate:.5f}\t" if timed else "") + row)
    path.write_text("\n".join(lines) + "\n")


def write_trc(path: Path, labels: list[str], points: Array, rate: float, metres: bool) -> None:
    """In millimetres or metres."""
    frames, count = len(points), len(labels)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{frames}\t{count}\t{'m' if metres else 'mm'}\t{rate:g}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(count) for axis in "XYZ"),
        "",
    ]
    rows = cells(points * 0.001, 6) if metres else cells(points, 3)
    lines += [f"{i + 1}\t{i / rate:.5f}\t{row}" for i, row in enumerate(rows)]
    path.write_text("\n".join(lines) + "\n")
