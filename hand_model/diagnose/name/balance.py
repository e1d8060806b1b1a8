"""A weighted linear balance over several recordings, with effects in it: design matrix, bounded amplitudes, noise.

Everything here is generic in what the effort is (current, torque, an angle) and in which columns are declared.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from ...effects.base import DriveState
from ...effects.path import strokes
from .grid import Grid, GridColumns, stacked
from .least_squares import bounded_least_squares
from .projection import Projection

if TYPE_CHECKING:
    from .wander import Wander

Array = NDArray[np.float64]


# What physics allows of a declared coefficient, by its column's name.
DECLARED_LOW = {"inertia": 0.0, "viscous": 0.0, "coulomb": 0.0, "spring": 0.0}
MOST_KEPT = 3e8  # bytes of columns that one balance keeps
MOST_LAST = 24  # columns of single terms that it remembers
UNSETTLED = 1e-3  # weight left to a start or stop where steady motion alone is asked
DISCRETE = ("side", "trial", "form", "end")  # shapes that choose among few cases: no continuous parameter is spent on them


@dataclass(frozen=True)
class Term:
    """One effect with its shape."""

    effect: Any
    shape: Mapping[str, float]


@dataclass(frozen=True)
class Fit:
    """declared: coefficients by name. amplitudes: one mapping per term. prediction: (n,) over all compared samples.
    rss: weighted residual sum of squares over the training samples, what wider errors cost, and what answers to commands hold against it. size: number of effect parameters."""

    terms: tuple[Term, ...]
    declared: Mapping[str, float]
    amplitudes: tuple[Mapping[str, float], ...]
    prediction: Array
    rss: float
    size: int

    def added(self, which: int, state: DriveState) -> Array:
        """What the columns of one term add to the effort (n,) along a recording."""
        term = self.terms[which]
        return term.effect.columns(state, term.shape) @ np.array(list(self.amplitudes[which].values()))


def _key(shape: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    return tuple(sorted((k, float(v)) for k, v in shape.items()))


def _keys(terms: tuple[Term, ...]) -> tuple[Any, ...]:
    return tuple((t.effect, _key(t.shape)) for t in terms)


class Balance:
    """The compared samples of several DriveStates, stacked.

    effort, weight (1 / standard deviation), timing (the part of that deviation that starts and stops bring), train (bool): (n,). sigma: noise of the effort; inflation: integrated
    autocorrelation of that noise (1 where it is white): a sum of squares counts divided by it. typical: declared
    coefficients of other balances of the same kind, by name.
    """

    def __init__(self, states: tuple[DriveState, ...], everything: bool = False,
                 typical: Mapping[str, float] | None = None) -> None:
        self.states, self.typical = states, typical or {}
        self.masks = [np.isfinite(s.effort) & np.isfinite(s.declared).all(1) for s in states]
        self._rows = [np.flatnonzero(m) for m in self.masks]
        self.effort = self.gather(lambda s: s.effort)
        self.train = np.concatenate([np.full(m.sum(), everything or not s.validate)
                                     for s, m in zip(states, self.masks, strict=True)])
        self.names = states[0].declared_names or tuple(f"c{i}" for i in range(states[0].declared.shape[1]))
        self.stroke = self._strokes()
        self.sigma, self.inflation = 1.0, 1.0
        self.weight = np.ones(len(self.effort))
        self.sigma, self.inflation = noise(self)
        self.timing = self.gather(lambda s: s.extra.get("sigma", np.zeros(len(s.time_s))))
        self.weight = 1 / np.hypot(self.sigma, self.timing)
        self.steady = self.timing <= 0.25 * self.sigma
        self.wander: Wander | None = None
        self._grids: dict[Any, Grid] = {}
        self._kept: dict[Any, GridColumns] = {}
        self._warped: tuple[Any, ...] = ()
        self._last: OrderedDict[Any, Array] = OrderedDict()
        self._apart: Any = None

    def wandering(self, wander: Wander | None) -> Balance:
        """The same balance with a random level per while in its noise, where that is real."""
        return self._with(wander=wander if wander is not None and wander.real else None)

    def remapped(self, fit: Fit) -> Balance:
        """The same balance with the slope of its map as it is in a fit, for what yields moves along that; of a balance without one, itself."""
        powers = [v for k, v in fit.declared.items() if k.startswith("power_")]
        if len(powers) < 2:
            return self

        def with_slope(state: DriveState) -> DriveState:
            scale = state.extra["scale"]
            return replace(state, extra={**state.extra, "slope": Polynomial(powers).deriv()(state.position / scale) / scale})

        return self._with(states=tuple(with_slope(s) for s in self.states), _last=OrderedDict())

    def required(self, fit: Fit) -> Balance:
        """The same balance with what is "required" of the drive as a fit has it, its effects included."""
        def asked(state: DriveState) -> DriveState:
            effort = state.declared @ np.array(list(fit.declared.values()))
            for which in range(len(fit.terms)):
                effort = effort + fit.added(which, state)
            return replace(state, extra={**state.extra, "required": effort})

        return self._with(states=tuple(asked(s) for s in self.states), _last=OrderedDict())

    def settled(self) -> Balance:
        """The same balance with next to no weight on starts and stops."""
        return self._with(weight=np.where(self.steady, self.weight, UNSETTLED * self.weight))

    def _with(self, **changes: Any) -> Balance:
        """The same balance with other attributes, what is kept of weighted columns thrown away."""
        other = copy(self)
        for name, value in {"_kept": {}, "_apart": None, **changes}.items():
            setattr(other, name, value)
        return other

    def whiten(self, values: Array, weight: Array) -> Array:
        """Weighted values (n,) or (n, k) in which the noise is as good as white; as they are without `wander`."""
        return values if self.wander is None else self.wander.whiten(values, weight, self.inflation)

    def gather(self, value: Any) -> Array:
        """Stack `value(state)` (n, ...) over the compared samples."""
        return np.concatenate([np.asarray(value(s)).take(rows, axis=0) for s, rows in zip(self.states, self._rows, strict=True)])

    def _strokes(self) -> NDArray[np.int64]:
        out, count = [], 0
        for state in self.states:
            label = np.zeros(len(state.time_s), int)
            for a, b, _ in strokes(state.position):
                label[a:b] = count
                count += 1
            out.append(label)
        return np.concatenate([label[m] for label, m in zip(out, self.masks, strict=True)])

    def columns(self, effect: Any, shape: Mapping[str, float], warps: tuple[Term, ...] = ()) -> Array:
        """An effect's columns (n, j), shifted by those of `warps`, unweighted. To be read only: the last ones are kept."""
        def one(state: DriveState) -> Array:
            columns = effect.columns(state, shape)
            for term in warps:
                columns = term.effect.warp(state, columns, term.shape)
            return columns

        return self._remembered((effect, _key(shape), _keys(warps)), one)

    def _remembered(self, key: Any, value: Callable[[DriveState], Array]) -> Array:
        """What `gather` makes of `value`; while one term's shape is optimised the other terms' columns stay."""
        if key in self._last:
            self._last.move_to_end(key)
        else:
            self._last[key] = self.gather(value)
            if len(self._last) > MOST_LAST:
                self._last.popitem(last=False)
        return self._last[key]

    def grid(self, effect: Any) -> Grid:
        """Starting shapes of an effect on these recordings."""
        if effect not in self._grids:
            self._grids[effect] = Grid(effect, effect.grid(self.states))
        return self._grids[effect]

    def grid_columns(self, grid: Grid, weight: Array, warps: tuple[Term, ...] = ()) -> GridColumns:
        """The columns of every shape of a grid, weighted by `weight` (n,) and whitened; kept under the balance's own weight, for
        each step of a search asks again."""
        plain = np.array_equal(weight, self.weight * self.train)
        if plain and self._warped != _keys(warps):
            self._kept, self._warped = {}, _keys(warps)
        if plain and grid.effect in self._kept:
            return self._kept[grid.effect]
        out = stacked([self.whiten(self.columns(grid.effect, shape, warps) * weight[:, None], weight) for shape in grid.shapes])
        if plain and out.bytes + sum(c.bytes for c in self._kept.values()) < MOST_KEPT:
            self._kept[grid.effect] = out
        return out

    def design(self, terms: tuple[Term, ...]) -> tuple[Array, Array, Array]:
        """Matrix (n, k + j) of declared and effect columns, lower and upper bounds (k + j,) of their coefficients."""
        warps = tuple(t for t in terms if t.effect.warps)

        def declared(state: DriveState) -> Array:
            columns = state.declared
            for term in terms:
                if term.effect.replaces is not None:
                    columns = term.effect.declared(replace(state, declared=columns), term.shape)
            for term in warps:
                columns = term.effect.warp(state, columns, term.shape)
            return columns

        changing = tuple(t for t in terms if t.effect.replaces is not None)
        parts = [self._remembered(("declared", _keys(changing), _keys(warps)), declared)]
        low = [DECLARED_LOW.get(name, -np.inf) for name in self.names]
        high = [np.inf] * len(self.names)
        for term in terms:
            parts.append(self.columns(term.effect, term.shape, warps))
            low += [a[2] for a in term.effect.amplitudes()]
            high += [a[3] for a in term.effect.amplitudes()]
        return np.concatenate(parts, axis=1), np.array(low), np.array(high)

    def fit(self, terms: tuple[Term, ...] = (), held: bool = True) -> Fit:
        """Amplitudes and declared coefficients by bounded weighted least squares on the training samples. held: also what belongs
        to validation recordings alone, which training does not see."""
        matrix, low, high = self.design(terms)
        weight = self.weights(terms)
        w = weight * self.train
        clips = [t for t in terms if t.effect.clips]
        prediction = np.zeros(len(self.effort))
        inside = np.ones(len(self.effort), bool)
        for _ in range(4 if clips else 1):
            v = w * inside
            coefficients = bounded_least_squares(self.whiten(matrix * v[:, None], v), self.whiten(self.effort * v, v), low, high)
            if held:
                coefficients = self._own_nuisances(matrix, coefficients, w, low)
            prediction = raw = matrix @ coefficients
            for term in clips:
                prediction = term.effect.clip(prediction, term.shape)
            inside = prediction == raw
        rss = float(np.sum(self.whiten((self.effort - prediction) * w, w) ** 2)) + self.vagueness(weight) + self.unanswered(terms)
        k = len(self.names)
        amplitudes, start = [], k
        for term in terms:
            names = [a[0] for a in term.effect.amplitudes()]
            amplitudes.append(dict(zip(names, coefficients[start:start + len(names)].tolist(), strict=True)))
            start += len(names)
        size = sum(len([k for k in t.shape if k not in DISCRETE]) + len(t.effect.amplitudes()) for t in terms)
        declared = dict(zip(self.names, coefficients[:k].tolist(), strict=True))
        return Fit(terms, declared, tuple(amplitudes), prediction, rss, size)

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
        """The design of `terms` taken out of the effort, samples that they clip left out. The last one is kept, for every candidate
        beside the same terms asks for it."""
        if self._apart is None or self._apart[0] != terms:
            w = self.weights(terms) * self.train * self.unclipped(terms)
            matrix, low, high = self.design(terms)
            self._apart = terms, Projection.of(self.whiten(matrix * w[:, None], w), self.whiten(self.effort * w, w), w, low, high)
        return self._apart[1]

    def error_beside(self, terms: tuple[Term, ...], effect: Any) -> Callable[[Mapping[str, float]], float]:
        """The sum of squares (as `Fit.rss`) of `terms` and one more effect, as a function of that effect's shape."""
        def fitted(shape: Mapping[str, float]) -> float:
            return self.fit((*terms, Term(effect, shape)), held=False).rss

        if effect.replaces is not None or effect.warps or any(t.effect.clips for t in (*terms, Term(effect, {}))):
            return fitted
        rest = self.apart(terms)
        if not rest.regular:
            return fitted
        more = self.vagueness(self.weights(terms)) + self.unanswered(terms)
        warps = tuple(t for t in terms if t.effect.warps)
        low, high = (np.array([a[i] for a in effect.amplitudes()]) for i in (2, 3))

        def projected(shape: Mapping[str, float]) -> float:
            columns = self.columns(effect, shape, warps)
            rss = rest.rss(self.whiten(columns * rest.weight[:, None], rest.weight), low, high)
            return fitted(shape) if rss is None else rss + more

        return projected

    def weights(self, terms: tuple[Term, ...]) -> Array:
        """1 / standard deviation (n,) beside `terms`: what is not known of rest, starts and stops stays, and is delayed with all else
        (where answers to commands tell how late the current is, that is in the weight)."""
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
        """What wider errors cost, on the scale of a sum of squares: a density that says less is lower where it is right."""
        return 0.0 if weight is self.weight else 2 * self.inflation * float(np.sum(np.log(self.weight / weight)[self.train]))

    def unanswered(self, terms: tuple[Term, ...]) -> float:
        """What the answers to commands hold against `terms`, on the scale of a sum of squares: "late" in `extra`, by how much [s] the
        current's answers come late and how far that may be wrong, is one more observation."""
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
        clips = [t for t in terms if t.effect.clips]
        if not clips:
            return np.ones(len(self.effort), bool)
        free = self.fit(terms).prediction
        levels = [term.effect.clip(np.full(len(free), sign * np.inf), term.shape) for term in clips for sign in (1, -1)]
        return ~np.any([np.isclose(free, level) for level in levels], axis=0)

    def _own_nuisances(self, matrix: Array, coefficients: Array, w: Array, low: Array) -> Array:
        """Coefficients of columns that act in validation recordings only (their own clock offset, a step in them, an obstacle
        that is still there) from those recordings: they belong to the recording, not to the model, which stays as trained."""
        columns = np.flatnonzero(coefficients == 0)  # least squares leaves a column alone that never acts
        columns = columns[np.any(matrix[:, columns] != 0, axis=0) & ~np.any(matrix[:, columns][w > 0] != 0, axis=0)]
        if not len(columns):
            return coefficients
        held = self.weight * ~self.train
        left = (self.effort - matrix @ coefficients) * held
        out = coefficients.copy()
        out[columns] += np.linalg.lstsq(matrix[:, columns] * held[:, None], left, rcond=None)[0]
        return np.maximum(out, low)


COLOURED = 0.05  # autocorrelation of neighbouring samples from which noise counts as coloured
LONGEST = 15  # samples over which noise may be correlated; what lasts longer is a misfit


def noise(balance: Balance) -> tuple[float, float]:
    """Standard deviation of the effort's noise and its integrated autocorrelation time in samples.

    Pure error of replicates: the declared fit's residual minus its mean over all strokes with the same direction, speed and
    place. White noise: differences of neighbouring samples (von Neumann 1941) are sharper and are taken instead.
    """
    steady = balance.gather(lambda s: s.extra.get("steady", np.ones(len(s.time_s)))) > 0
    r = balance.effort - _plain_fit(balance, steady)
    same = (balance.stroke[1:] == balance.stroke[:-1]) & steady[1:] & steady[:-1]
    if same.sum() < 20:
        return float(np.std(r)) or 1.0, 1.0
    neighbours = float(np.sqrt(np.mean(np.diff(r)[same] ** 2) / 2))
    deviation, share = replicate_deviation(balance, r, steady)
    if not len(deviation):
        return max(neighbours, 1e-9), 1.0
    lags = []
    for k in range(LONGEST + 1):
        pair = (balance.stroke[k:] == balance.stroke[: len(r) - k]) & np.isfinite(deviation[k:]) & np.isfinite(deviation[: len(r) - k])
        lags.append(float(np.mean((deviation[k:] * deviation[: len(r) - k])[pair])) if pair.sum() > 20 else 0.0)
    # What still correlates after LONGEST samples is a misfit that does not repeat (an event), no noise.
    covariance = np.array(lags) - max(float(np.mean(lags[-5:])), 0.0)
    rho = covariance / max(covariance[0], 1e-300)
    if rho[1] < COLOURED:
        return max(neighbours, 1e-9), 1.0
    small = np.flatnonzero(rho < 0.03)
    stop = int(small[0]) if len(small) else len(rho)
    return float(np.sqrt(max(covariance[0], 1e-300) / share)), float(1 + 2 * rho[1:stop].sum())


def replicate_deviation(balance: Balance, residual: Array, use: NDArray[np.bool_]) -> tuple[Array, float]:
    """Residual minus its mean over the other strokes' replicates (n,), nan where there are none, and the share of the
    variance that is left by taking a mean out."""
    position, velocity = balance.gather(lambda s: s.position), balance.gather(lambda s: s.velocity)
    place = np.searchsorted(np.quantile(position, np.linspace(0, 1, 31)[1:-1]), position)
    speed = np.searchsorted(np.quantile(np.abs(velocity), np.linspace(0, 1, 7)[1:-1]), np.abs(velocity))
    cell = np.unique(place * 20 + speed * 2 + (velocity > 0), return_inverse=True)[1]
    cell = np.where(use, cell, -1)
    out = np.full(len(residual), np.nan)
    shares = []
    for c in range(cell.max() + 1):
        mine = np.flatnonzero(cell == c)
        strokes_here, index = np.unique(balance.stroke[mine], return_inverse=True)
        if len(strokes_here) < 3:
            continue
        means = np.bincount(index, residual[mine]) / np.bincount(index)
        out[mine] = residual[mine] - means.mean()
        shares.append(np.full(len(mine), 1 - 1 / len(mine)))
    return (out, float(np.concatenate(shares).mean())) if shares else (np.zeros(0), 1.0)


def _plain_fit(balance: Balance, use: NDArray[np.bool_]) -> Array:
    matrix = balance.gather(lambda s: s.declared)
    free = np.full(matrix.shape[1], np.inf)
    use = use if use.sum() > 5 * matrix.shape[1] else np.ones(len(matrix), bool)
    return matrix @ bounded_least_squares(matrix[use], balance.effort[use], -free, free)
