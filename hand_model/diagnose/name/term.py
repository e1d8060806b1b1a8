"""Terms of a balance, an effect with its shape each, and what one does to the columns of the others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects.base import FRICTION, DriveState, Shape

Array = NDArray[np.float64]

# shapes that choose among few cases: no continuous parameter is spent on them
DISCRETE = ("side", "trial", "form", "end")
CYCLES_APART = 0.5  # over the range, by which the periods of two terms of one effect must differ to be two
COARSE = 0.15  # of a delay or a bristle's length: nearer is near enough to choose a start by


@dataclass(frozen=True)
class Term:
    """One effect with its shape."""

    effect: Any
    shape: Mapping[str, float]

    @property
    def key(self) -> tuple[Any, ...]:
        """What tells it from others, hashable."""
        return self.effect, key_of(self.shape)

    def moving(self, states: tuple[DriveState, ...]) -> list[Shape]:
        """What moves the term continuously: the shapes of its effect that matter in its form."""
        return [s for s in self.effect.shapes(states) if s.name not in DISCRETE and s.matters(self.shape)]

    @property
    def coarse(self) -> Term:
        """The term with its shape in steps of COARSE."""
        return Term(self.effect, {k: v if k in DISCRETE else _coarse(v) for k, v in self.shape.items()})


def reshaped(terms: tuple[Term, ...], which: int, shape: Mapping[str, float]) -> tuple[Term, ...]:
    """The terms, one of them (counted from the end where `which` is negative) with another shape."""
    out = list(terms)
    out[which] = Term(out[which].effect, shape)
    return tuple(out)


def key_of(shape: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """A shape, hashable."""
    return tuple(sorted((k, float(v)) for k, v in shape.items()))


def keys(terms: tuple[Term, ...]) -> tuple[Any, ...]:
    """What tells terms from others, hashable."""
    return tuple(t.key for t in terms)


def additive(effect: Any) -> bool:
    """Whether an effect adds its columns and leaves all others as they are."""
    return effect.replaces is None and not effect.warps and not effect.clips


def doubled(terms: tuple[Term, ...], span: float) -> bool:
    """Whether two terms of a periodic effect have one period, as far as a range `span` tells: together they are a wave
    that grows along it, of any size."""
    found: dict[str, list[float]] = {}
    for term in terms:
        if term.effect.repeats and "period" in term.shape:
            found.setdefault(term.effect.name, []).append(span / term.shape["period"])
    return any(np.any(np.diff(np.sort(cycles)) < CYCLES_APART) for cycles in found.values())


def bending(terms: tuple[Term, ...], effect: Any) -> tuple[Term, ...]:
    """Those of `terms` that change the columns of an effect: delays of any, bristles of what is friction."""
    return tuple(t for t in terms if t.effect.warps or effect.rubs and t.effect.replaces == FRICTION)


def warped(state: DriveState, columns: Array, terms: tuple[Term, ...]) -> Array:
    """Columns (n, k) of a state as the delays among `terms` shift them."""
    for term in terms:
        columns = term.effect.warp(state, columns, term.shape)
    return columns


def replaced(state: DriveState, terms: tuple[Term, ...]) -> DriveState:
    """The state with its declared columns as `terms` leave them, and so friction's direction: steady friction, whatever
    it depends on, is that of the bristles (Canudas de Wit 1995, eq. 3)."""
    for term in terms:
        if term.effect.replaces is not None:
            state = replace(state, declared=term.effect.declared(state, term.shape))
    return state


def _coarse(value: float) -> float:
    return math.copysign(math.exp(COARSE * round(math.log(abs(value)) / COARSE)), value) if value else value
