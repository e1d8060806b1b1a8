"""Steps in which an encoder reads: how far its readings stand on a ladder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...session import Log

Array = NDArray[np.float64]

FINEST, COARSEST, TRIED = 3e-3, 0.03, 600  # of the range: steps that are looked for, and how many
# of readings that stand on a ladder with errors of a fifth of its step; a smooth density has a tenth
COHERENT = 0.4
RESTS = 3.0  # times as often as usual, at most, a reading counts: a drive rests where it is told
FEWEST, DIFFERENT = 200, 30  # readings, and such as differ: a copy of the setpoint has fewer


def encoder_step(logs: Sequence[Log]) -> float:
    """Step of an encoder's readings as a share of their range, zero where it is finer than three thousandths: by the
    resultant of their phases (Rayleigh's test), the coarsest step of which the others are fractions."""
    values = np.concatenate([log.column("position") for log in logs])
    values = values[np.isfinite(values)]
    if len(values) < FEWEST or np.ptp(values) == 0:
        return 0.0
    read, often = np.unique(values, return_counts=True)
    if len(read) < DIFFERENT:
        return 0.0
    weight = np.minimum(often, RESTS * np.median(often))
    steps = np.geomspace(COARSEST, FINEST, TRIED)
    place = (read - read[0]) / np.ptp(read)
    resultant = np.abs(np.exp(2j * np.pi * place / steps[:, None]) @ weight) / weight.sum()
    found = np.flatnonzero(resultant > COHERENT)
    if not len(found):
        return 0.0
    near = found[steps[found] > 0.9 * steps[found[0]]]  # the first peak's own
    return float(steps[near[np.argmax(resultant[near])]])


def coarse(steps: Mapping[str, float]) -> dict[str, float]:
    """Of the drives (name -> step of its encoder, share of its range) those that read in steps while another of the hand
    reads finely: what all do is how such hands are built."""
    return {a: s for a, s in steps.items() if s > 0 and min(steps.values()) == 0}
