"""Motors of a hand that is known: whether a session's are of that kind, and what their preload would be.

The twelve motors of six recordings of a BeBionic that are published with their answers: medians, each with a deviation of
a tenth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

MEDIAN = {"viscous": 0.144, "coulomb": 33.9, "spring": 0.230}  # raw, %, s; slow motion tells nothing of an inertia
PRELOAD, PRELOADS = 9.4, 0.17  # raw; standard deviation of a preload over it, with room for hands that are less alike
SPREAD = 0.12  # standard deviation of the others' logarithms: as they are, and a little for another laboratory's hand
MOTORS = 12
ANY = np.log(3.0)  # a motor of another kind may have any figure within this factor of these, or beyond


def kinship(motors: Sequence[Mapping[str, float]]) -> float:
    """Probability that motors are of the known kind, from their friction and springs (declared coefficients by name, in
    raw, % and s); as likely as not before. Zero where none has all of them."""
    from scipy.stats import t

    apart = _apart(motors)
    if not len(apart):
        return 0.0
    log_odds = float(np.sum(t.logpdf(apart / SPREAD, 4) - np.log(SPREAD) + np.log(2 * ANY)))
    return float(1 / (1 + np.exp(-np.clip(log_odds, -50, 50))))


def _apart(motors: Sequence[Mapping[str, float]]) -> NDArray[np.float64]:
    """Logarithms (n, 3) of each motor's friction and spring over the known ones, of those that have all of them."""
    found = [[m[name] for name in MEDIAN] for m in motors if all(m.get(name, 0.0) > 0 for name in MEDIAN)]
    return np.log(np.array(found).reshape(-1, len(MEDIAN)) / np.array(list(MEDIAN.values())))


def preload_by_chance(
    own: float, error: float, others: Sequence[float] = (), motors: Sequence[Mapping[str, float]] = ()
) -> float:
    """Probability that a motor of the known kind has a preload [raw] as far from theirs as the nearer end of its
    standard error: as so few motors tell a mean and a deviation (Student's t).

    others: preloads of the same hand's other motors, which say how alike these are; motors: declared coefficients of all
    of them, which say it too: motors that are unlike the known ones in friction and spring are so in preload.
    """
    from scipy.stats import t

    apart = max(abs(own - PRELOAD) - 2 * error, 0.0) / PRELOAD
    unlike = _apart(motors) / SPREAD
    squares = PRELOADS**2 * (MOTORS + float(np.sum(unlike**2))) + sum((other / PRELOAD - 1) ** 2 for other in others)
    known = MOTORS + unlike.size + len(others)
    return float(2 * t.sf(apart / np.sqrt(squares / known), known - 1))
