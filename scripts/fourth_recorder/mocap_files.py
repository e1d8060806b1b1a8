"""Marker recordings as C3D, QTM TSV or TRC files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import ezc3d
import numpy as np

from .geometry import Array
from .laboratory import Laboratory


def write_mocap(laboratory: Laboratory, path: Path, labels: Sequence[str], points: Array) -> None:
    """Points (n, k, 3) [mm], NaN where lost, in the laboratory's format."""
    write = {"c3d": write_c3d, "tsv": write_tsv, "trc": write_trc}[laboratory.mocap_format]
    write(path, list(labels), points, laboratory.mocap_hz)


def write_c3d(path: Path, labels: list[str], points: Array, rate: float) -> None:
    """Points [mm] at a rate [Hz]; what is lost has residual -1."""
    c3d = ezc3d.c3d()
    header = c3d["parameters"]["POINT"]
    header["UNITS"]["value"] = ["mm"]
    header["RATE"]["value"] = [rate]
    header["LABELS"]["value"] = labels
    header["DESCRIPTIONS"]["value"] = [""] * len(labels)
    data = np.ones((4, len(labels), len(points)))
    data[:3] = points.transpose(2, 1, 0)
    c3d["data"]["points"] = data
    c3d["data"]["meta_points"]["residuals"] = np.where(np.isnan(points[:, :, 0]).T, -1.0, 0.0)[None]
    c3d.write(str(path))


def cells(points: Array, digits: int) -> list[str]:
    """The numbers of each frame between tabs; empty where lost."""
    flat = points.reshape(len(points), -1)
    return ["\t".join("" if np.isnan(value) else f"{value:.{digits}f}" for value in row) for row in flat]


def write_tsv(path: Path, labels: list[str], points: Array, rate: float) -> None:
    """As QTM exports it."""
    lines = [
        f"NO_OF_FRAMES\t{len(points)}",
        "NO_OF_CAMERAS\t8",
        f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{rate:g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2024-05-14, 10:21:33",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(labels),
    ]
    path.write_text("\n".join(lines + cells(points, 3)) + "\n")


def write_trc(path: Path, labels: list[str], points: Array, rate: float) -> None:
    """In millimetres."""
    frames, count = len(points), len(labels)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{frames}\t{count}\tmm\t{rate:g}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(count) for axis in "XYZ"),
        "",
    ]
    lines += [f"{i + 1}\t{i / rate:.5f}\t{row}" for i, row in enumerate(cells(points, 4))]
    path.write_text("\n".join(lines) + "\n")
