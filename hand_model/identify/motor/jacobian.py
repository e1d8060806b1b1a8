"""Whitened residuals and their Jacobian, by finite differences of the simulation; all differences in one batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .drive import run
from .memory import Predictors, freed
from .moves import MoveData
from .residuals import as_batch, by_move, recorded, run_moves, sampled

Array = NDArray[np.float64]

COARSE_S = 5e-3  # of simulations that only need to be near
# differences wide enough that the instants at which a drive sticks or a deadband sets in, held to one step, average out
STEP_SHARE, OWN_STEP = 2e-2, (1e-3, 1e-2, 1e-3, 0.5)


def _steps(values: Mapping[str, float], names: Sequence[str]) -> Array:
    """Widths (k,) of the differences by the named parameters."""
    floor = {
        "preload": 1.0,
        "viscous": 0.02,
        "damping": 0.1,
        "bristle": 0.01,
        "rise": 0.01,
        "fall": 0.01,
        "deadband": 0.1,
        "delay": 0.01,
        "lead": 0.01,
        "lag": 0.05,
        "stiffness": 0.02,
        "coulomb": 1.0,
    }
    return np.array([STEP_SHARE * max(abs(values[n]), floor.get(n, 0.0)) for n in names])


def linearise(
    data: Sequence[MoveData],
    q: Mapping[str, float],
    names: Sequence[str],
    own: Array,
    sigma: tuple[float, float],
    controller: str,
    step_s: float,
    width_share: float = 1.0,
    memory: tuple[Predictors, ...] = (),
) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
    """Whitened residuals (2n,) at steps of step_s [s], shared (2n, k) and own (2n, 4) Jacobian of every move; weights
    (n, 2).

    The Jacobian of a profile generator is that of the coarse simulation: a derivative that is off by a few percent
    changes the way to the optimum, not where the residuals have no part of it left. Where a deadband sets in needs the
    fine one: with the coarse, cascades end far enough from the optimum to miss their intervals.
    """
    apart = [n for n in names if n != "speed_full"]
    width = len(apart) + 1 + len(OWN_STEP)
    steps = width_share * np.append(_steps(q, apart), OWN_STEP)
    values = {n: np.full(width, v) for n, v in q.items()}
    for i, n in enumerate(apart):
        values[n] = values[n].copy()
        values[n][1 + i] += steps[i]
    values = {n: np.tile(v, len(data)) for n, v in values.items()}
    owns = np.repeat(own, width, axis=0)
    for i in range(own.shape[1]):
        owns[len(apart) + 1 + i :: width, i] += steps[len(apart) + i]
    coarse_s = step_s if controller == "cascade" else COARSE_S
    varied = run(as_batch(data, owns, width), values, coarse_s, controller, width)
    y, weight = (
        sampled(run_moves(data, q, own, controller, step_s), data, sigma)
        if step_s < coarse_s
        else sampled(varied, data, sigma, width)
    )
    residual = by_move((recorded(data) - y) * weight, data)
    with np.errstate(over="ignore", invalid="ignore"):  # drives that ran away
        varied_y = varied.sample([m.time_s for m in data], width)
        derivative = (
            np.stack([(x[:, 1:] - x[:, :1]) * w[:, None] for x, w in zip(varied_y, weight.T, strict=True)], axis=1)
            / steps
        )
    derivative = np.nan_to_num(derivative, posinf=0.0, neginf=0.0)  # (N, 2, width - 1)
    both = [freed(d.transpose(1, 0, 2).reshape(-1, width - 1), memory) for d in by_move(derivative, data)]
    shared = [_with_speed(d, x, q, names, apart) for d, x in zip(both, own, strict=True)]
    return (
        [freed(e.T.ravel(), memory) for e in residual],
        shared,
        [d[:, len(apart) :] for d in both],
        by_move(weight, data),
    )


def _with_speed(
    derivative: Array, own: Array, q: Mapping[str, float], names: Sequence[str], apart: Sequence[str]
) -> Array:
    """Derivatives (2n, k) by `names`, of a move's (2n, k') by those `apart` from the full speed and by its own unknowns
    (4,).

    A move's top speed is full speed times its own share, its slew full speed over the time to reach it. All moves' own
    shares make up for full speed but for what is known of them: differences of their own for both, wide as they are,
    would hide this way of going wrong.
    """
    if "speed_full" not in names:
        return derivative[:, : len(apart)]
    by = dict(zip(apart, derivative.T, strict=False))
    speed = (own[2] * derivative[:, len(apart) + 2] - sum(q[n] * by[n] for n in ("rise", "fall") if n in by)) / q[
        "speed_full"
    ]
    return np.column_stack([speed if n == "speed_full" else by[n] for n in names])
