"""Parameters of a simulated joint by output error, many fits in one batch of lanes.

Output error after Ljung (1999, ch. 7): the recorded drive in, the simulated position out, nothing filtered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .free import swings_free
from .free_fit import Task, descend, linearised, profiled, without_starts
from .simulation import INDEX, PARAMETERS, Swing, errors, usual_range, vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fitted:
    """A task's result: theta (len(PARAMETERS),), its mean squared error on its stretches, evaluations used, parameters
    free."""

    theta: Array
    cost: float
    evaluations: int
    free: int


FEW_LANES = 1000
WAVES = 2.0  # of a ripple, over the range
THINNED = 3
LOW = {"inertia": 1e-9, "stribeck_speed": 1e-3, "stribeck_exponent": 0.3, "asymmetry": -np.inf, "damping_asymmetry": -np.inf, "offset": -np.inf,
       "lateral": -np.inf, "stiffness": -np.inf, "supply": 0.0, "delay": 0.0, "ripple_sine": -np.inf, "ripple_cosine": -np.inf, "ripple_period": 1e-3, "load_speed": 0.0}  # fmt: skip


def typical(swing: Swing) -> Array:
    """A natural size of every parameter: the unit in which steps are taken and differences made."""
    i = swing.initial
    weight = max(abs(swing.sine), abs(swing.cosine), i.get("coulomb", 0.0), 1e-12)
    speed = 3.0 * usual_range(swing)
    dry = max(i.get("coulomb", 0.0), 1e-4 * weight)
    wet = max(i.get("damping", 0.0), 0.1 * dry / speed)
    share = dry / weight
    size = {"inertia": i["inertia"], "gain": i.get("gain", 1.0), "back_emf": i.get("back_emf", 1.0), "damping": wet,
            "coulomb": dry, "static_excess": dry, "stribeck_speed": 0.1 * speed, "stribeck_exponent": 0.5, "motor_squared": share / weight,
            "external_squared": share / weight, "load_speed": wet / weight, "asymmetry": dry, "drag": wet / speed,
            "damping_asymmetry": wet, "offset": dry, "lateral": dry, "ripple_sine": dry, "ripple_cosine": dry, "ripple_period": 0.01 * usual_range(swing), "stiffness": max(dry, 0.05 * weight),
            "sag": 0.1 / weight, "supply": 0.5, "delay": 0.01, "reach": 1e-3 * usual_range(swing)}  # fmt: skip
    size = {k: v or 1.0 for k, v in size.items()} | {
        k: share for k in PARAMETERS if k.startswith("load_") and k not in size
    }
    return vector(size)


def lowest(swing: Swing) -> Array:
    """Lower bound of every parameter. What happens within a reach that the encoder cannot resolve is no give."""
    return np.array([{**LOW, "reach": swing.resolution}.get(name, 0.0) for name in PARAMETERS])


def highest(swing: Swing) -> Array:
    """Upper bound of every parameter: a drive passes on all of its supply at most, and what does not come again and
    again within the range is no ripple."""
    high = {"supply": 1.0, "ripple_period": usual_range(swing) / WAVES}
    return np.array([high.get(name, np.inf) for name in PARAMETERS])


def fit_together(swing: Swing, tasks: Sequence[Task], iterations: int = 14) -> list[Fitted]:
    """Levenberg-Marquardt on all tasks at once: every Jacobian column of every task is a lane of one simulation. Where
    the lanes are few, they cost little: then the Jacobian of every damped step is simulated with the step itself."""
    unit = typical(swing)
    low, high = lowest(swing), highest(swing)
    size = [sum(swing.lanes[i].used.sum() for i in t.stretches) for t in tasks]
    if swings_free(swing):
        wide = [t.profiles for t in tasks]
        plain, bent = (iter(run(swing, [t for t, w in zip(tasks, wide, strict=True) if w == w_], unit, low, iterations))
                       for w_, run in ((False, descend), (True, profiled)))  # fmt: skip
        ends = [next(bent if w else plain) for w in wide]
        return [
            Fitted(d.theta, d.cost / max(s, 1), d.evaluations, len(t.free))
            for t, d, s in zip(tasks, ends, size, strict=True)
        ]
    theta = [t.start.copy() for t in tasks]
    damping = np.full(len(tasks), 1e-2)
    cost = np.full(len(tasks), np.inf)
    count = np.zeros(len(tasks), int)
    active = np.ones(len(tasks), bool)
    known: list = [None] * len(tasks)  # residual and Jacobian of each task at its theta
    for _ in range(iterations):
        todo = [k for k in range(len(tasks)) if active[k]]
        if not todo:
            break
        blind = [k for k in todo if known[k] is None]
        for k, (r, jac, _) in zip(
            blind, _jacobians(swing, [(tasks[k], theta[k]) for k in blind], unit, low), strict=True
        ):
            known[k] = r, jac
            count[k] += len(tasks[k].free) + 1
        for k in todo:
            cost[k] = float(known[k][0] @ known[k][0])
        trials = {k: [_moved(tasks[k], theta[k], *known[k], damping[k] * f, unit, low, high) for f in (0.1, 1.0, 10.0, 100.0)]
                  for k in todo}  # fmt: skip
        pairs = [(tasks[k], t) for k in todo for t in trials[k]]
        ahead = sum(len(t.stretches) * (len(t.free) + 1) for t, _ in pairs) < FEW_LANES
        tried = _jacobians(swing, pairs, unit, low) if ahead else [(None, None, c) for c in _costs(swing, pairs)]
        for n, k in enumerate(todo):
            mine = [c for _, _, c in tried[4 * n : 4 * n + 4]]
            count[k] += 4 * (len(tasks[k].free) + 1) if ahead else 4
            best = int(np.argmin(mine))
            if mine[best] < cost[k]:
                active[k] = mine[best] < cost[k] * (1 - 1e-4) or damping[k] < 1e-6
                theta[k], cost[k] = trials[k][best], mine[best]
                known[k] = tried[4 * n + best][:2] if ahead else None
                damping[k] = np.clip(damping[k] * (0.1, 1.0, 10.0, 100.0)[best], 1e-7, 1e7)
            else:
                damping[k] *= 300.0
                active[k] = damping[k] < 1e6
    return [
        Fitted(th, c / max(s, 1), int(n), len(t.free))
        for t, th, c, s, n in zip(tasks, theta, cost, size, count, strict=True)
    ]


def _moved(
    task: Task, theta: Array, r: Array, jac: Array, damping: float, unit: Array, low: Array, high: Array
) -> Array:
    """Parameters after a damped step; those that it would push through a bound are held there and the step redone."""
    free = np.array([INDEX[n] for n in task.free])
    gram, slope = jac.T @ jac, jac.T @ r
    gram = gram + damping * np.diag(np.diag(gram) + 1e-9 * np.trace(gram) / len(free) + 1e-12)
    room = (low[free] - theta[free]) / unit[free]
    held = np.zeros(len(free), bool)
    step = np.zeros(len(free))
    for _ in range(len(free)):
        step = np.where(held, room, 0.0)
        loose = ~held
        right = -slope[loose] - gram[np.ix_(loose, held)] @ step[held]
        step[loose] = np.linalg.solve(gram[np.ix_(loose, loose)], right) if loose.any() else 0.0
        beyond = loose & (step < room - 1e-12)
        if not beyond.any():
            break
        held |= beyond
    out = theta.copy()
    out[free] = np.maximum(theta[free] + np.clip(step, -5, 5) * unit[free], low[free])
    out[free] = np.minimum(out[free], high[free])
    return out


def _difference(name: str) -> float:
    """Step of a finite difference in units: phase is sensitive to inertia, and stiction makes small steps blind."""
    return 1e-4 if name == "inertia" else 3e-3


def _runs(pairs: Sequence[tuple[Task, Array]]) -> tuple[Array, Array]:
    theta = np.concatenate([np.repeat(t[None], len(task.stretches), 0) for task, t in pairs])
    return theta, np.concatenate([np.array(task.stretches) for task, _ in pairs])


def _costs(swing: Swing, pairs: Sequence[tuple[Task, Array]]) -> Array:
    theta, lanes = _runs(pairs)
    square = np.sum(errors(swing, theta, lanes) ** 2, 0)
    edges = np.cumsum([0] + [len(task.stretches) for task, _ in pairs])
    return np.array([square[a:b].sum() for a, b in pairwise(edges)])


def jacobian(swing: Swing, task: Task, theta: Array) -> tuple[Array, Array]:
    """Residuals (n,) of a task at theta, stretch after stretch, and their slopes (n, free) in units of `typical`."""
    if swings_free(swing):
        own = np.array([swing.lanes[i].start for i in task.stretches])
        return without_starts(*linearised(swing, [(task.free, task.stretches, theta, own)], typical(swing))[0])[:2]
    low = lowest(swing)
    return _jacobians(swing, [(task, theta)], typical(swing), low)[0][:2]


def _jacobians(
    swing: Swing, pairs: Sequence[tuple[Task, Array]], unit: Array, low: Array
) -> list[tuple[Array, Array, float]]:
    """Residuals (n,), every third sample, and Jacobian (n, free) in units of `unit`, forward differences; and the sum
    of all squares."""
    varied = []
    if not pairs:
        return []
    for task, theta in pairs:
        varied.append((task, theta))
        for name in task.free:
            i = INDEX[name]
            moved = theta.copy()
            moved[i] += _difference(name) * unit[i]
            varied.append((task, moved))
    theta, lanes = _runs(varied)
    residual = errors(swing, theta, lanes)
    out, at = [], 0
    for task, _ in pairs:
        n = len(task.stretches)
        r = residual[::THINNED, at : at + n].T.ravel() * np.sqrt(THINNED)
        columns = []
        for j, name in enumerate(task.free):
            b = at + n * (j + 1)
            columns.append((residual[::THINNED, b : b + n].T.ravel() * np.sqrt(THINNED) - r) / _difference(name))
        out.append((r, np.stack(columns, 1), float(np.sum(residual[:, at : at + n] ** 2))))
        at += n * (len(task.free) + 1)
    return out
