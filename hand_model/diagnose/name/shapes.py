"""The shape of a term beside others: the best of a grid of starts, then optimised, everything linear refitted at each
step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ...effects.base import Shape
from .balance import Balance, Fit
from .evidence import parameter_price
from .grid import Grid
from .term import Term, additive, bending, reshaped

Array = NDArray[np.float64]
Error = Callable[[Mapping[str, float]], float]  # of a shape

ALONG = 1e-6  # of a column's length: less left beside the design, and it says nothing of its own
# of the samples: where more are clipped that were not, or no longer, a shape is sought with whole fits
CLIPPED_ANEW = 0.005
EDGE_STEPS, EDGE_ROUNDS = (31, 9, 9), 3  # in which an edge is looked for, ever closer, and how often
EDGE_GAIN = 1.0  # in the sum of squares, for another round
FEW = 2  # shapes that are all fitted
GRAIN = 1.5  # times what the best shape of a grid brings: more no shape between is expected to


def scan(balance: Balance, effect: Any, terms: tuple[Term, ...], least: float = 0.0) -> Fit | None:
    """Best starting shape of `effect` beside `terms`; columns are projected, anything else is refitted. None where no
    shape could bring a log likelihood near `least`."""
    grid = balance.grid(effect)
    if not grid.shapes:
        return None
    shapes = grid.shapes
    if additive(effect):
        shapes = _project(balance, grid, terms, 2 * balance.inflation * least / GRAIN)
    if not shapes:
        return None
    best = _likeliest_of(balance, [(*terms, Term(effect, shape)) for shape in shapes])
    return best if balance.train.all() else balance.fit(best.terms)


def _likeliest_of(balance: Balance, candidates: Sequence[tuple[Term, ...]]) -> Fit:
    """The likeliest fit of terms that differ in the last one's shape, parameters paying their price; of many only those
    are fitted that may be it."""

    def among(chosen: NDArray[np.bool_]) -> list[Fit]:
        return [balance.fit(terms, held=False) for terms, may in zip(candidates, chosen, strict=True) if may]

    near = np.ones(len(candidates), bool)
    if len(candidates) > FEW:
        errors = np.array([balance.error(terms) for terms in candidates])
        near = errors <= errors.min() + parameter_price(balance) * len(candidates[0][-1].effect.amplitudes())
    best = likeliest(balance, among(near), -1, priced(balance))
    return best if possible(balance, best, -1) else likeliest(balance, [best, *among(~near)], -1, priced(balance))


def _project(balance: Balance, grid: Grid, terms: tuple[Term, ...], least: float) -> list[dict[str, float]]:
    """The two best shapes of a grid by the fall of the RSS, more than `least`, that its columns, orthogonal to the
    design, bring; parameters have their price."""
    rest = balance.apart(terms)
    columns = balance.grid_columns(grid, rest.weight, terms)
    inside = columns.products(rest.basis)
    left = np.sqrt(np.maximum(columns.length**2 - np.sum(inside**2, axis=1), 0.0))
    right = columns.products(rest.left)
    bounds = grid.effect.amplitudes()
    gains = np.zeros(len(grid.shapes))
    allowed = ((right >= 0) | (bounds[0][2] < 0)) & ((right <= 0) | (bounds[0][3] > 0))
    own = left > ALONG * columns.length
    alone = np.divide(right**2, left**2, out=np.zeros(len(left)), where=allowed & own)
    first = np.searchsorted(columns.shape, np.arange(len(grid.shapes) + 1))
    for i, (begin, end) in enumerate(pairwise(first.tolist())):
        if begin == end or not own[begin:end].all():  # what acts in validation recordings only tells nothing here
            continue
        mine = np.arange(begin, end)
        if len(mine) == 1:
            gains[i] = alone[begin]
        else:
            gram = columns.gram(mine) - inside[mine] @ inside[mine].T
            gains[i] = float(right[mine] @ np.linalg.lstsq(gram, right[mine], rcond=None)[0])
    price = parameter_price(balance) * (np.diff(first) + grid.freedom)
    worth = np.where(gains > max(least, 0.0), gains - price, -np.inf)
    return [grid.shapes[i] for i in np.argsort(worth)[::-1][:2] if np.isfinite(worth[i])]


def error_beside(balance: Balance, terms: tuple[Term, ...], effect: Any, near: Fit | None = None) -> Error:
    """The sum of squares (as `Fit.rss`) of `terms` and one more effect, as a function of that effect's shape. near:
    beside terms that clip, of the samples that this fit leaves unclipped; as long as these stay so, what the others add
    is the same."""

    def fitted(shape: Mapping[str, float]) -> float:
        return balance.error((*terms, Term(effect, shape)))

    clipped = any(t.effect.clips for t in terms)
    if not additive(effect) or clipped and near is None:
        return fitted
    rest = (
        balance.taken_out(terms, balance.unclipped_by(near)) if clipped and near is not None else balance.apart(terms)
    )
    if not rest.regular:
        return fitted
    more = balance.vagueness(balance.weights(terms)) + balance.unanswered(terms)
    bends = bending(terms, effect)
    low, high = (np.array([a[i] for a in effect.amplitudes()[balance.own_columns(effect)]]) for i in (2, 3))

    def projected(shape: Mapping[str, float]) -> float:
        columns, rows = balance.acting_columns(effect, shape, bends)
        weight = rest.weight if rows is None else rest.weight[rows]
        rss = rest.rss(balance.whiten(columns * weight[:, None], weight, rows), low, high, rows or slice(None))
        return fitted(shape) if rss is None else rss + more

    return projected


def polish(balance: Balance, fit: Fit, which: int) -> Fit:
    """Optimise the shape of one term within its bounds, everything linear refitted at each step; as it was where no
    machine could be like the optimum."""
    term = fit.terms[which]
    shapes = term.moving(balance.states)
    if not shapes:
        return fit
    others = tuple(t for i, t in enumerate(fit.terms) if i != which)
    learning = balance.learning()
    near = fit if learning is balance else replace(fit, prediction=fit.prediction[balance.train])

    def optimum(error: Error) -> Fit:
        best = _descended(error, term.shape, shapes)
        for _ in range(EDGE_ROUNDS if any(s.edge for s in shapes) else 0):
            moved = _edges_moved(error, best, shapes)
            if error(moved) > error(best) - EDGE_GAIN:
                break
            best = _descended(error, moved, shapes)
        return balance.fit(reshaped(fit.terms, which, best))

    best = optimum(error_beside(learning, others, term.effect, near))
    if (
        any(t.effect.clips for t in others)
        and np.mean(balance.unclipped_by(best) != balance.unclipped_by(fit)) > CLIPPED_ANEW
    ):
        best = optimum(error_beside(learning, others, term.effect))
    return likeliest(balance, (fit, best), which)


def _descended(error: Error, shape: Mapping[str, float], shapes: Sequence[Shape]) -> Mapping[str, float]:
    """The shape in the valley of `shape` (Nelder & Mead 1965), in units of the bounds' distance."""
    span = np.array([s.high - s.low for s in shapes])
    start = np.array([shape[s.name] for s in shapes])

    def shaped(u: Array) -> dict[str, float]:
        return {
            **shape,
            **{s.name: float(np.clip(v, s.low, s.high)) for s, v in zip(shapes, start + u * span, strict=True)},
        }

    step = [np.zeros(len(shapes))]
    for i, s in enumerate(shapes):
        corner = np.zeros(len(shapes))
        near = [abs(v - start[i]) for v in s.starts if v != start[i]]
        corner[i] = 0.4 * (min(near) if near else 0.1 * span[i]) / span[i]
        step.append(corner)
    result = minimize(
        lambda u: error(shaped(u)),
        np.zeros(len(shapes)),
        method="Nelder-Mead",
        options={"initial_simplex": np.array(step), "maxfev": 30 + 25 * len(shapes), "fatol": 0.02, "xatol": 2e-3},
    )
    return shaped(result.x)


def _edges_moved(error: Error, shape: Mapping[str, float], shapes: Sequence[Shape]) -> Mapping[str, float]:
    """The shape with each edge where it is best over all its bounds, then between its neighbours, one edge after the
    other."""
    for s in (s for s in shapes if s.edge):
        low, high = s.low, s.high
        for count in EDGE_STEPS:
            places = np.linspace(low, high, count)
            shape = min([shape, *({**shape, s.name: float(v)} for v in places)], key=error)
            step = (high - low) / (count - 1)
            low, high = max(shape[s.name] - step, s.low), min(shape[s.name] + step, s.high)
    return shape


def refit(balance: Balance, fit: Fit, rounds: int = 2) -> Fit:
    """Optimise all shapes, one term after the other, until nothing falls any more."""
    for _ in range(rounds if len(fit.terms) > 1 else 1):
        before = fit.rss
        for which in range(len(fit.terms)):
            fit = polish(balance, fit, which)
        if before - fit.rss < 0.5:
            break
    return fit


def reform(balance: Balance, fit: Fit, which: int) -> Fit:
    """The likeliest of the forms of one term, each with its shape optimised and paying for its parameters (Schwarz
    1978)."""
    term = fit.terms[which]
    forms = next((s.starts for s in term.effect.shapes(balance.states) if s.name == "form"), ())
    fits = [fit]
    for form in forms:
        if form != term.shape["form"]:
            other = reshaped(fit.terms, which, {**term.shape, "form": form})
            fits.append(polish(balance, balance.fit(other), which))
    return likeliest(balance, fits, which, priced(balance))


def priced(balance: Balance) -> Callable[[Fit], float]:
    """The sum of squares of a fit and the price of its effects' parameters."""
    price = parameter_price(balance)
    return lambda fit: fit.rss + price * fit.size


def likeliest(balance: Balance, fits: Iterable[Fit], which: int, cost: Callable[[Fit], float] = lambda f: f.rss) -> Fit:
    """The fit of the smallest cost, of those whose term `which` a machine may have where there are any."""

    def key(fit: Fit) -> tuple[bool, float]:
        return not possible(balance, fit, which), cost(fit)

    return min(fits, key=key)


def possible(balance: Balance, fit: Fit, which: int) -> bool:
    """Whether a machine may have term `which` of a fit as it is fitted."""
    effect, shape = fit.terms[which].effect, fit.terms[which].shape
    return bool(effect.possible(balance.states, effect.parameters(shape, fit.amplitudes[which], fit.declared)))
