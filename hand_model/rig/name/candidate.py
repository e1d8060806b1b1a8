"""One effect at one joint, as it competes there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...effects import effect
from ...effects.base import Shape
from ..balance import Rows

Array = NDArray[np.float64]
# what has one of these can be there twice: two springs, two tight spots
PLACED = frozenset({"reach", "period", "centre"})
Bound = tuple[str, str, float, float]


@dataclass(frozen=True)
class Candidate:
    """One effect at one joint. columns(row, shape) -> (n, j) at full rate; grid: starting shapes; warp: shape -> delay
    [s] by which every column comes later (None: no delay); variant says in words which one this is; shapes: by
    name, those of the catalogue's effect, which may leave their grid within their bounds."""

    effect: str
    variant: str
    joint: str
    amplitudes: tuple[Bound, ...]
    grid: tuple[dict[str, float], ...]
    columns: Callable[[Rows, Mapping[str, float]], Array]
    delays: bool = False
    shapes: Mapping[str, Shape] = field(default_factory=dict)

    def told(self, shape: Mapping[str, float]) -> dict[str, float]:
        """What of a shape says something in its form."""
        told = effect(self.effect).told(shape)
        return {k: float(v) for k, v in told.items() if k not in self.shapes or self.shapes[k].matters(shape)}

    @property
    def repeats(self) -> bool:
        """Whether it can act at a joint more than once, at different places."""
        return bool(PLACED & self.grid[0].keys())

    @property
    def key(self) -> str:
        """effect@joint, with the variant where there is one."""
        return f"{self.effect}{'/' + self.variant if self.variant else ''}@{self.joint}"
