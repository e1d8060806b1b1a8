"""Write marker files (C3D) and logs (CSV)."""

from __future__ import annotations

from pathlib import Path

import ezc3d
import numpy as np


def write_markers(path: Path, labels: list[str], points: np.ndarray, rate: float) -> None:
    """Marker positions (frames, markers, 3) mm, NaN for a gap, at `rate` frames/s."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
    data = np.ones((4, len(labels), len(points)))
    data[:3] = points.transpose(2, 1, 0)
    gap = ~np.isfinite(data[:3]).all(0)
    data[:3, gap] = 0
    file["data"]["points"] = data
    file["data"]["meta_points"]["residuals"] = np.where(gap, -1.0, 0.0)[None]
    file.write(str(path))


def write_log(path: Path, rows: dict[str, np.ndarray]) -> None:
    """Rows of a log by column, `time` (s) first; NaN is an empty cell."""
    lines = [",".join(rows)]
    lines += [",".join([f"{time:.5f}", *map(_cell, cells)]) for time, *cells in zip(*rows.values())]
    path.write_text("\n".join(lines) + "\n")


def _cell(x: float) -> str:
    if not np.isfinite(x):
        return ""
    return str(int(x)) if float(x).is_integer() else f"{x:g}"
