"""What is planted where: one effect, two of them, or one among a tenth of all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .compose import EFFECTS

HIDES_ALL = "command_as_measurement"  # of a column that was never measured nothing else is told
TENTH = 0.1
Site = tuple[Path, str]  # a session and a finger in which nothing is hidden


@dataclass(frozen=True)
class Case:
    """kind: single, pair or messy; main: the effects that must be named; sizes: of all that are planted."""

    kind: str
    source: Path
    finger: str
    main: tuple[str, ...]
    sizes: dict[str, float]
    seed: int

    @property
    def name(self) -> str:
        """Of its folder."""
        return "_".join((self.kind, *self.main, self.source.name, self.finger))


def singles(sites: Sequence[Site], effects: Sequence[str], size: float, seed: int) -> list[Case]:
    """Each effect once, at one site after the other."""
    order = np.random.default_rng(seed).permutation(len(sites))
    return [
        Case("single", *sites[order[i % len(sites)]], (effect,), {effect: size}, 1000 * seed + i)
        for i, effect in enumerate(EFFECTS)
        if effect in effects
    ]


def pairs(sites: Sequence[Site], effects: Sequence[str], count: int, size: float, seed: int) -> list[Case]:
    """Two effects at once."""
    rng = np.random.default_rng([seed, 2])
    drawn = []
    for i in range(count):
        two = tuple(str(e) for e in rng.choice([e for e in effects if e != HIDES_ALL], 2, replace=False))
        site = sites[rng.integers(len(sites))]
        drawn.append(Case("pair", *site, two, dict.fromkeys(two, size), 1000 * seed + 100 + i))
    return drawn


def messy(sites: Sequence[Site], effects: Sequence[str], count: int, size: float, seed: int) -> list[Case]:
    """One effect among a tenth of all others."""
    rng = np.random.default_rng([seed, 3])
    possible = [e for e in effects if e != HIDES_ALL]
    mains = rng.permutation(possible)
    drawn = []
    for i in range(count):
        main = str(mains[i % len(mains)])
        sizes = {e: size if e == main else TENTH * size for e in EFFECTS if e != HIDES_ALL}
        drawn.append(Case("messy", *sites[rng.integers(len(sites))], (main,), sizes, 1000 * seed + 200 + i))
    return drawn
