"""Stepwise selection among what may move markers (Efroymson 1960, "Multiple regression analysis").

All is linear, so trials work on products of columns: those of candidates among themselves and with the readings once,
those with what is shared or found as it comes. A step's moment is scanned by cumulative sums over cells of blocks, and
settled block by block. One that was found early is tried anew beside what was found after it: beside a mistaken one the
right ones may bring too little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks, project
from .displacement import NO_HINGE, YIELDING, Candidate, MarkerEffect
from .lasting_noise import LastingNoise

Array = NDArray[np.float64]

HINGE = ("joint_wobble", "moving_centre")
SLIGHT = 0.05  # of what all found effects bring: what a marker yields counts from there
MOSTLY = 0.7  # share of what the likeliest explains: what explains less does not stand for it
CELLS = 300  # moments that are tried first
PROMISING = 0.5  # of the best candidate's evidence: those whose moment is settled block by block
EDGE = 3  # blocks at either end of the session in which nothing begins
PASSES = 3  # over what was found, to try each anew
BETTER = 1.0  # log likelihood, penalised, by which another set is preferred


@dataclass(frozen=True)
class _Row:
    """Products of projected columns (b, 3m, e), flat (3mb, e): with the readings (e,), with all steps by cell (n, e,
    S), with all else (e, W)."""

    flat: Array
    readings: Array
    steps: Array
    whole: Array


@dataclass(frozen=True)
class _Beside:
    """What a candidate is tried beside: rows of the chain and what was found, one below the other. white: (s, s), by
    which products with their columns become products with orthonormal ones; readings: (s,) such products with the
    readings. square: what they leave."""

    rows: tuple[_Row, ...]
    white: Array
    readings: Array
    square: float

    @property
    def solution(self) -> Array:
        """Coefficients (s,) of the readings."""
        return self.white.T @ self.readings


@dataclass(frozen=True)
class _Trial:
    """A candidate at its best moment. begin, end: first block and the one after its last, None where it acts always."""

    candidate: Candidate
    gain: float
    evidence: float
    begin: int | None = None
    end: int | None = None

    def effect(self) -> MarkerEffect:
        """The candidate as chosen."""
        c = self.candidate
        return MarkerEffect(
            c.effect,
            c.body,
            c.label,
            self.begin,
            self.end,
            c.columns,
            self.evidence,
            self.gain,
            shifts=c.shifts,
            sides=c.sides,
        )


class Stepwise:
    """Trials of candidates in the readings of one finger.

    y: (b, 3m, 1) readings [m], poses projected out; shared: (b, 3m, s) columns of the chain, likewise; sigma: noise [m]
    of a reading; lasting: how much of it lasts.
    """

    def __init__(
        self,
        blocks: Blocks,
        candidates: Sequence[Candidate],
        y: Array,
        shared: Array,
        sigma: float,
        lasting: LastingNoise,
    ) -> None:
        self.blocks, self.candidates, self.y, self.sigma, self.lasting = blocks, candidates, y, sigma, lasting
        self.shared = shared
        self.readings = max(int((blocks.weight > 0).sum() * 2), 2)
        self.starts = _cells(blocks.record)
        self.last = np.searchsorted(blocks.record, blocks.record, side="right")  # records follow each other
        bases = {id(c.base): c for c in candidates}
        self.place: dict[int, slice] = {}
        self.steps = self._stacked([c for c in bases.values() if c.step])
        self.whole = _flat(self._stacked([c for c in bases.values() if not c.step]))
        turned = np.swapaxes(self.steps, 1, 2)
        self.step_readings = np.add.reduceat((turned @ y)[..., 0], self.starts)
        self.whole_readings = self.whole.T @ y.ravel()
        self.own: dict[int, Array] = {}
        for key, c in bases.items():
            place = self.place[key]
            self.own[key] = np.add.reduceat(turned[:, place] @ self.steps[..., place], self.starts) if c.step else (
                self.whole[:, place].T @ self.whole[:, place])  # fmt: skip
        self._rows: dict[tuple[int, int | None, int | None], tuple[MarkerEffect, _Row]] = {}
        self._grams: dict[tuple[int, int], Array] = {}
        self._chain = self._row_of(shared)

    def score(self, found: Sequence[MarkerEffect]) -> float:
        """Log likelihood less the penalty of Schwarz (1978); a step has a moment, too."""
        count = sum(e.everywhere.shape[-1] + (e.begin is not None) for e in found)
        return -0.5 * self._beside(found).square / self.sigma**2 - 0.5 * count * float(np.log(self.readings))

    def residual(self, found: Sequence[MarkerEffect]) -> Array:
        """(b, 3m, 1) [m] that chain and effects leave of the readings."""
        beside = self._beside(found)
        explained = np.zeros(self.y.size)
        start = 0
        for row in beside.rows:
            explained += row.flat @ beside.solution[start : start + row.flat.shape[1]]
            start += row.flat.shape[1]
        return self.y - explained.reshape(self.y.shape)

    def next(self, found: Sequence[MarkerEffect], known: bool = False) -> MarkerEffect:
        """The likeliest further effect. Any motion in step with the angle is what no known form explains: where one
        takes most of it, it is that one, seen to first order. What a marker yields that is small beside the others may be
        no more than their form being another. known: only what has a form."""
        beside = self._beside(found)
        hinges = {e.body for e in found if e.effect in HINGE}
        tried = self._tried(
            beside, [c for c in self.candidates if c.effect != NO_HINGE or not (known or c.body in hinges)]
        )
        least = SLIGHT * sum(e.gain for e in found)
        tried = [t for t in tried if t.candidate.effect != YIELDING or t.gain >= least]
        best = max(tried, key=lambda t: t.evidence)
        if best.candidate.effect == NO_HINGE:
            best = _instead(best, tried, HINGE, MOSTLY)
        # beside the same joint's, a small one is the rest of that
        if best.candidate.effect == "joint_wobble" and (best.gain >= least or best.candidate.body not in hinges):
            best = _or_centre(best, tried)
        return best.effect()

    def alone(self, candidate: Candidate) -> MarkerEffect:
        """What a candidate that acts always brings beside the chain alone."""
        row = self._row_of(project(self.blocks, candidate.columns))
        beside = self._beside(())
        crossed = self._chain.flat.T @ row.flat
        gain = self._gain((row.flat.T @ row.flat)[None], beside.white @ crossed[None], row.readings[None], beside)[0]
        return self._trial(candidate, float(gain), None, None).effect()

    def without(self, found: Sequence[MarkerEffect]) -> list[float]:
        """Gain (twice the log likelihood) that each effect brings beside all others."""
        square = self._beside(found).square
        return [
            (self._beside([e for e in found if e is not effect]).square - square) / self.sigma**2 for effect in found
        ]

    def settled(self, found: list[MarkerEffect]) -> list[MarkerEffect]:
        """The same number of effects, each tried anew beside the others until none is better another known way; in the
        order of what they bring."""
        swapped = False
        for _ in range(PASSES):
            before = found
            for effect in before[:-1]:
                others = [e for e in found if e is not effect]
                other = [*others, self.next(others, known=True)]
                if self.score(other) > self.score(found) + BETTER:
                    found, swapped = other, True
            if found is before:
                break
        parted = self._parted(found)
        return self._ordered(parted) if swapped or parted is not found else found

    def _parted(self, found: list[MarkerEffect]) -> list[MarkerEffect]:
        """A step that lasts beyond its recording ends with that, where something else beside it says more: what is put
        right before the next recording may slip there again."""
        for effect in found:
            if effect.begin is None or effect.end <= self.last[effect.begin]:
                continue
            beside = [*(e for e in found if e is not effect), replace(effect, end=int(self.last[effect.begin]))]
            other = [*beside, self.next(beside, known=True)]
            if self.score(other) > self.score(found) + BETTER:
                return other
        return found

    def _ordered(self, found: list[MarkerEffect]) -> list[MarkerEffect]:
        """By what each brings beside those before it."""
        out: list[MarkerEffect] = []
        left = list(found)
        while left:
            squares = [self._beside([*out, e]).square for e in left]
            at = int(np.argmin(squares))
            gain = (self._beside(out).square - squares[at]) / self.sigma**2
            effect = left.pop(at)
            parameters = effect.everywhere.shape[-1] + (effect.begin is not None)
            out.append(
                replace(effect, gain=gain, evidence=0.5 * gain - 0.5 * parameters * float(np.log(self.readings)))
            )
        return out

    def _stacked(self, candidates: Sequence[Candidate]) -> Array:
        """Projected columns of all bases (b, 3m, C), their places remembered."""
        start = 0
        for c in candidates:
            self.place[id(c.base)] = slice(start, start + c.base.shape[-1])
            start += c.base.shape[-1]
        if not candidates:
            return np.zeros((*self.y.shape[:2], 0))
        return project(self.blocks, np.concatenate([c.base for c in candidates], axis=-1))

    def _row_of(self, columns: Array) -> _Row:
        flat = _flat(columns)
        steps = np.add.reduceat(np.swapaxes(columns, 1, 2) @ self.steps, self.starts)
        return _Row(flat, flat.T @ self.y.ravel(), steps, flat.T @ self.whole)

    def _row(self, effect: MarkerEffect) -> _Row:
        key = (id(effect.everywhere), effect.begin, effect.end)
        if key not in self._rows:
            # kept, so that its id stays its own
            self._rows[key] = (effect, self._row_of(project(self.blocks, effect.columns)))
        return self._rows[key][1]

    def _beside(self, found: Sequence[MarkerEffect]) -> _Beside:
        rows = (self._chain, *(self._row(e) for e in found))
        gram = np.block([[self._product(a, b) for b in rows] for a in rows])
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = np.linalg.eigh(gram / np.outer(size, size))
        known = values > 1e-9 * values[-1]
        white = np.zeros_like(gram)
        white[known] = vectors.T[known] / np.sqrt(values[known])[:, None] / size
        readings = white @ np.concatenate([r.readings for r in rows])
        return _Beside(rows, white, readings, float(np.sum(self.y**2) - readings @ readings))

    def _product(self, a: _Row, b: _Row) -> Array:
        key = (id(a), id(b))
        if key not in self._grams:
            self._grams[key] = a.flat.T @ b.flat
            self._grams[key[::-1]] = self._grams[key].T
        return self._grams[key]

    def _tried(self, beside: _Beside, candidates: Sequence[Candidate]) -> list[_Trial]:
        crossed_steps = beside.white @ np.concatenate([r.steps for r in beside.rows], axis=1)
        crossed_whole = beside.white @ np.concatenate([r.whole for r in beside.rows])
        from_here = {True: crossed_steps[::-1].cumsum(0)[::-1], False: self._until(crossed_steps)}
        out = []
        for c in candidates:
            place = self.place[id(c.base)]
            if c.step:
                out.append(self._stepped(c, from_here[c.lasting][..., place], beside))
            else:
                pick = np.arange(c.base.shape[-1]) if c.pick is None else np.array(c.pick)
                at = place.start + pick
                gain = self._gain(
                    self.own[id(c.base)][np.ix_(pick, pick)][None],
                    crossed_whole[:, at][None],
                    self.whole_readings[at][None],
                    beside,
                )
                out.append(self._trial(c, float(gain[0]), None, None))
        least = PROMISING * max(t.evidence for t in out)
        return [self._sharpened(t, beside) if t.begin is not None and t.evidence > least else t for t in out]

    def _stepped(self, c: Candidate, crossed: Array, beside: _Beside) -> _Trial:
        """A step at the best of the cells' starts. crossed: (n, s, c) white products with what it is tried beside, from
        each start on."""
        sums = (lambda v: v[::-1].cumsum(0)[::-1]) if c.lasting else self._until
        place = self.place[id(c.base)]
        gain = self._gain(
            sums(self.own[id(c.base)]), crossed, sums(self.step_readings[:, place]), beside, self.own[id(c.base)].sum(0)
        )
        gain[(self.starts < EDGE) | (self.starts > len(self.y) - 1 - EDGE)] = 0.0
        at = int(self.starts[int(np.argmax(gain))])
        return self._trial(c, float(gain.max()), at, len(self.y) if c.lasting else int(self.last[at]))

    def _sharpened(self, trial: _Trial, beside: _Beside) -> _Trial:
        """The same with its moment settled among the blocks of the cells beside it."""
        c, at, end = trial.candidate, trial.begin, trial.end
        cell = int(np.searchsorted(self.starts, at))
        same = cell > 0 and self.blocks.record[self.starts[cell - 1]] == self.blocks.record[at]
        first = max(int(self.starts[cell - 1]) if same else at, EDGE)
        stop = min(int(self.starts[cell + 1]) if cell + 1 < len(self.starts) else len(self.y), len(self.y) - EDGE)
        if stop - first < 2:
            return trial
        place = self.place[id(c.base)]
        d = self.steps[first:end, :, place]
        turned = np.swapaxes(d, 1, 2)
        width = stop - first
        rows = np.concatenate([r.flat.reshape(*self.y.shape[:2], -1)[first:end] for r in beside.rows], axis=-1)

        def from_each(values: Array, rest: Array) -> Array:
            return values[::-1].cumsum(0)[::-1] + rest

        tail = d[width:].reshape(-1, d.shape[-1])
        own = from_each(turned[:width] @ d[:width], tail.T @ tail)
        crossed = beside.white @ from_each(
            np.swapaxes(rows[:width], 1, 2) @ d[:width], rows[width:].reshape(-1, rows.shape[-1]).T @ tail
        )
        readings = from_each((turned[:width] @ self.y[first:stop])[..., 0], tail.T @ self.y[stop:end].ravel())
        gain = self._gain(own, crossed, readings, beside, self.own[id(c.base)].sum(0))
        best = int(np.argmax(gain))
        return self._trial(c, float(gain[best]), first + best, end) if gain[best] > trial.gain else trial

    def _gain(self, own: Array, crossed: Array, readings: Array, beside: _Beside, whole: Array | None = None) -> Array:
        """Twice the log likelihood (n,) that columns bring. own: (n, c, c), crossed: (n, s, c), white, readings: (n,
        c); whole: (c, c) of the columns everywhere, by which their own products are kept away from singular."""
        scale = np.trace(own[0] if whole is None else whole) / own.shape[-1]
        turned = np.swapaxes(crossed, 1, 2)
        free = own - turned @ crossed + 1e-6 * scale * np.eye(own.shape[-1])
        right = readings - turned @ beside.readings
        return np.einsum("nc,nc->n", right, np.linalg.solve(free, right[..., None])[..., 0]) / self.sigma**2

    def _trial(self, c: Candidate, gain: float, begin: int | None, end: int | None) -> _Trial:
        parameters = (c.base.shape[-1] if c.pick is None else len(c.pick)) + (1 if c.step else 0)
        return _Trial(c, gain, 0.5 * gain - 0.5 * parameters * float(np.log(self.readings)), begin, end)

    def _until(self, values: Array) -> Array:
        """Sums (n, ...) from each cell to the end of its recording."""
        total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
        ends = np.searchsorted(self.starts, self.last[self.starts])
        return total[ends] - total[:-1]


def _instead(best: _Trial, tried: Sequence[_Trial], effects: tuple[str, ...], least: float) -> _Trial:
    """The likeliest of some effects of the same joint, where it explains more than the share `least` of what the best
    trial does; else that."""
    named = max(
        (t for t in tried if t.candidate.effect in effects and t.candidate.body == best.candidate.body),
        key=lambda t: t.evidence,
    )
    return named if named.gain > least * best.gain else best


def _or_centre(wobble: _Trial, tried: Sequence[_Trial]) -> _Trial:
    """A wobble about an axis that may pass beside the joint. Where most of what it explains is none of an axis through
    the joint, that axis or the joint's travelling centre, whichever explains more, if they explain as much between them:
    the other comes after it."""
    mine = [t for t in tried if t.candidate.body == wobble.candidate.body]
    evidence = attrgetter("evidence")
    through, centre = (
        max((t for t in mine if t.candidate.effect == name and any(t.candidate.shifts) == shifts), key=evidence)
        for name, shifts in (("joint_wobble", False), ("moving_centre", True))
    )
    parted = through.gain < MOSTLY * wobble.gain < through.gain + centre.gain
    return max(through, centre, key=evidence) if parted else wobble


def _flat(columns: Array) -> Array:
    return np.ascontiguousarray(columns).reshape(int(np.prod(columns.shape[:-1])), columns.shape[-1])


def _cells(record: NDArray[np.int64]) -> NDArray[np.int64]:
    """First blocks of cells of equal length, each within one recording."""
    length = max(len(record) // CELLS, 1)
    return np.concatenate([np.arange(*np.searchsorted(record, [r, r + 1]), length) for r in np.unique(record)])
