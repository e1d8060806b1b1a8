"""Recorded moves simulated from their commands, and what is left of the recordings in units of what these are known
to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .batch import Moves
from .drive import STEP_S, TICK_S, Run, run
from .moves import MoveData

Array = NDArray[np.float64]

# what the instant of a jump is known to, half a step at its end and one at its begin: a current that jumps within it
# says little
REACH_S = 1.5 * TICK_S


def as_batch(data: Sequence[MoveData], own: Array, repeat: int, calm: bool = True) -> Moves:
    """The moves as they are simulated, `repeat` of each side by side; own: (moves * repeat, 4), see MoveData. calm: in
    long steps where the recorded drive cruised or rested."""

    def tile(x: Sequence[float]) -> Array:
        return np.repeat(np.asarray(x, float), repeat)

    return Moves(
        own[:, 0],
        tile([m.origin for m in data]),
        tile([m.target for m in data]),
        own[:, 2],
        tile([m.limit for m in data]),
        own[:, 1],
        own[:, 3],
        tile([m.time_s[-1] for m in data]),
        tile([m.velocity for m in data]),
        *((tile(x) for x in zip(*(m.calm_s for m in data), strict=True)) if calm else ()),
    )


def simulate_moves(
    data: Sequence[MoveData],
    q: Mapping[str, float],
    own: Array,
    controller: str,
    step_s: float = STEP_S,
    calm: bool = False,
) -> list[Array]:
    """Simulated position [%] and current [raw], (n, 2) per move; calm: in long steps while the recorded drive cruised
    or rested."""
    return by_move(sampled(run_moves(data, q, own, controller, step_s, calm), data, (1.0, 1.0))[0], data)


def simulate_states(
    data: Sequence[MoveData], q: Mapping[str, float], own: Array, controller: str, half_s: float
) -> list[Array]:
    """Simulated position [%], velocity and acceleration [% per second], (n, 3) per move, by differences over half_s [s]
    to either side."""
    longer = [dataclasses.replace(m, time_s=m.time_s + half_s) for m in data]
    found = run_moves(longer, q, own, controller, STEP_S, calm=False)
    before, at, after = (found.sample([m.time_s + x for m in data])[0][:, 0] for x in (-half_s, 0.0, half_s))
    return by_move(np.stack([at, (after - before) / (2 * half_s), (after - 2 * at + before) / half_s**2], axis=1), data)


def whitened(
    data: Sequence[MoveData],
    q: Mapping[str, float],
    own: Array,
    sigma: tuple[float, float],
    controller: str,
    step_s: float = STEP_S,
) -> list[Array]:
    """Recorded less simulated position and current in units of what they are known to, (n, 2) per move."""
    y, weight = sampled(run_moves(data, q, own, controller, step_s, False), data, sigma)
    return by_move((recorded(data) - y) * weight, data)


def run_moves(
    data: Sequence[MoveData], q: Mapping[str, float], own: Array, controller: str, step_s: float, calm: bool = True
) -> Run:
    """The moves simulated; own: (moves, 4), see MoveData; calm: in long steps while the recorded drive cruised or
    rested, which is where the simulated one does only if it is near."""
    return run(as_batch(data, own, 1, calm), {k: np.full(len(data), v) for k, v in q.items()}, step_s, controller)


def recorded(data: Sequence[MoveData]) -> Array:
    """Position and current (N, 2) of all moves, one after the other."""
    return np.stack([np.concatenate([m.position for m in data]), np.concatenate([m.current for m in data])], axis=1)


def by_move(rows: Array, data: Sequence[MoveData]) -> list[Array]:
    """Rows (N, ...) of all moves by move."""
    return np.split(rows, np.cumsum([len(m.time_s) for m in data])[:-1])


def sampled(found: Run, data: Sequence[MoveData], sigma: tuple[float, float], width: int = 1) -> tuple[Array, Array]:
    """Position and current (N, 2) of simulated moves, the first of every `width`, and the inverse standard deviations
    to which they are known, (N, 2).

    The current's holds half its change from REACH_S before to REACH_S after the sample: what the controller's steps
    leave open.
    """
    found = dataclasses.replace(found, column=found.column[::width])
    times = [m.time_s for m in data]
    p, u = (y[:, 0] for y in found.sample(times))
    before, after = (found.sample([t + x for t in times])[1][:, 0] for x in (-REACH_S, REACH_S))
    return np.c_[p, u], np.c_[np.full(len(p), 1 / sigma[0]), 1 / np.hypot(sigma[1], 0.5 * (after - before))]
