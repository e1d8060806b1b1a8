"""The misfit: squares of whitened residuals, of what the moves' own unknowns are off their measured values, and of the
priors (maximum a posteriori)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .drive import TICK_S, run
from .memory import Predictors, freed
from .moves import MoveData
from .residuals import as_batch, by_move, recorded

Array = NDArray[np.float64]

# a loop that holds its value for a step of 0 to 2 ms acts half a step late, and half a step after the value that is
# logged; a generator that sums up its reference step by step has the velocity up to half a step behind. Without this
# the motion alone, which tells inertia less damping times delay, lets the two run off together
PRIOR = {"lead": (0.5 * TICK_S, 0.5 * TICK_S), "delay": (0.5 * TICK_S, TICK_S), "lag": (0.25 * TICK_S, 0.75 * TICK_S)}


def misfit(residual: list[Array], data: Sequence[MoveData], own: Array, q: Mapping[str, float]) -> float:
    """Sum of squares of whitened residuals, of what the moves' own unknowns are off their measured values, and of the
    priors."""
    total = sum(held(q, n) for n in PRIOR)
    total += sum(
        float(e @ e) + float(np.sum(((m.own - x) / m.own_sd) ** 2)) for m, e, x in zip(data, residual, own, strict=True)
    )
    return float(total) if np.isfinite(total) else np.inf


def held(q: Mapping[str, float], name: str) -> float:
    """What the prior of a parameter adds to the misfit."""
    if name not in q or name not in PRIOR:
        return 0.0
    mean, sd = PRIOR[name]
    return ((q[name] - mean) / sd) ** 2


def misfits(
    data: Sequence[MoveData],
    qs: Sequence[Mapping[str, float]],
    owns: Sequence[Array],
    weights: list[Array],
    controller: str,
    step_s: float,
    memory: tuple[Predictors, ...] = (),
) -> tuple[Array, int, list[Array]]:
    """Misfit of several candidates (their shared values and own unknowns) at fixed weights, in one batch of
    simulations; the best, its residuals."""
    width = len(qs)
    values = {n: np.tile([q[n] for q in qs], len(data)) for n in qs[0]}
    found = run(
        as_batch(data, np.stack(owns, axis=1).reshape(len(data) * width, -1), width), values, step_s, controller, width
    )
    y = found.sample([m.time_s for m in data], width)
    error = np.stack(
        [(r[:, None] - x) * w[:, None] for r, x, w in zip(recorded(data).T, y, np.concatenate(weights).T, strict=True)],
        axis=1,
    )
    residual = [freed(e.transpose(1, 0, 2).reshape(-1, width), memory) for e in by_move(error, data)]
    costs = np.array([misfit([e[:, j] for e in residual], data, owns[j], qs[j]) for j in range(width)])
    best = int(np.argmin(costs))
    return costs, best, [e[:, best] for e in residual]
