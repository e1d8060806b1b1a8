"""A weighted linear balance over several recordings, with effects in it: design matrix, bounded amplitudes, noise.

Everything here is generic in what the effort is (current, torque, an angle) and in which columns are declared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from ...effects.base import DriveState
from .grid import Grid, GridColumns, stacked
from .least_squares import bounded_least_squares, from_products
from .projection import Projection
from .samples import Samples
from .term import DISCRETE, Term, bending, key_of, keys, replaced, warped

Array = NDArray[np.float64]


# What physics allows of a declared coefficient, by its column's name.
DECLARED_LOW = {"inertia": 0.0, "viscous": 0.0, "coulomb": 0.0, "spring": 0.0}
MOST_KEPT = 6e8  # bytes of columns that one balance keeps
AT_ONCE = 60  # shapes of a grid whose columns are made together


@dataclass(frozen=True)
class Fit:
    """declared: coefficients by name. amplitudes: one mapping per term. prediction: (n,) over all compared samples.
    rss: weighted residual sum of squares over the training samples, what wider errors cost, and what answers to
    commands hold against it. size: number of effect parameters."""

    terms: tuple[Term, ...]
    declared: Mapping[str, float]
    amplitudes: tuple[Mapping[str, float], ...]
    prediction: Array
    rss: float
    size: int

    def added(self, which: int, state: DriveState) -> Array:
        """What the columns of one term add to the effort (n,) along a recording."""
        term = self.terms[which]
        return term.effect.columns(replaced(state, bending(self.terms, term.effect)), term.shape) @ np.array(
            list(self.amplitudes[which].values())
        )


class Balance(Samples):
    """The linear model of stacked samples: declared columns and those of effects, which may bend one another."""

    def __init__(
        self, states: tuple[DriveState, ...], everything: bool = False, typical: Mapping[str, float] | None = None
    ) -> None:
        super().__init__(states, everything, typical)
        self._grids: dict[Any, Grid] = {}
        self._idle: dict[Any, frozenset[str]] = {}
        self._kept: dict[Any, tuple[Any, GridColumns]] = {}
        self._apart: Any = None

    def _fresh(self) -> dict[str, Any]:
        return {**super()._fresh(), "_kept": {}, "_apart": None}

    def remapped(self, fit: Fit) -> Balance:
        """The same balance with the slope of its map as it is in a fit, for what yields moves along that; of a balance
        without one, itself."""
        powers = [v for k, v in fit.declared.items() if k.startswith("power_")]
        if len(powers) < 2:
            return self

        def with_slope(state: DriveState) -> DriveState:
            scale = state.extra["scale"]
            return replace(
                state, extra={**state.extra, "slope": Polynomial(powers).deriv()(state.position / scale) / scale}
            )

        return self.told(with_slope)

    def required(self, fit: Fit) -> Balance:
        """The same balance with what is "required" of the drive as a fit has it, its effects included."""

        def asked(state: DriveState) -> DriveState:
            effort = state.declared @ np.array(list(fit.declared.values()))
            for which in range(len(fit.terms)):
                effort = effort + fit.added(which, state)
            return replace(state, extra={**state.extra, "required": effort})

        return self.told(asked)

    def columns(self, effect: Any, shape: Mapping[str, float], bends: tuple[Term, ...] = ()) -> Array:
        """An effect's columns (n, j), as those of `bends` make them, unweighted. To be read only: the last ones are
        kept."""
        return self._remembered(
            (effect, key_of(shape), keys(bends)), lambda state: self._bent(state, effect, shape, bends)
        )

    def acting_columns(
        self, effect: Any, shape: Mapping[str, float], bends: tuple[Term, ...] = ()
    ) -> tuple[Array, slice | None]:
        """The same of the recordings alone in which the effect acts (m, j), and their rows, None where it acts in the
        first and in the last; without the columns of validation recordings where none is heard."""
        heard = [i for i, rows in enumerate(self._rows) if len(rows)]
        acting = [i for i in heard if effect.acts(self.states[i], shape)] or heard[:1]
        first, end = acting[0], acting[-1] + 1
        own = self.own_columns(effect)
        if (first, end) == (heard[0], heard[-1] + 1):
            return self.columns(effect, shape, bends)[:, own], None
        begin, count = (sum(len(rows) for rows in self._rows[a:b]) for a, b in ((0, first), (first, end)))
        columns = self.gather(lambda state: self._bent(state, effect, shape, bends)[:, own], first, end)
        return columns, slice(begin, begin + count)

    def own_columns(self, effect: Any) -> slice:
        """The columns of an effect that may act at all: those of validation recordings only where one is heard."""
        held = any(s.validate and len(rows) for s, rows in zip(self.states, self._rows, strict=True))
        return slice(len(effect.amplitudes()) - (0 if held else effect.held))

    def _bent(self, state: DriveState, effect: Any, shape: Mapping[str, float], bends: tuple[Term, ...]) -> Array:
        return warped(state, effect.columns(self._rubbed(state, bends), shape), bends)

    def _rubbed(self, state: DriveState, bends: tuple[Term, ...]) -> DriveState:
        """The state with friction turned over by the bristles among `bends`, its columns kept: every candidate beside
        the same ones asks."""
        rubbing = tuple(t for t in bends if t.effect.replaces is not None)
        if not rubbing:
            return state
        key = ("rubbed", id(state), keys(rubbing))
        found = self._last.get(key)
        return replace(
            state, declared=self._last.put(key, replaced(state, rubbing).declared) if found is None else found
        )

    def _remembered(self, key: Any, value: Callable[[DriveState], Array]) -> Array:
        """What `gather` makes of `value`; while one term's shape is optimised the other terms' columns stay."""
        found = self._last.get(key)
        return self._last.put(key, self.gather(value)) if found is None else found

    def grid(self, effect: Any) -> Grid:
        """Starting shapes of an effect on these recordings."""
        if effect not in self._grids:
            shapes = effect.grid(self.states)
            self._grids[effect] = Grid(effect, shapes, np.array([self.freedom(effect, s) for s in shapes], int))
        return self._grids[effect]

    def freedom(self, effect: Any, shape: Mapping[str, float]) -> int:
        """How many parameters a shape has beside its amplitudes: those that matter in its form."""
        form = effect, shape.get("form")
        if form not in self._idle:
            idle = [s.name for s in effect.shapes(self.states) if not s.matters(shape)]
            self._idle[form] = frozenset((*DISCRETE, *idle))
        return len(shape.keys() - self._idle[form])

    def grid_columns(self, grid: Grid, weight: Array, terms: tuple[Term, ...] = ()) -> GridColumns:
        """The columns beside `terms` of every shape of a grid, weighted by `weight` (n,) and whitened; kept under the
        balance's own weight, for each step of a search asks again. What a term clips is left out of these, and delays
        and bristles are as nearly as need be: near enough to choose a start by."""
        bends = tuple(t.coarse for t in bending(terms, grid.effect))
        own = self.weight * self.train
        inside = (weight != 0) | (own == 0)
        if not np.array_equal(weight, own * inside):
            return self._stacked(grid, weight, bends)
        place = grid.effect, bool(bends)  # a search asks by turns beside what bends and without
        beside, out = self._kept.get(place, ((), None))
        if out is None or beside != keys(bends):
            self._kept.pop(place, None)
            out = self._stacked(grid, own, bends)
            if out.bytes + sum(c.bytes for _, c in self._kept.values()) < MOST_KEPT:
                self._kept[place] = keys(bends), out
        return out if inside.all() else out.within(inside)

    def _stacked(self, grid: Grid, weight: Array, bends: tuple[Term, ...]) -> GridColumns:
        chunks = [grid.shapes[i : i + AT_ONCE] for i in range(0, len(grid.shapes), AT_ONCE)]
        return stacked(self._acting(grid.effect, chunk, weight, bends) for chunk in chunks)

    def _acting(
        self, effect: Any, shapes: Sequence[Mapping[str, float]], weight: Array, bends: tuple[Term, ...]
    ) -> list[Array]:
        """The columns (n, j) of each shape that are not zero, weighted and whitened; what shifts them shifts all of
        them at once. Not remembered, for whole grids would push out what is asked for again."""
        own = self.own_columns(effect)
        plain = {
            id(state): [
                effect.columns(self._rubbed(state, bends), shape)[:, own] if effect.acts(state, shape) else None
                for shape in shapes
            ]
            for state, rows in zip(self.states, self._rows, strict=True)
            if len(rows)
        }
        acting = [
            np.any([part.any(0) for part in parts if part is not None] or [[False]], axis=0)
            for parts in zip(*plain.values(), strict=True)
        ]
        some = [i for i, which in enumerate(acting) if which.any()]

        def bent(state: DriveState) -> Array:
            every = len(state.time_s)
            parts = [(plain[id(state)][i], acting[i]) for i in some]
            columns = [np.zeros((every, which.sum())) if p is None else p[:, which] for p, which in parts]
            return warped(state, np.concatenate(columns, axis=1) if columns else np.zeros((every, 0)), bends)

        together = self.gather(bent) * weight[:, None]
        edges = np.cumsum([np.count_nonzero(which) for which in acting])[:-1]
        return np.split(self.whiten(together, weight), edges, axis=1)

    def design(self, terms: tuple[Term, ...]) -> tuple[Array, Array, Array]:
        """Matrix (n, k + j) of declared and effect columns, lower and upper bounds (k + j,) of their coefficients."""
        parts, low, high = self._parts(terms)
        return np.concatenate(parts, axis=1), low, high

    def _parts(self, terms: tuple[Term, ...]) -> tuple[list[Array], Array, Array]:
        """The same, the declared columns and those of each effect apart."""
        warps, changing = (
            tuple(t for t in terms if t.effect.warps),
            tuple(t for t in terms if t.effect.replaces is not None),
        )

        def declared(state: DriveState) -> Array:
            return warped(state, replaced(state, changing).declared, warps)

        parts = [self._remembered(("declared", keys(changing), keys(warps)), declared)]
        low = [DECLARED_LOW.get(name, -np.inf) for name in self.names]
        high = [np.inf] * len(self.names)
        for term in terms:
            parts.append(self.columns(term.effect, term.shape, bending(terms, term.effect)))
            low += [a[2] for a in term.effect.amplitudes()]
            high += [a[3] for a in term.effect.amplitudes()]
        return parts, np.array(low), np.array(high)

    def fit(self, terms: tuple[Term, ...] = (), held: bool = True) -> Fit:
        """Amplitudes and declared coefficients by bounded weighted least squares on the training samples. held: also
        what belongs to validation recordings alone, which training does not see."""
        parts, low, high = self._parts(terms)
        weight = self.weights(terms)
        w = weight * self.train
        weighted = _weighted(parts, self.effort, w)
        coefficients, prediction = self._solved(terms, parts, weighted, w, (low, high), held)
        rss = self._square(prediction, w) + self.vagueness(weight) + self.unanswered(terms)
        k = len(self.names)
        amplitudes, start = [], k
        for term in terms:
            names = [a[0] for a in term.effect.amplitudes()]
            amplitudes.append(dict(zip(names, coefficients[start : start + len(names)].tolist(), strict=True)))
            start += len(names)
        acting = int(weighted[k:-1].any(1).sum())  # in training recordings
        size = sum(self.freedom(t.effect, t.shape) for t in terms) + acting
        declared = dict(zip(self.names, coefficients[:k].tolist(), strict=True))
        return Fit(terms, declared, tuple(amplitudes), prediction, rss, size)

    def error(self, terms: tuple[Term, ...]) -> float:
        """`rss` of the fit of `terms`, sooner."""
        parts, low, high = self._parts(terms)
        weight = self.weights(terms)
        w = weight * self.train
        weighted = _weighted(parts, self.effort, w)
        if any(t.effect.clips for t in terms):
            rss = self._square(self._solved(terms, parts, weighted, w, (low, high), False)[1], w)
        else:
            products = self.products(weighted, w)
            gram, right = products[:-1, :-1], products[:-1, -1]
            x = from_products(gram, right, low, high)
            rss = float(products[-1, -1] - 2 * right @ x + x @ gram @ x)
        return rss + self.vagueness(weight) + self.unanswered(terms)

    def _solved(
        self,
        terms: tuple[Term, ...],
        parts: list[Array],
        weighted: Array,
        w: Array,
        bounds: tuple[Array, Array],
        held: bool,
    ) -> tuple[Array, Array]:
        """Coefficients (k,) and clipped prediction (n,) of a design in parts, weighted by w; what is clipped tells
        nothing of them."""
        clips = [t for t in terms if t.effect.clips]
        inside = np.ones(len(w), bool)
        every = self.products(weighted, w)

        def among(inside: NDArray[np.bool_]) -> Array:
            if self.wander is not None:
                return self.products(weighted * inside, w * inside)
            outside = weighted[:, ~inside]  # a few
            return every - outside @ outside.T

        for _ in range(4 if clips else 1):
            products = every if inside.all() else among(inside)
            coefficients = from_products(products[:-1, :-1], products[:-1, -1], *bounds)
            if held:
                coefficients = self._own_nuisances(parts, coefficients, w, *bounds)
            prediction = raw = _along(parts, coefficients)
            for term in clips:
                prediction = term.effect.clip(prediction, term.shape)
            was, inside = inside, prediction == raw
            if np.array_equal(was, inside):
                break
        return coefficients, prediction

    def _square(self, prediction: Array, w: Array) -> float:
        """Weighted and whitened sum of squares of what a prediction (n,) leaves."""
        left = self.whiten((self.effort - prediction) * w, w)
        return float(left @ left)

    def removed(self, fit: Fit, which: int) -> Array:
        """Prediction (n,) of a fit with one term taken out and all coefficients as they are."""
        kept = [i for i in range(len(fit.terms)) if i != which]
        terms = tuple(fit.terms[i] for i in kept)
        values = [*fit.declared.values(), *(v for i in kept for v in fit.amplitudes[i].values())]
        prediction = self.design(terms)[0] @ np.array(values)
        for term in terms:
            if term.effect.clips:
                prediction = term.effect.clip(prediction, term.shape)
        return prediction

    def apart(self, terms: tuple[Term, ...]) -> Projection:
        """The design of `terms` taken out of the effort, samples that they clip left out. The last one is kept, for
        every candidate beside the same terms asks for it."""
        if self._apart is None or self._apart[0] != terms:
            self._apart = terms, self.taken_out(terms, self.unclipped(terms))
        return self._apart[1]

    def taken_out(self, terms: tuple[Term, ...], inside: NDArray[np.bool_]) -> Projection:
        """The same, of the samples `inside` (n,)."""
        w = self.weights(terms) * self.train * inside
        matrix, low, high = self.design(terms)
        return Projection.of(self.whiten(matrix * w[:, None], w), self.whiten(self.effort * w, w), w, low, high)

    def weights(self, terms: tuple[Term, ...]) -> Array:
        """1 / standard deviation (n,) beside `terms`: what is not known of rest, starts and stops stays, and is delayed
        with all else (where answers to commands tell how late the current is, that is in the weight)."""
        delays = [t for t in terms if t.effect.warps]
        if not delays or "late" in self.states[0].extra:
            return self.weight

        def doubt(state: DriveState) -> Array:
            at_once = timing = state.extra.get("sigma", np.zeros(len(state.time_s)))[:, None]
            for term in delays:
                timing = term.effect.warp(state, timing, term.shape)
            return np.maximum(timing, at_once)[:, 0]

        own = np.sqrt(np.maximum(1 / self.weight**2 - self.timing**2, 0.0))
        return 1 / np.hypot(own, self.gather(doubt))

    def vagueness(self, weight: Array) -> float:
        """What wider errors cost, on the scale of a sum of squares: a density that says less is lower where it is
        right."""
        return (
            0.0
            if weight is self.weight
            else 2 * self.inflation * float(np.sum(np.log(self.weight / weight)[self.train]))
        )

    def unanswered(self, terms: tuple[Term, ...]) -> float:
        """What the answers to commands hold against `terms`, on the scale of a sum of squares: "late" in `extra`, by
        how much [s] the current's answers come late and how far that may be wrong, is one more observation."""
        late = self.states[0].extra.get("late")
        if late is None:
            return 0.0
        spans = [t.effect.lateness(t.shape) for t in terms if t.effect.warps]
        low, high = (sum(span[i] for span in spans) for i in (0, 1))
        return self.inflation * float((max(low - late[0], late[0] - high, 0.0) / late[1]) ** 2)

    def telling(self, effect: Any) -> NDArray[np.bool_]:
        """Samples (n,) of the recordings that can bear an effect out."""
        return self.gather(lambda s: np.full(len(s.time_s), effect.told_by(s)))

    def unclipped(self, terms: tuple[Term, ...]) -> NDArray[np.bool_]:
        """Samples (n,) whose prediction no term clips: there the balance is linear."""
        return (
            self.unclipped_by(self.fit(terms))
            if any(t.effect.clips for t in terms)
            else np.ones(len(self.effort), bool)
        )

    def unclipped_by(self, fit: Fit) -> NDArray[np.bool_]:
        """The same (n,) of a fit, some of whose terms clip."""
        free = fit.prediction
        levels = [
            t.effect.clip(np.full(len(free), sign * np.inf), t.shape)
            for t in fit.terms
            if t.effect.clips
            for sign in (1, -1)
        ]
        return ~np.any([np.isclose(free, level) for level in levels], axis=0) if levels else np.ones(len(free), bool)

    def _own_nuisances(self, parts: list[Array], coefficients: Array, w: Array, low: Array, high: Array) -> Array:
        """Coefficients of columns that act in validation recordings only (their own clock offset, a step in them, an
        obstacle that is still there) from those recordings: they belong to the recording, not to the model, which stays
        as trained."""
        columns = np.flatnonzero(coefficients == 0)  # least squares leaves a column alone that never acts
        if not len(columns):
            return coefficients
        matrix = np.concatenate(parts, axis=1)
        columns = columns[np.any(matrix[:, columns] != 0, axis=0) & ~np.any(matrix[:, columns][w > 0] != 0, axis=0)]
        if not len(columns):
            return coefficients
        held = self.weight * ~self.train
        left = (self.effort - matrix @ coefficients) * held
        out = coefficients.copy()
        out[columns] = bounded_least_squares(matrix[:, columns] * held[:, None], left, low[columns], high[columns])
        return out


def _weighted(parts: list[Array], effort: Array, w: Array) -> Array:
    """The columns of a design in parts and the effort, weighted, one row each (k + 1, n)."""
    out, start = np.empty((sum(p.shape[1] for p in parts) + 1, len(w))), 0
    for part in (*parts, effort[:, None]):
        np.multiply(part.T, w, out=out[start : start + part.shape[1]])
        start += part.shape[1]
    return out


def _along(parts: list[Array], coefficients: Array) -> Array:
    """Prediction (n,) of a design in parts."""
    edges = np.cumsum([p.shape[1] for p in parts])[:-1]
    return np.sum([p @ x for p, x in zip(parts, np.split(coefficients, edges), strict=True)], axis=0)
