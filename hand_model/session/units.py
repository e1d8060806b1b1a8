"""Length units that marker files state."""

from __future__ import annotations

from pathlib import Path

from ..errors import SessionError, did_you_mean

METRES = {"m": 1.0, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
SPELLINGS = {
    "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "centimeter": "cm", "centimeters": "cm", "centimetre": "cm", "centimetres": "cm",
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "micrometer": "um", "micrometers": "um", "\u00b5m": "um", "\u03bcm": "um",
    "inch": "in", "inches": "in", "foot": "ft", "feet": "ft",
}  # fmt: skip


def metres_per(unit: str | None, path: Path, field: str) -> float:
    """Metres per unit [m]; None or an empty text means millimetres (session format).

    Raises SessionError naming the file and the header field where the unit is unknown.
    """
    word = (unit or "").strip().strip("\0").lower() or "mm"
    word = SPELLINGS.get(word, word)
    if word not in METRES:
        raise SessionError(f'{path}: {field} is "{unit}"; {did_you_mean(word, METRES)}')
    return METRES[word]
