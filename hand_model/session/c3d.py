"""C3D marker files (Qualisys, Vicon) through ezc3d."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import SessionError
from .mocap import Mocap

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}


def read_c3d(path: Path) -> Mocap:
    """Read a C3D file; a residual below zero marks a gap, POINT:UNITS the unit (millimetres where none is stated)."""
    import ezc3d

    try:
        data = ezc3d.c3d(str(path))
    except Exception as error:  # ezc3d raises whatever its C++ core threw
        raise SessionError(f"{path}: not a readable C3D file ({error})") from None
    point = data["parameters"]["POINT"]
    labels = tuple(str(label).strip() for label in point["LABELS"]["value"])
    unit = (point.get("UNITS", {}).get("value") or ["mm"])[0].strip().lower() or "mm"
    if unit not in METRES:
        raise SessionError(f'{path}: POINT:UNITS is "{unit}"; valid: {", ".join(METRES)}')
    rate_hz = float(point["RATE"]["value"][0])
    if not rate_hz > 0:
        raise SessionError(f"{path}: POINT:RATE is {rate_hz}; a frame rate above zero is needed")
    position = np.moveaxis(data["data"]["points"][:3], 0, -1).transpose(1, 0, 2) * METRES[unit]
    residual = data["data"]["meta_points"]["residuals"][0].T
    position = np.where((residual < 0)[..., None], np.nan, position)
    time_s = np.arange(len(position)) / rate_hz
    return Mocap(labels, time_s, np.ascontiguousarray(position), rate_hz, path)
