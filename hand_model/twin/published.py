"""Published axes and centres of the BeBionic hand, the geometry that the twin starts from."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from ..errors import HandModelError, did_you_mean

Array = NDArray[np.float64]

SIDES = ("left", "right")
FINGERS = ("thumb_0", "thumb_1", "index", "middle", "ring", "little")


@cache
def _tables() -> dict:
    return tomllib.loads(resources.files(__package__).joinpath("published.toml").read_text())


def published_joint(side: str, finger: str) -> tuple[Array, Array]:
    """Axes (2, 3) [unit] and centres (2, 3) [m] of a finger, proximal then distal, in the landmark frame (thesis,
    tables 4.1 to 4.4).

    Raises HandModelError for a side or finger that was not published.
    """
    if side not in SIDES:
        raise HandModelError(f'no published hand of side "{side}"; {did_you_mean(side, SIDES)}')
    if finger not in FINGERS:
        raise HandModelError(f'no published finger "{finger}"; {did_you_mean(finger, FINGERS)}')
    table = _tables()[side]
    axis = np.array(table["axis"][finger], float)
    return axis / np.linalg.norm(axis, axis=1, keepdims=True), np.array(table["centre"][finger], float)
