"""Where the stretches of a free swing start: angle and speed that its first period asks for, and what they leave open.

In multiple shooting (Bock 1981) the starts are unknowns too. A speed differentiated from an encoder is wrong by more
than all that friction does in ten periods; over a single one friction does so little that any fit of it will do. But
the start that suits one law does not suit another (an encoder's zero that is off by a few milliradians moves it by as
much): beside that of the declared model the true law would look worse. So laws are fitted to what no small change of
the start takes up, and what is kept out is predicted from the start that each law's own first period asks for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .free import free_errors, swings_free
from .simulation import Lane, Swing, errors, instants

Array = NDArray[np.float64]
STEPS = 3  # of Gauss and Newton: the motion is smooth in its start
LEAST_STEPS = 8


def started(swing: Swing, theta: Array) -> Swing:
    """The swing with the start of every stretch fitted to its first period at parameters theta, (len(PARAMETERS),) or
    of each stretch (stretches, len(PARAMETERS)), and known; a driven one as it is, for there friction counts within a
    period."""
    if swing.driven:
        return swing
    lanes = [replace(lane, give=None) for lane in swing.lanes]
    for _ in range(STEPS):
        short = [_first(swing, lane) for lane in lanes]
        left, slopes = _slopes(swing, short, theta)
        lanes = [_moved(lane, -np.linalg.lstsq(slopes[:, i], left[:, i])[0]) for i, lane in enumerate(lanes)]
    return replace(swing, lanes=tuple(lanes))


def freed(swing: Swing, theta: Array) -> Swing:
    """The swing with the start of every stretch free to move a little from where `started` puts it; a driven one as it
    is."""
    if swing.driven:
        return swing
    swing = started(swing, theta)
    if swings_free(swing):  # their fits move the starts
        return swing
    slopes = _slopes(swing, swing.lanes, theta)[1]
    give = [np.linalg.qr(slopes[: len(lane.position), i])[0] for i, lane in enumerate(swing.lanes)]
    return replace(swing, lanes=tuple(replace(lane, give=g) for lane, g in zip(swing.lanes, give, strict=True)))


def started_each(swing: Swing, thetas: Sequence[Array]) -> tuple[Swing, list[tuple[int, ...]]]:
    """One swing with the stretches of `started` for each of thetas side by side, and which of them each has to fit."""
    train, size = [int(i) for i in swing.train()], len(swing.lanes)
    if swing.driven:
        return swing, [tuple(train)] * len(thetas)
    lanes = tuple(lane for theta in thetas for lane in started(swing, theta).lanes)
    return replace(swing, lanes=lanes), [tuple(k * size + i for i in train) for k in range(len(thetas))]


def _first(swing: Swing, lane: Lane) -> Lane:
    """The first period of a stretch."""
    times = instants(swing, lane)
    n = max(LEAST_STEPS, int(np.searchsorted(times, swing.period_s)))
    return replace(lane, position=lane.position[:n], drive=lane.drive[:n], supply=lane.supply[:n], used=lane.used[:n],
                   time_s=times[:n])  # fmt: skip


def _slopes(swing: Swing, lanes: Sequence[Lane], theta: Array) -> tuple[Array, Array]:
    """Residuals (steps, lanes) at parameters theta, and their slopes (steps, lanes, 2) by angle and speed of the
    start."""
    sizes = 1e-3 * np.array([1.0, 2 * np.pi / swing.period_s])
    moved = [_errors(swing, [_moved(lane, sizes * at) for lane in lanes], theta) for at in ((0, 0), (1, 0), (0, 1))]
    return moved[0], np.stack([(m - moved[0]) / s for m, s in zip(moved[1:], sizes, strict=True)], -1)


def _errors(swing: Swing, lanes: Sequence[Lane], theta: Array) -> Array:
    run = free_errors if swings_free(swing) else errors
    return run(
        replace(swing, lanes=tuple(lanes)), np.broadcast_to(theta, (len(lanes), theta.shape[-1])), np.arange(len(lanes))
    )


def _moved(lane: Lane, by: Array) -> Lane:
    return replace(lane, start=(lane.start[0] + float(by[0]), lane.start[1] + float(by[1])))
