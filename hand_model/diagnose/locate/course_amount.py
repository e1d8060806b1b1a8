"""How far a joint that is no plain hinge leaves its hinge, and how surely: every course that it may take is weighed.

Which course it takes is not known, and another axis, another centre and other places of the markers explain part of
any. So all of a family are fitted to the readings beside what else may be, each about many directions, and averaged by
their marginal likelihoods (Hoeting et al. 1999, "Bayesian model averaging"); an amplitude may be of any size (prior
1/a, Jeffreys 1946).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks, across_axis, project, share_of_range
from .displacement import MarkerEffect
from .markers import MarkerNaming

Array = NDArray[np.float64]

DIRECTIONS = 24  # across the axis, over half a turn
WAVES = (0.75, 6.0, 43)  # half waves over the range: least, most, how many between
ZOOM, ZOOMS = 0.2, 4  # what is told better than the grids: how much finer, how often at most
FINER = np.linspace(-1.0, 1.0, int(2 / ZOOM) + 1)  # places of a finer grid, in steps of the coarser
CELLS = 3.0  # of a grid in which what is likely lies: fewer, and a finer one is needed
FAR = 40.0  # log likelihood below the best, from which a course counts for nothing
DRAWS = 200  # of each course's amplitudes
QUANTILES = (0.025, 0.5, 0.975)
WITHIN = 3.84  # twice the log likelihood that a size may bring less than the likeliest, at 95 %


@dataclass(frozen=True)
class _Course:
    """One or two functions of the share of the range, (n, f) by `at`, each along a direction across the axis: turned by
    `aside` [rad] from the first. own: the directions turn with the segment that the joint carries."""

    kind: str
    order: float
    own: bool
    prior: float
    aside: tuple[float, ...]

    def at(self, u: Array) -> Array:
        x, half = self.order * u, np.pi * u
        if self.kind == "wave":
            return np.stack([np.sin(np.pi * x), np.cos(np.pi * x)], axis=-1)
        if self.kind == "wave from zero":
            return np.sin(np.pi * x)[:, None]
        if self.kind == "power":
            return (u**self.order)[:, None]
        if self.kind == "bow":
            return np.stack([u**self.order, np.sin(half)], axis=-1)
        return np.stack([np.sin(half), 1 - np.cos(half)], axis=-1)

    def size(self, coefficients: Array) -> Array:
        """Amplitude of a wave or farthest way of a centre (d,), by coefficients (d, f)."""
        if self.kind.startswith("wave"):
            return np.linalg.norm(coefficients, axis=-1)
        way = coefficients[:, None] * self.at(np.linspace(0, 1, 60))
        return np.linalg.norm(way, axis=-1).max(axis=1)


@dataclass(frozen=True)
class _Fitted:
    """A course about one direction [rad]: twice the log likelihood that it brings, its coefficients (f,) and their
    precision (f, f); how likely it is before that."""

    course: _Course
    direction_rad: float
    gain: float
    coefficients: Array
    precision: Array
    prior: float

    @property
    def likely(self) -> float:
        """Twice the log likelihood, with what is held of it before."""
        return self.gain + 2 * float(np.log(self.prior))


def course_amount(naming: MarkerNaming, effect: MarkerEffect) -> tuple[float, list[float]]:
    """Amplitude [rad] of a wobble's wave over the recorded range, or the farthest way [m] of a centre from where it
    began, and its 95 % interval: median and quantiles over all courses, weighed by their marginal likelihood.

    effect: a joint_wobble or moving_centre of `naming` that does not change sides with the way of motion.
    """
    readings = _Readings(naming, effect)
    orders, step = _courses(effect.effect == "joint_wobble"), (WAVES[1] - WAVES[0]) / (WAVES[2] - 1)
    directions, turn = np.linspace(0, np.pi, DIRECTIONS, endpoint=False), np.pi / DIRECTIONS
    fitted = [f for c in orders for f in readings.fit(c, directions)]
    for _ in range(ZOOMS):
        best = max(fitted, key=lambda f: f.likely)
        likely = np.exp(0.5 * (np.array([f.likely for f in fitted if f.course == best.course]) - best.likely))
        if likely.sum() > CELLS:
            break
        # the likeliest place of the grid and its neighbours give way to a finer grid
        near = [best.course]
        if best.course.kind == "wave":
            weight = best.course.prior * ZOOM
            near = [_Course("wave", best.course.order + s * step, best.course.own, weight, (0.0, 0.0)) for s in FINER]
        fitted = [f for f in fitted if not _beside(f, best, step, turn)]
        fitted += [f for c in near for f in readings.fit(c, best.direction_rad + FINER * turn, ZOOM)]
        step, turn = step * ZOOM, turn * ZOOM
    loud = readings.loudness(effect, max(f.likely for f in fitted))
    value, interval = _averaged(fitted, loud)
    if effect.effect == "joint_wobble":
        return value, interval
    low, high = _told([*fitted, *_finer(readings, orders, fitted)], loud)
    return value, [min(low, interval[0]), max(high, interval[1])]


class _Readings:
    """Marker readings of one finger, and what a course brings beside everything else that was found in them."""

    def __init__(self, naming: MarkerNaming, effect: MarkerEffect) -> None:
        self.blocks, self.sigma = naming.blocks, naming.sigma_m
        blocks = naming.blocks
        others = [e.columns for e in naming.found if (e.body, e.effect) != (effect.body, effect.effect)]
        others += [effect.columns[..., list(effect.shifts)]] if effect.effect == "joint_wobble" else []
        beside = _flat(project(blocks, np.concatenate([blocks.chain_columns, *others], axis=-1)))
        self.basis = _orthonormal(beside, beside)
        self.y = self._free(_flat(project(blocks, blocks.residual.reshape(len(blocks.residual), -1, 1))))[:, 0]
        self.u = share_of_range(blocks, effect.body - 1)
        self.ways = {own: _ways(blocks, effect.body, effect.effect == "joint_wobble", own) for own in (False, True)}

    def _free(self, columns: Array) -> Array:
        return columns - self.basis @ (self.basis.T @ columns)

    def loudness(self, effect: MarkerEffect, gain: float) -> float:
        """Variance, over that of the noise, of what the effect's own columns explain and no course does; at least one.
        gain: what the best course brings, beside the same others."""
        columns = _flat(project(self.blocks, effect.columns))
        own = _orthonormal(self._free(columns), columns).T @ self.y / self.sigma
        return max((float(own @ own) - gain) / len(own), 1.0)

    def fit(self, course: _Course, directions_rad: Array, share: float = 1.0) -> list[_Fitted]:
        """The course about each direction. share: of the grid's cell that each stands for."""
        f = course.at(self.u)
        columns = np.concatenate(
            [f[:, None, [i]] * way for i in range(f.shape[1]) for way in self.ways[course.own]], -1
        )
        free = self._free(_flat(project(self.blocks, columns)))
        square, right = free.T @ free / self.sigma**2, free.T @ self.y / self.sigma**2
        out = []
        for direction in directions_rad.tolist():
            turned = np.zeros((len(square), f.shape[1]))
            for i, aside in enumerate(course.aside):
                turned[2 * i : 2 * i + 2, i] = np.cos(direction + aside), np.sin(direction + aside)
            precision = turned.T @ square @ turned
            precision += 1e-9 * np.trace(precision) * np.eye(len(precision))
            found = np.linalg.solve(precision, turned.T @ right)
            gain = float(found @ turned.T @ right)
            out.append(_Fitted(course, direction, gain, found, precision, course.prior * share))
        return out


def _courses(tilts: bool) -> list[_Course]:
    """What a tilt or a centre's way may be over the range."""
    if not tilts:
        out = [_Course("power", n, False, 1 / 9, (0.0,)) for n in (1.0, 2.0, 3.0)]
        out += [_Course("bow", n, False, 1 / 6, (0.0, np.pi / 2)) for n in (1.0, 2.0)]
        return [*out, _Course("ellipse", 1.0, False, 1 / 3, (0.0, np.pi / 2))]
    out = []
    for own in (False, True):
        out += [_Course("wave", n, own, 0.25 / WAVES[2], (0.0, 0.0)) for n in np.linspace(*WAVES).tolist()]
        out += [_Course("wave from zero", n, own, 0.25 / 4, (0.0,)) for n in (1.0, 2.0, 3.0, 4.0)]
    return out


def _ways(blocks: Blocks, body: int, tilts: bool, own: bool) -> list[Array]:
    """How every marker (b, 3m, 1) moves with a turn about either of two directions across the joint, or with a shift
    along it."""
    first, second = across_axis(blocks, body - 1)
    if own:
        cosine, sine = np.cos(blocks.angle[:, [body - 1]]), np.sin(blocks.angle[:, [body - 1]])
        first, second = cosine * first + sine * second, cosine * second - sine * first
    moved = np.flatnonzero(blocks.body >= body)
    arm = blocks.position[:, moved] - blocks.centres[:, body - 1][:, None]
    out = []
    for direction in (first, second):
        way = np.zeros((*blocks.weight.shape, 3))
        way[:, moved] = np.cross(direction[:, None], arm) if tilts else direction[:, None]
        out.append(way.reshape(len(way), -1, 1))
    return out


def _beside(fitted: _Fitted, best: _Fitted, step: float, turn: float) -> bool:
    """Whether a place of the grid lies within one step of another."""
    a, b = fitted.course, best.course
    apart = abs((fitted.direction_rad - best.direction_rad + np.pi / 2) % np.pi - np.pi / 2)
    return (a.kind, a.own) == (b.kind, b.own) and abs(a.order - b.order) < 1.01 * step and apart < 1.01 * turn


def _averaged(fitted: Sequence[_Fitted], loud: float) -> tuple[float, list[float]]:
    """Median and interval of the size. loud: variance over that of the noise: what no course explains counts as noise."""
    best = max(f.likely for f in fitted)
    sizes, weights = [], []
    for f, drawn in _drawn([f for f in fitted if 0.5 * (best - f.likely) <= FAR * loud], loud):
        size, k = f.course.size(drawn), len(f.coefficients)
        prior = size**-1.0 if k == 1 else 1.0 / (2 * np.pi * size * np.linalg.norm(drawn, axis=-1))
        volume = 0.5 * k * np.log(2 * np.pi * loud) - 0.5 * np.linalg.slogdet(f.precision)[1]
        weights.append(np.exp(0.5 * (f.likely - best) / loud + volume) * prior)
        sizes.append(size)
    size, weight = np.concatenate(sizes), np.concatenate(weights)
    order = np.argsort(size)
    below = np.cumsum(weight[order]) / weight.sum()
    low, middle, high = (float(size[order][min(int(np.searchsorted(below, q)), len(size) - 1)]) for q in QUANTILES)
    return middle, [low, high]


def _told(fitted: Sequence[_Fitted], loud: float) -> tuple[float, float]:
    """Least and greatest size that some course has within 95 % by likelihood alone (Wilks 1938): what travels evenly and
    what goes out and back explain the same readings, for another centre takes most of the former up, and how much is
    held of either before decides nothing."""
    best, sizes = max(f.gain for f in fitted), []
    for f, drawn in _drawn([f for f in fitted if best - f.gain <= WITHIN * loud], loud):
        off = drawn - f.coefficients
        lost = (best - f.gain + np.einsum("di,ij,dj->d", off, f.precision, off)) / loud
        sizes.append(f.course.size(drawn[lost <= WITHIN]))
    size = np.concatenate(sizes)
    return float(size.min()), float(size.max())


def _finer(readings: _Readings, courses: Sequence[_Course], fitted: Sequence[_Fitted]) -> list[_Fitted]:
    """Every course about directions near its likeliest one, which the grid may miss by more than readings allow."""
    out = []
    for course in courses:
        best = max((f for f in fitted if f.course == course), key=lambda f: f.gain)
        for zoom in range(ZOOMS):
            turn = np.pi / DIRECTIONS * ZOOM**zoom
            near = readings.fit(course, best.direction_rad + FINER * turn)
            best = max(near, key=lambda f: f.gain)
            out += near
    return out


def _drawn(fitted: Sequence[_Fitted], loud: float) -> list[tuple[_Fitted, Array]]:
    """Courses with coefficients (1 + DRAWS, f) of each: its own, and some drawn about them."""
    rng, out = np.random.default_rng(0), []
    for f in fitted:
        covariance = loud * np.linalg.inv(f.precision)
        drawn = rng.multivariate_normal(f.coefficients, covariance, DRAWS, method="eigh")
        out.append((f, np.concatenate([f.coefficients[None], drawn])))
    return out


def _orthonormal(columns: Array, whole: Array) -> Array:
    """Orthonormal columns that span others (n, k). whole: (n, k) what is left of which these are: less than rounding
    leaves is nothing."""
    scaled = columns / np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    known = values > 1e-9 * values[-1]
    return scaled @ (vectors[:, known] / np.sqrt(values[known]))


def _flat(columns: Array) -> Array:
    return columns.reshape(-1, columns.shape[-1])
