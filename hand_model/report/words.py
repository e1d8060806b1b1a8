"""Figures and lists as they stand in a sentence or a cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def number(value: float | None, digits: int = 2) -> str:
    """A number with so many decimals; a dash where there is none."""
    if value is None or not np.isfinite(value):
        return "–"
    return f"{round(float(value), digits) + 0.0:.{digits}f}"  # + 0.0: no negative zero


def listed(items: Sequence[str], most: int = 6) -> str:
    """`a`, `a and b`, `a, b and c`, `a, b, c and 4 more`."""
    words = list(items[:most]) + ([f"{len(items) - most} more"] if len(items) > most else [])
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + f" and {words[-1]}" if words else "none"


def span(values: Sequence[float], digits: int = 2, unit: str = "") -> str:
    """`0.38 to 1.30 deg`, or one figure where both ends read the same."""
    known = [v for v in values if np.isfinite(v)]
    low, high = number(min(known, default=np.nan), digits), number(max(known, default=np.nan), digits)
    return (low if low == high else f"{low} to {high}") + (f" {unit}" if unit else "")


def count(n: int, one: str, many: str | None = None) -> str:
    """`1 trial`, `3 trials`."""
    return f"{n} {one if n == 1 else many or one + 's'}"
