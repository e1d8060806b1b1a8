"""What the thesis published of the BeBionic hand, to print beside a result. Another specimen: a yardstick, not a
truth.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Any

# Encoder to marker, median errors per finger as the thesis gives them in words [m]: figures 4.5 and 4.6.
MARKER_ERROR_M = {"left": (1e-3, 5e-3), "right": (0.0, 10e-3)}


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(resources.files(__package__).joinpath("published.toml").read_text())


def _row(finger: str, *path: str) -> tuple[float, ...] | None:
    table: Any = _tables()
    for key in path:
        table = table.get(key, {})
    return tuple(table[finger]) if finger in table else None


def mapping_rmse_deg(side: str, segment: str, finger: str) -> tuple[float, ...] | None:
    """RMSE [deg] of encoder counts to segment angle, orders 1, 2, 3 (tables 4.5 to 4.8); None where there is none."""
    return _row(finger, side, f"mapping_{segment}")


def current_rmse_raw(side: str, actuator: str) -> tuple[float, ...] | None:
    """RMSE [raw] of predicted current for D, SMD, + Coulomb, + reciprocal (tables 4.12, 4.13); None where there is
    none.
    """
    return _row(actuator, side, "current")


def axis_repeatability_deg(finger: str) -> tuple[float, ...] | None:
    """Angle [deg] between the axes (proximal, distal) of two captures of the left hand (table 4.9); None where there
    is none.
    """
    return _row(finger, "left", "axis_repeatability_deg")


# The figures of table 4.11 for the two thumb positions are those of each other's axes in tables 4.1 and 4.2, on both
# hands
# (8.44 and 5.21 deg from the right hand's axes of thumb_0 and thumb_1, against 5.191 and 8.456 printed).
EXCHANGED = {"thumb_0": "thumb_1", "thumb_1": "thumb_0"}


def axis_parallelism_deg(side: str, finger: str) -> float | None:
    """Angle [deg] between the two axes of a finger (table 4.11, the thumb's rows put right); None where there is
    none.
    """
    return _tables()["axis_parallelism_deg"].get(side, {}).get(EXCHANGED.get(finger, finger))
