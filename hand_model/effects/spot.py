"""Spots: where on a range something narrow is looked for first."""

from __future__ import annotations

import math

import numpy as np

WIDTHS = (0.018, 0.03, 0.06, 0.12)  # of the range
FEWEST = 18  # places of a wide one


def spots(low: float, high: float, edge: float, apart: float) -> list[dict[str, float]]:
    """Centres and widths of spots between positions `low` and `high`, their centres a share `edge` of the range from its
    ends or more, and no farther `apart` than so many of their widths: between, a narrow one would be overlooked."""
    span, out = high - low, list[dict[str, float]]()
    for width in WIDTHS:
        count = max(FEWEST, 1 + math.ceil((1 - 2 * edge) / (apart * width)))
        places = np.linspace(edge, 1 - edge, count).tolist()
        out += [{"centre": low + span * place, "width": span * width} for place in places]
    return out
