"""C3D marker files (Qualisys, Vicon, any other): header, parameters and points, straight from the bytes.

Layout: The C3D File Format, user guide (c3d.org): a 512-byte header, a parameter section of named groups, and frames of
points (x, y, z, residual) followed by analog samples, as 16-bit integers times POINT:SCALE or as floats (SCALE < 0),
in Intel, MIPS or DEC byte order. Read here rather than by ezc3d because its core accepts a file that ends early, and
takes ten times as long; the tests hold both against each other.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError
from .mocap import Mocap, build_mocap
from .units import metres_per

BLOCK = 512
LAST_FRAME = 65535
INTEL, DEC, MIPS = 84, 85, 86

Parameters = dict[str, Any]


def read_c3d(path: Path) -> Mocap:
    """Read the markers of a C3D file; a residual below zero marks a gap, POINT:UNITS the unit (none: millimetres).

    Raises SessionError where the file is foreign, truncated, without markers, or in an unknown unit.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SessionError(f"{path}: cannot be read ({error.strerror or error})") from None
    if len(data) < 2 * BLOCK or data[1] != 0x50 or data[0] == 0:
        raise SessionError(f"{path}: not a C3D file (its header or parameters are missing); a complete C3D is needed")
    try:
        processor, parameters = _parameters(data)
        labels = _labels(parameters, points := _count(data, parameters, processor))
        unit = parameters.get("POINT:UNITS") or [""]
        rate_hz = float(np.ravel(parameters.get("POINT:RATE", 0.0))[0]) or _floats(data[20:24], processor)[0]
        with np.errstate(all="ignore"):  # a damaged number becomes infinite or nan, and so a gap
            position, seen = _points(data, parameters, processor, points, path)
    except (struct.error, LookupError, ValueError, TypeError, OverflowError):
        raise SessionError(f"{path}: damaged C3D file (its parameters contradict themselves); export it anew") from None
    if not 0.0 < rate_hz < 1e6:
        raise SessionError(f"{path}: POINT:RATE is {rate_hz:g}; a frame rate above zero is needed")
    position *= metres_per(str(unit[0] if isinstance(unit, list) else unit), path, "POINT:UNITS")
    position[~seen] = np.nan
    return build_mocap(labels, np.arange(len(position)) / rate_hz, position, rate_hz, path)


def _order(processor: int) -> str:
    return ">" if processor == MIPS else "<"


def _floats(data: bytes, processor: int) -> NDArray[np.float32]:
    """32-bit floats; a DEC float is the IEEE float times four with its two halves exchanged."""
    if processor != DEC:
        return np.frombuffer(data, _order(processor) + "f4").astype(np.float32)
    halves = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
    return np.ascontiguousarray(halves).view("<f4").ravel() / np.float32(4.0)


def _parameters(data: bytes) -> tuple[int, Parameters]:
    """Processor type and the parameters by `GROUP:NAME`: lists of text, or arrays of numbers, first index fastest."""
    at = (data[0] - 1) * BLOCK
    processor = data[at + 3]
    if processor not in (INTEL, DEC, MIPS):
        raise ValueError("processor")
    order = _order(processor)
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Any]] = []
    at += 4
    while at + 4 <= len(data):
        length, group = struct.unpack_from("<bb", data, at)
        if length == 0 or group == 0:
            break
        name = data[at + 2 : at + 2 + abs(length)].decode("latin-1").strip().upper()
        at += 2 + abs(length)
        (step,) = struct.unpack_from(order + "H", data, at)
        if group < 0:
            groups[-group] = name
        else:
            found.append((group, name, _value(data, at + 2, processor)))
        if step == 0:
            break
        at += step
    return processor, {f"{groups.get(group, '')}:{name}": value for group, name, value in found}


def _value(data: bytes, at: int, processor: int) -> Any:
    kind, dimensions = struct.unpack_from("<bB", data, at)
    shape = data[at + 2 : at + 2 + dimensions]
    size = int(np.prod(list(shape), dtype=np.int64)) if dimensions else 1
    start = at + 2 + dimensions
    raw = data[start : start + size * abs(kind)]
    if len(raw) < size * abs(kind):
        raise ValueError("parameter")
    if kind == -1:
        text = raw.decode("utf-8", "replace") if dimensions < 2 else ""
        if dimensions < 2:
            return [text.strip().strip("\0").strip()]
        width = max(shape[0], 1)
        return [
            raw[i : i + width].decode("utf-8", "replace").strip().strip("\0").strip() for i in range(0, size, width)
        ]
    if kind == 4:
        return _floats(raw, processor)
    return np.frombuffer(raw, {1: "u1", 2: _order(processor) + "u2"}[kind])


def _labels(parameters: Parameters, points: int) -> list[str]:
    """Labels of all points; POINT:LABELS2 and so on continue where a list of 255 is full, points without one are
    unnamed."""
    labels: list[str] = []
    for i in range(1, 260):
        more = parameters.get(f"POINT:LABELS{i if i > 1 else ''}")
        if not isinstance(more, list):
            break
        labels += more
    return labels[:points] + [f"*{i}" for i in range(len(labels), points)]


def _count(data: bytes, parameters: Parameters, processor: int) -> int:
    """Number of points in a frame, POINT:USED or the header."""
    (header,) = struct.unpack_from(_order(processor) + "H", data, 2)
    return int(np.ravel(parameters.get("POINT:USED", header))[0])


def _points(
    data: bytes, parameters: Parameters, processor: int, points: int, path: Path
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Positions (n, m, 3) in the file's unit, and (n, m) whether the point was seen."""
    order = _order(processor)
    if points == 0:
        raise SessionError(
            f"{path}: the C3D file holds no marker (analog channels only); marker trajectories are needed"
        )
    (analog,) = struct.unpack_from(order + "H", data, 4)
    (start_block,) = struct.unpack_from(order + "H", data, 16)
    start = (start_block or int(np.ravel(parameters["POINT:DATA_START"])[0])) - 1
    scale = float(np.ravel(parameters.get("POINT:SCALE", _floats(data[12:16], processor)))[0])
    width, words = (4 if scale < 0 else 2), 4 * points + analog
    available = max(len(data) - start * BLOCK, 0) // (width * words)
    frames = _frames(data, parameters, order, available, width * words, path)
    if (
        frames == LAST_FRAME < available
    ):  # the header's 16 bits are full, and nothing else says how many frames there are
        body = np.frombuffer(data, "u1", available * width * words, start * BLOCK).reshape(available, -1)
        frames = (
            int(np.flatnonzero(body.any(axis=1)).max(initial=frames - 1)) + 1
        )  # the last block is filled with zeros
    body = data[start * BLOCK : start * BLOCK + frames * words * width]
    if scale < 0:
        table = _floats(body, processor)
        quads = table.reshape(frames, words)[:, : 4 * points].reshape(frames, points, 4)
        return quads[..., :3].astype(float), ~(quads[..., 3] < 0)
    quads = np.frombuffer(body, order + "i2").reshape(frames, words)[:, : 4 * points].reshape(frames, points, 4)
    return quads[..., :3] * scale, ~(quads[..., 3] < 0)


def _frames(data: bytes, parameters: Parameters, order: str, available: int, frame_bytes: int, path: Path) -> int:
    """Number of frames. The header holds 16 bits of it; longer recordings say it again in parameters of 32 bits.

    The largest claim that the file can hold is taken; a file with too few frames for its claims is truncated.
    """
    first, last = struct.unpack_from(order + "HH", data, 6)
    claims = [last - first + 1]
    for name in ("POINT:FRAMES", "POINT:LONG_FRAMES"):
        claims += [int(x) for x in np.ravel(parameters.get(name, []))[:1]]
    ends = [np.ravel(parameters.get(f"TRIAL:ACTUAL_{x}_FIELD", []))[:2].astype(int) for x in ("START", "END")]
    if all(len(end) == 2 for end in ends):
        low, high = (int(end[0]) + 65536 * int(end[1]) for end in ends)
        claims.append(high - low + 1)
    claims = [claim for claim in claims if claim > 0]
    if not claims:
        raise SessionError(f"{path}: the C3D header states no frame; marker trajectories are needed")
    held = max((claim for claim in claims if claim <= available), default=0)
    longest = max(claims)
    if held == 0 or (longest > available and (available - held) * frame_bytes > BLOCK):
        raise SessionError(f"{path}: truncated C3D file, it holds {available} of {longest} frames; export it anew")
    return held
