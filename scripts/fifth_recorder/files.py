"""Write marker files (C3D, TSV, TRC, CSV) and logs."""

from pathlib import Path

import numpy as np


def write_markers(path: Path, labels: list[str], points: np.ndarray, rate: float) -> None:
    """Marker positions (frames, markers, 3) m, NaN for a gap, at `rate` frames/s, in mm; the suffix says the format."""
    {".c3d": _c3d, ".tsv": _tsv, ".trc": _trc, ".csv": _csv}[path.suffix](path, labels, points * 1000.0, rate)


def _c3d(path: Path, labels: list[str], points: np.ndarray, rate: float) -> None:
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
    gap = np.isnan(points).any(2)
    data = np.ones((4, points.shape[1], len(points)))
    data[:3] = np.where(gap[..., None], np.nan, points).transpose(2, 1, 0)
    file["data"]["points"] = data
    file["data"]["meta_points"]["residuals"] = np.where(gap, -1.0, 0.0).T[None]
    file.write(str(path))


def _cells(points: np.ndarray, lead: list[np.ndarray], digits: int, comma: str) -> list[str]:
    flat = points.reshape(len(points), -1)
    spec = f"%.{digits}f"
    text = [[("" if np.isnan(q) else spec % q) for q in row] for row in flat]
    heads = list(zip(*[[str(q) for q in column] for column in lead])) or [()] * len(text)
    return [comma.join([*head, *row]) for head, row in zip(heads, text)]


def _time(points: np.ndarray, rate: float) -> np.ndarray:
    return np.round(np.arange(len(points)) / rate, 6)


def _tsv(path: Path, labels: list[str], points: np.ndarray, rate: float) -> None:
    head = [
        f"NO_OF_FRAMES\t{len(points)}",
        "NO_OF_CAMERAS\t8",
        f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{rate:g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2026-02-03, 10:11:12.000",
        "DATA_INCLUDED\t3D",
        "\t".join(["MARKER_NAMES", *labels]),
    ]
    path.write_text("\n".join(head + _cells(points, [], 3, "\t")) + "\n")


def _trc(path: Path, labels: list[str], points: np.ndarray, rate: float) -> None:
    n = len(points)
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{n}\t{len(labels)}\tmm\t{rate:g}\t1\t{n}",
        "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
        "\t\t" + "\t".join(f"{c}{i + 1}" for i in range(len(labels)) for c in "XYZ"),
        "",
    ]
    path.write_text("\n".join(head + _cells(points, [np.arange(1, n + 1), _time(points, rate)], 4, "\t")) + "\n")


def _csv(path: Path, labels: list[str], points: np.ndarray, rate: float) -> None:
    three = [q for q in labels for _ in range(3)]
    head = [
        f"Format Version,1.23,Take Name,{path.stem},Capture Frame Rate,{rate:.6f},Export Frame Rate,{rate:.6f},"
        f"Total Frames in Take,{len(points)},Total Exported Frames,{len(points)},Rotation Type,Quaternion,"
        "Length Units,Millimeters,Coordinate Space,Global",
        "",
        ",".join(["", "Type", *["Marker"] * len(three)]),
        ",".join(["", "Name", *three]),
        ",".join(["", "ID", *[f"{i // 3 + 1:032X}" for i in range(len(three))]]),
        ",".join(["", "", *["Position"] * len(three)]),
        ",".join(["Frame", "Time (Seconds)", *["X", "Y", "Z"] * len(labels)]),
    ]
    path.write_text("\n".join(head + _cells(points, [np.arange(len(points)), _time(points, rate)], 6, ",")) + "\n")


def write_log(path: Path, time: np.ndarray, columns: dict[str, np.ndarray], lost: np.ndarray) -> None:
    """Rows of time (s) and integer columns, temperature with one digit; `lost` marks empty position and current."""
    parts = [[f"{q:.5f}" for q in time]]
    for name, values in columns.items():
        if name == "temperature":
            cells = [f"{q:.1f}" for q in values]
        else:
            cells = [str(q) for q in np.rint(values).astype(int)]
        if name in ("position", "current"):
            cells = ["" if gone else q for q, gone in zip(cells, lost)]
        parts.append(cells)
    body = [",".join(row) for row in zip(*parts)]
    path.write_text("\n".join([",".join(["time", *columns]), *body]) + "\n")
