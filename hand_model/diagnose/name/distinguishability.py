"""Distinguishability: which effects these recordings can tell apart, from the recordings alone.

Of each effect what it would add is taken at every starting shape, beside what the declared columns explain. What of it
the likeliest shape of another effect cannot mimic is the part of a log likelihood ratio that an effect of a given size
leaves (the expected discrimination of Box & Hill 1967, for rivals that are linear in their amplitudes).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .balance import Balance, Fit
from .naming import CLASS_WIDTH
from .term import Term

Array = NDArray[np.float64]

SIZE = 0.5  # of the noise: root mean square of what the planted effect adds beyond what declared coefficients could
TOLD = 1e-3  # of a column's length: less left beside the declared columns, and these recordings do not show it
MOST_ROWS, MOST_SHAPES = 2500, 24  # of the balance, and of an effect's grid, that are looked at


def distinguishability(balance: Balance, effects: Iterable[Any]) -> dict[tuple[str, str], float]:
    """Pair of effects -> expected log likelihood ratio between them, the lower of the two ways round, where one of them
    adds SIZE.

    Effects that belong to one recording (events) and those that nothing here shows beside the declared columns are left
    out.
    """
    declared = balance.apart(())
    basis, weight = declared.basis, declared.weight
    rows = np.flatnonzero(weight > 0)
    rows = rows[:: max(1, len(rows) // MOST_ROWS)]
    fit = balance.fit()
    spans = {}
    for effect in effects:
        if any(s.name == "trial" for s in effect.shapes(balance.states)):
            continue
        shapes = effect.grid(balance.states)
        shapes = shapes[:: max(1, len(shapes) // MOST_SHAPES)]
        parts = [_span(balance, effect, shape, fit, basis, weight)[rows] for shape in shapes]
        parts = [np.linalg.qr(p)[0] for p in parts if p.shape[1]]
        if parts:
            spans[effect.name] = parts
    count = balance.train.sum() * SIZE**2 / (2 * balance.inflation)
    out = {}
    for a, b in combinations(spans, 2):
        shared = _shared(spans[a], spans[b])
        out[a, b] = float(count * min(1 - _mimicked(shared, spans[a]), 1 - _mimicked(shared.T, spans[b])))
    return out


def protocol_pairs(balance: Balance, effects: Sequence[Any]) -> tuple[list[list[Any]], list[list[str]]]:
    """Of the findings' protocol: each effect with the nearest of those that can be told from it (two names and the log
    likelihood ratio), and the pairs that cannot be told apart."""
    pairs = distinguishability(balance, effects)
    told: dict[str, list[Any]] = {}
    for (a, b), value in sorted(pairs.items(), key=lambda item: item[1]):
        if value >= CLASS_WIDTH:
            for name in (a, b):
                told.setdefault(name, [a, b, round(value, 1)])
    nearest = sorted({tuple(entry) for entry in told.values()}, key=lambda entry: (entry[2], *entry[:2]))
    return [list(entry) for entry in nearest], [[a, b] for (a, b), value in pairs.items() if value < CLASS_WIDTH]


def _span(balance: Balance, effect: Any, shape: dict[str, float], fit: Fit, basis: Array, weight: Array) -> Array:
    """What an effect may add (n, j), weighted, whitened and beside the declared columns; no columns where that is
    nothing."""
    added = _added(balance, Term(effect, shape), fit) * weight[:, None]
    added = balance.whiten(added, weight)
    length = np.linalg.norm(added, axis=0)
    left = added - basis @ (basis.T @ added)
    return left[:, np.linalg.norm(left, axis=0) > TOLD * length]


def _added(balance: Balance, term: Term, fit: Fit) -> Array:
    """Columns (n, j) of an effect; of one that changes the declared columns, shifts or clips, the change of the
    declared prediction."""
    effect, shape = term.effect, term.shape
    if effect.clips:
        return (effect.clip(fit.prediction, shape) - fit.prediction)[:, None]
    if effect.replaces is None and not effect.warps:
        return balance.columns(effect, shape)
    values = np.array(list(fit.declared.values()))

    def changed(state: Any) -> Array:
        columns = effect.declared(state, shape) if effect.replaces is not None else state.declared
        columns = effect.warp(state, columns, shape) if effect.warps else columns
        return ((columns - state.declared) @ values)[:, None]

    return np.concatenate([balance.gather(changed), balance.columns(effect, shape)], axis=1)


def _shared(some: list[Array], others: list[Array]) -> Array:
    """Squared products of the orthonormal bases of every shape of one effect with those of every shape of another, summed
    (k, l): what the two spaces share."""
    square = (np.concatenate(some, axis=1).T @ np.concatenate(others, axis=1)) ** 2
    begins = [np.cumsum([0, *(basis.shape[1] for basis in bases[:-1])]) for bases in (some, others)]
    return np.add.reduceat(np.add.reduceat(square, begins[0], axis=0), begins[1], axis=1)


def _mimicked(shared: Array, bases: list[Array]) -> float:
    """Share of an effect's variance, at the median of its shapes (k), that the other's best shape reproduces. shared:
    (k, l)."""
    return float(np.median(np.max(shared, axis=1) / [basis.shape[1] for basis in bases]))
