"""Where the stretches of a free swing start: angle and speed that its first period asks for.

In multiple shooting (Bock 1981) the starts are unknowns too. A speed differentiated from an encoder is wrong by more than
all that friction does in ten periods; over a single one friction does so little that any fit of it will do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .swing import Lane, Swing, errors

Array = NDArray[np.float64]
STEPS = 3  # of Gauss and Newton: the motion is smooth in its start
LEAST_STEPS = 8


def started(swing: Swing, theta: Array, period_s: float) -> Swing:
    """The swing with the start of every stretch fitted to its first period_s [s] at parameters theta (len(PARAMETERS),); a driven
    one as it is, for there friction counts within a period."""
    if swing.driven:
        return swing
    steps, lanes = max(LEAST_STEPS, round(period_s / swing.step_s)), swing.lanes
    for _ in range(STEPS):
        short = [replace(lane, position=lane.position[:steps], drive=lane.drive[:steps], supply=lane.supply[:steps],
                         used=lane.used[:steps]) for lane in lanes]  # fmt: skip
        sizes = 1e-3 * np.array([1.0, 2 * np.pi / period_s])
        moved = [_errors(swing, [_moved(lane, sizes * at) for lane in short], theta) for at in ((0, 0), (1, 0), (0, 1))]
        slopes = np.stack([(m - moved[0]) / s for m, s in zip(moved[1:], sizes, strict=True)], -1)
        lanes = tuple(_moved(lane, -np.linalg.lstsq(slopes[:, i], moved[0][:, i])[0]) for i, lane in enumerate(lanes))
    return replace(swing, lanes=lanes)


def _errors(swing: Swing, lanes: list[Lane], theta: Array) -> Array:
    return errors(replace(swing, lanes=tuple(lanes)), np.repeat(theta[None], len(lanes), 0), np.arange(len(lanes)))


def _moved(lane: Lane, by: Array) -> Lane:
    return replace(lane, start=(lane.start[0] + float(by[0]), lane.start[1] + float(by[1])))
