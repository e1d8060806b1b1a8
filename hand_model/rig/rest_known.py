"""Whether the effects that motion shows say as well what holds a joint that stands: then its rests may be asked,
too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .balance import Rows
from .declared import DeclaredFit
from .name.problem import Term, delay_of
from .name.settled import at_loads
from .states import later, low_pass

Array = NDArray[np.float64]
# times the error in motion: beside a tenth of the samples are at rest or next to it, and what these then add is as much
# as all others leave
MOST = 3.0
LEAST_SAMPLES = 20  # of a filtered balance, on both sides
LEAST_REST = 0.02  # of the samples: rests that are fewer say nothing that motion does not


def known_at_rest(fit: DeclaredFit, terms: Sequence[Term], theta: Array) -> tuple[str, ...]:
    """Joints that stand at times, but where parameters theta (P + J,) of the declared columns and of the terms leave
    hardly more of the effort then than while they move. Dry friction is anything within its bounds there; one that
    turns round over a distance is known."""
    known, at = [], at_loads(fit, terms, theta)
    for joint in dict.fromkeys(r.joint for r in fit.rows):
        sides = [_apart(r, _left(at, r, terms)) for r in at.rows if r.joint == joint and len(r.weight)]
        still, moving = (np.concatenate([s[k] for s in sides]) if sides else np.zeros(0) for k in (0, 1))
        least = max(LEAST_SAMPLES, LEAST_REST * (len(still) + len(moving)))
        if min(len(still), len(moving)) >= least and np.mean(still**2) <= MOST**2 * np.mean(moving**2):
            known.append(joint)
    return tuple(known)


def _left(at: DeclaredFit, row: Rows, terms: Sequence[Term]) -> Array:
    """What is left of a row's effort (m,), rests as well, by a fit and the terms that it has beside it."""
    asked = row.full_columns @ at.theta + at.beside.get((row.trial, row.joint), 0.0)
    delay = delay_of(row, terms)
    asked = later(row.time_s, asked, delay) if delay else asked
    return low_pass(row.extra["effort"] - asked, row.rate_hz, row.cutoff_hz)[:: row.step]


def _apart(row: Rows, left: Array) -> tuple[Array, Array]:
    """What is left at rest and in full motion, without the ends of the recording."""
    weight = row.weight[:: row.step]
    away = np.minimum(row.time_s - row.time_s[0], row.time_s[-1] - row.time_s)[:: row.step] > 1.0 / row.cutoff_hz
    return left[(weight == 0) & away], left[row.moving & (weight == 1) & away]
