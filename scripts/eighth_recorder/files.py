"""Write marker and log files as a laboratory's programs do."""

import struct
from pathlib import Path

import numpy as np


def write_log(path: Path, rows: dict[str, np.ndarray]) -> None:
    """CSV: time with five decimals, whole numbers otherwise."""
    lines = [",".join(rows)]
    for values in zip(*rows.values(), strict=True):
        cells = ["" if np.isnan(v) else f"{v:.0f}" for v in values[1:]]
        lines.append(",".join([f"{values[0]:.5f}", *cells]))
    path.write_text("\n".join(lines) + "\n")


def write_tsv(path: Path, labels, points, rate) -> None:
    """Qualisys TSV, millimetres; an empty cell is a gap."""
    head = [
        f"NO_OF_FRAMES\t{len(points)}",
        "NO_OF_CAMERAS\t8",
        f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{rate:g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2026-01-01, 10:00:00",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(labels),
    ]
    flat = points.reshape(len(points), -1)
    body = ["\t".join("" if np.isnan(v) else f"{v:.3f}" for v in row) for row in flat]
    path.write_text("\n".join(head + body) + "\n")


def _parameter(name: str, group: int, kind: int, dims: list[int], data: bytes) -> bytes:
    """One C3D parameter record."""
    rest = struct.pack("<bB", kind, len(dims)) + bytes(dims) + data + b"\x00"
    return struct.pack("<bb", len(name), group) + name.encode() + struct.pack("<h", len(rest) + 2) + rest


def _group(name: str, group: int) -> bytes:
    return struct.pack("<bb", len(name), -group) + name.encode() + struct.pack("<h", 3) + b"\x00"


def write_c3d(path: Path, labels, points, rate) -> None:
    """C3D with floating-point samples in mm; a gap has residual -1."""
    frames, markers = points.shape[:2]
    width = max(len(label) for label in labels)
    names = "".join(label.ljust(width) for label in labels).encode()

    def section(start: int) -> bytes:
        records = [
            _group("POINT", 1),
            _parameter("USED", 1, 2, [], struct.pack("<h", markers)),
            _parameter("SCALE", 1, 4, [], struct.pack("<f", -1.0)),
            _parameter("RATE", 1, 4, [], struct.pack("<f", rate)),
            _parameter("DATA_START", 1, 2, [], struct.pack("<h", start)),
            _parameter("FRAMES", 1, 2, [], struct.pack("<H", frames)),
            _parameter("LABELS", 1, -1, [width, markers], names),
            _parameter("DESCRIPTIONS", 1, -1, [width, markers], names),
            _parameter("UNITS", 1, -1, [2], b"mm"),
            _group("ANALOG", 2),
            _parameter("USED", 2, 2, [], struct.pack("<h", 0)),
            _parameter("RATE", 2, 4, [], struct.pack("<f", 0.0)),
        ]
        body = b"".join(records) + b"\x00\x00\x00\x00"
        blocks = -(-(len(body) + 4) // 512)
        return (struct.pack("<BBBB", 1, 80, blocks, 84) + body).ljust(blocks * 512, b"\x00")

    start = 2 + len(section(0)) // 512
    header = struct.pack("<BBHHHHHfHHf", 2, 80, markers, 0, 1, frames, 10, -1.0, start, 0, rate).ljust(512, b"\x00")
    data = np.zeros((frames, markers, 4), dtype="<f4")
    gap = np.isnan(points[..., 0])
    data[..., :3] = np.where(gap[..., None], 0.0, points)
    data[..., 3] = np.where(gap, -1.0, 0.0)
    blob = data.tobytes()
    path.write_bytes(header + section(start) + blob.ljust(-(-len(blob) // 512) * 512, b"\x00"))


def write_markers(folder: Path, name: str, suffix: str, labels, points, rate) -> str:
    """Write one marker file and return its path in the session."""
    path = folder / "mocap" / f"{name}.{suffix}"
    (write_c3d if suffix == "c3d" else write_tsv)(path, labels, points, rate)
    return f"mocap/{path.name}"
