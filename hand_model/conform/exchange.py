"""Joints that stand under each other's names: swaps of the pairing that make more axes coincide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .align import Alignment, align
from .coincidence import LEVER, line_cost
from .features import Features, features
from .pairing import Pairing, owner
from .tree import Array, Tree

COINCIDES = 14.4
"""Cost of two lines 0.15 mm apart (see `line_cost`)."""


def exchange(
    f: Features, pairing: Pairing, a: Tree, b: Tree, start: Alignment | None = None
) -> tuple[Pairing, Features, Alignment]:
    """Look for joints that stand under each other's names: swaps that make more lines coincide, the best first.

    Whole fingers are tried before single joints. Returns the pairing, its features and its alignment after all swaps
    that help.
    start: the alignment under the pairing, where it is known already.
    """
    current, best = pairing, start or align(f)
    for _ in range(len(f.names)):
        wrong = [
            k for k, fit in enumerate(best.fits) if LEVER * fit.angle_rad + fit.shift > 1e-4 or abs(fit.offset) > 1e-2
        ]
        trials = []
        for swap in _swaps(f, best, wrong):
            named = dict(f.names)
            keys = [f.names[i][0] for i in swap]
            for i, j in swap.items():
                named[f.names[i][0]] = f.names[j][1]
            links = _relinked(current, a, b, keys, named)
            trial = replace(current, joints=tuple(named.items()), links=links)
            g = features(a, b, trial)
            trials.append((align(g), trial, g))
        if not trials:
            break
        top = min(trials, key=lambda t: t[0].cost)
        if top[0].cost > best.cost - 4.0:
            break
        best, current, f = top
    return current, f, best


def _swaps(f: Features, at: Alignment, wrong: list[int]) -> list[dict[int, int]]:
    """Swaps worth a trial: two like subtrees, or two joints whose lines fit better the other way round."""
    spoilt = set(wrong).union(*(f.below(k) for k in wrong))

    def trusted(k: int) -> Array:
        """The transform of the nearest link towards the base that nothing spoils."""
        while (k := f.parent[k]) >= 0:
            if k not in spoilt:
                return at.fits[k].carry
        return at.base

    out, suspects = [], sorted(spoilt)
    tables: dict[bytes, Array] = {}

    def against(k: int) -> Array:
        """Cost (k,) of a's line k against every line of b, under the transform that k's surroundings trust."""
        carry = trusted(k)
        key = carry.tobytes()
        if key not in tables:
            every = list(range(len(f.names)))
            tables[key] = np.stack([line_cost(f, carry, [i] * len(every), every) for i in every])
        return tables[key][k]

    for n, i in enumerate(suspects):
        for j in suspects[n + 1 :]:
            crossed, straight = (against(i)[j], against(j)[i]), against(i)[i] + against(j)[j]
            if f.slide[i] != f.slide[j] or min(crossed) >= COINCIDES or sum(crossed) >= straight - 2:
                continue
            out.append({i: j, j: i})
            chain_i, chain_j = [i, *f.below(i)], [j, *f.below(j)]
            if f.parent[i] == f.parent[j] and len(chain_i) == len(chain_j) > 1:
                out.append({**dict(zip(chain_i, chain_j, strict=True)), **dict(zip(chain_j, chain_i, strict=True))})
    return out


def _relinked(
    pairing: Pairing, a: Tree, b: Tree, keys: list[str], named: dict[str, str]
) -> tuple[tuple[str, str], ...]:
    """Links that hang on re-paired joints follow them; tips and sites that found no new partner are left out."""
    before = dict(pairing.joints)
    by_owner: dict[str, list[tuple[str, str]]] = {}
    for x, y in pairing.links:
        by_owner.setdefault(owner(a, a.node_of_link(x)) or "", []).append((x, y))
    out = []
    holder = {v: k for k, v in before.items()}
    for key, rows in by_owner.items():
        if key not in keys:
            out += rows
            continue
        partner_rows = by_owner.get(holder.get(named[key], ""), [])
        out += [(x, y) for (x, _), (_, y) in zip(rows, partner_rows, strict=False)]
    return tuple(out)
