"""Parameters of free swings by output error, with the start of every stretch unknown too.

A speed differentiated from an encoder is wrong by more than all that friction does in ten periods, and the start that
suits one law does not suit another. So the starts are unknowns of the fit, eliminated stretch by stretch in every step
(Gauss and Newton on what they leave: variable projection, Golub & Pereyra 1973, Kaufman 1975).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .free import free_errors
from .simulation import INDEX, Swing, usual_speed

Array = NDArray[np.float64]
DAMPINGS = (0.01, 1.0, 100.0)  # tried at once, times the last one that helped
BENT, UNDAMPED = ("stribeck_speed",), 1e-6
RANGE, GRID, INNER = (0.03, 1.2), 8, 5  # of the usual speed; how many, iterations at each
HALVINGS, PARABOLAS = 3, 2
SMALL = 1e-4  # of a difference, in units of the parameter, of rad and of the rate of small swings
SMALL_INERTIA = 1e-6  # a phase adds up over all swings
FARTHEST_STEP = 5.0  # units
SETTLED = 1e-7  # of the squared error: less is no progress


@dataclass(frozen=True)
class Task:
    """One fit among many that run together. free: names; start: all parameters; stretches: which may be fitted; wide:
    whether a low speed of friction is looked for far from its start too (of free swings)."""

    free: tuple[str, ...]
    start: Array
    stretches: tuple[int, ...]
    wide: bool = False

    @property
    def profiles(self) -> bool:
        """Whether it is one for `profiled`."""
        return self.wide and not set(BENT).isdisjoint(self.free)


@dataclass
class Descent:
    """Where one fit is. theta (len(PARAMETERS),), starts (stretches, 2); left (stretches, n): residuals; slopes
    (stretches, n, free) by parameters in their units; by_start (stretches, n, 2)."""

    theta: Array
    starts: Array
    damping: float = 1e-2
    cost: float = np.inf
    evaluations: int = 0
    active: bool = True
    left: Array | None = None
    slopes: Array | None = None
    by_start: Array | None = None


def linearised(
    swing: Swing, tasks: Sequence[tuple[tuple[str, ...], tuple[int, ...], Array, Array]], unit: Array
) -> list[tuple[Array, Array, Array]]:
    """left, slopes and by_start (see `Descent`) of tasks (free, stretches, theta, starts)."""
    rate, thetas, lanes, starts = 2 * np.pi / swing.period_s, [], [], []
    for free, stretches, theta, start in tasks:
        moved = [start, start + [SMALL, 0.0], start + [0.0, SMALL * rate]]
        for s in moved:
            thetas, lanes, starts = [*thetas, theta], [*lanes, stretches], [*starts, s]
        for name in free:
            other = theta.copy()
            other[INDEX[name]] += _difference(name) * unit[INDEX[name]]
            thetas, lanes, starts = [*thetas, other], [*lanes, stretches], [*starts, start]
    left = _errors(swing, thetas, lanes, starts)
    out, at = [], 0
    for free, _, _, _ in tasks:
        base, *by = left[at : at + 3 + len(free)]
        by_start = np.stack([(by[0] - base) / SMALL, (by[1] - base) / (SMALL * rate)], -1)
        slopes = [(x - base) / _difference(n) for n, x in zip(free, by[2:], strict=True)]
        out.append((base, np.stack(slopes, -1), by_start))
        at += 3 + len(free)
    return out


def _difference(name: str) -> float:
    return SMALL_INERTIA if name == "inertia" else SMALL


def _errors(swing: Swing, thetas: Sequence[Array], lanes: Sequence[tuple[int, ...]], starts: Sequence[Array]) -> list:
    """Residuals (stretches, n) of every set of stretches under its law from its starts."""
    run = np.concatenate([np.array(some) for some in lanes])
    theta = np.concatenate([np.repeat(t[None], len(some), 0) for t, some in zip(thetas, lanes, strict=True)])
    out = free_errors(swing, theta, run, np.concatenate(starts)).T
    return np.split(out, np.cumsum([len(some) for some in lanes])[:-1])


def without_starts(left: Array, slopes: Array, by_start: Array) -> tuple[Array, Array, Array, Array]:
    """left and slopes without what small changes of the starts take up, one stretch after the other ((n,), (n, free));
    and, per stretch, what the starts move by for what is left (stretches, 2) and per parameter (stretches, 2, free)."""
    q, r = np.linalg.qr(by_start)
    onto = np.swapaxes(q, 1, 2)
    seen, turn = onto @ left[..., None], onto @ slopes
    inverse = np.linalg.pinv(r)
    rest, slanted = left[..., None] - q @ seen, slopes - q @ turn
    return rest.ravel(), slanted.reshape(-1, slopes.shape[-1]), (inverse @ seen)[..., 0], inverse @ turn


def bounded_step(
    task: Task, theta: Array, left: Array, slopes: Array, damping: Array, unit: Array, low: Array
) -> Array:
    """Parameters after a step damped by damping (free,), the best of those within the bounds (bounded least squares,
    Stark & Parker 1995: columns are so alike that which bounds hold is no matter of one look)."""
    from scipy.optimize import lsq_linear

    free = np.array([INDEX[n] for n in task.free])
    gram = slopes.T @ slopes
    scale = np.diag(gram) + 1e-9 * np.trace(gram) / len(free) + 1e-30
    root = np.linalg.qr(
        np.vstack(
            [np.column_stack([slopes, left]), np.column_stack([np.diag(np.sqrt(damping * scale)), np.zeros(len(free))])]
        ),
        "r",
    )
    size = np.sqrt(scale)
    room = np.maximum((low[free] - theta[free]) / unit[free], -FARTHEST_STEP) * size
    step = (
        lsq_linear(root[:, :-1] / size, -root[:, -1], (np.minimum(room, -1e-300), np.full(len(free), np.inf)), "bvls").x
        / size
    )
    out = theta.copy()
    out[free] = np.maximum(theta[free] + np.minimum(step, FARTHEST_STEP) * unit[free], low[free])
    return out


def _dampings(free: Sequence[str]) -> list[tuple[float, Array]]:
    """Shares of the damping to try, and on which parameters (free,): all; or those alone in which the motion bends
    most, along whose valley the others, nearly linear and nearly alike, follow as far as they have to."""
    every, bent = np.ones(len(free)), np.where(np.isin(free, BENT), 1.0, UNDAMPED)
    return [(share, scope) for scope in ((every, bent) if np.any(bent == 1.0) else (every,)) for share in DAMPINGS]


def descend(swing: Swing, tasks: Sequence[Task], unit: Array, low: Array, iterations: int) -> list[Descent]:
    """Levenberg and Marquardt on all tasks at once."""
    own = [np.array([swing.lanes[i].start for i in t.stretches]) for t in tasks]
    runs = [Descent(t.start.copy(), s) for t, s in zip(tasks, own, strict=True)]
    for _ in range(iterations):
        todo = [k for k, d in enumerate(runs) if d.active]
        if not todo:
            break
        new = [k for k in todo if runs[k].left is None]
        asked = [(tasks[k].free, tasks[k].stretches, runs[k].theta, runs[k].starts) for k in new]
        for k, (left, slopes, by_start) in zip(new, linearised(swing, asked, unit) if new else (), strict=True):
            d = runs[k]
            d.left, d.slopes, d.by_start, d.cost = left, slopes, by_start, float(np.sum(left**2))
            d.evaluations += 3 + len(tasks[k].free)
        tried: list[tuple[int, float, Array, Array]] = []
        for k in todo:
            d, free = runs[k], np.array([INDEX[n] for n in tasks[k].free])
            rest, slopes, back, turn = without_starts(d.left, d.slopes, d.by_start)
            for share, scope in _dampings(tasks[k].free):
                theta = bounded_step(tasks[k], d.theta, rest, slopes, d.damping * share * scope, unit, low)
                step = (theta - d.theta)[free] / unit[free]
                tried.append((k, d.damping * share, theta, d.starts - back - turn @ step))
        left = _errors(swing, [t[2] for t in tried], [tasks[t[0]].stretches for t in tried], [t[3] for t in tried])
        costs = np.array([float(np.sum(x**2)) for x in left])
        for k in todo:
            d, mine = runs[k], [n for n, t in enumerate(tried) if t[0] == k]
            best = min(mine, key=lambda n: costs[n])
            d.evaluations += len(mine)
            if costs[best] < d.cost:
                d.active = bool(costs[best] < (1.0 - SETTLED) * d.cost)
                _, damping, d.theta, d.starts = tried[best]
                d.cost, d.damping, d.left = float(costs[best]), float(np.clip(damping, 1e-9, 1e7)), None
            else:
                d.damping *= 1e4
                d.active = d.damping < 1e6
    return runs


def profiled(swing: Swing, tasks: Sequence[Task], unit: Array, low: Array, iterations: int) -> list[Descent]:
    """Tasks that free a speed along whose valley `descend` hardly moves: at each of many such speeds the others, nearly
    linear, are fitted; between the best and its neighbours the intervals are halved, then all is free. What it finds
    hangs on no start of that speed."""
    (bent,) = BENT
    grid = np.log(usual_speed(swing)) + np.linspace(*np.log(RANGE), GRID)
    inner = [replace(t, free=tuple(n for n in t.free if n != bent)) for t in tasks]

    def at(asked: Sequence[tuple[int, float, Array]], most: int) -> list[Descent]:
        return descend(
            swing, [replace(inner[k], start=_with(theta, bent, np.exp(x))) for k, x, theta in asked], unit, low, most
        )

    ends = at([(k, float(x), t.start) for k, t in enumerate(tasks) for x in grid], INNER)
    known = [list(zip(grid, ends[k * GRID : (k + 1) * GRID], strict=True)) for k in range(len(tasks))]
    for round_ in range(HALVINGS + PARABOLAS):
        asked = []
        for k, some in enumerate(known):
            n = min(range(len(some)), key=lambda i: some[i][1].cost)
            near = [some[i] for i in range(max(n - 1, 0), min(n + 2, len(some)))]
            halves = [0.5 * (some[n][0] + x) for x, _ in near if x != some[n][0]]
            lowest = _lowest(*zip(*((x, d.cost) for x, d in near), strict=True))
            asked += [(k, float(x), some[n][1].theta) for x in (halves if round_ < HALVINGS else lowest)]
        for (k, x, _), end in zip(asked, at(asked, INNER), strict=True):
            known[k].append((x, end))
        known = [sorted(some, key=lambda pair: pair[0]) for some in known]
    best = [min(some, key=lambda pair: pair[1].cost)[1] for some in known]
    last = descend(swing, [replace(t, start=b.theta) for t, b in zip(tasks, best, strict=True)], unit, low, iterations)
    for end, some in zip(last, known, strict=True):
        end.evaluations += sum(d.evaluations for _, d in some)
    return last


def _lowest(x: Sequence[float], y: Sequence[float]) -> list[float]:
    """Where the parabola through three points is lowest, if they have one that is."""
    if len(x) < 3:
        return []
    bend, slope, _ = np.polyfit(np.subtract(x, x[1]), np.divide(y, y[1]), 2)
    low = -0.5 * slope / bend if bend > 0 else 0.0
    return [x[1] + low] if x[0] < x[1] + low < x[2] and low != 0.0 else []


def _with(theta: Array, name: str, value: float) -> Array:
    out = theta.copy()
    out[INDEX[name]] = value
    return out


__all__ = ["Descent", "Task", "descend", "linearised", "profiled", "without_starts"]
