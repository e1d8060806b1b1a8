"""Words and shares of findings, for joints and couplings alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from .findings import Finding


def shares(found: Sequence[Finding], declared: Mapping[str, Mapping[str, Any]]) -> list[Finding]:
    """share_of_mismatch as a part of all that could be explained at a joint: what the declared model leaves there (declared: joint -> a
    proof with what it leaves `before` any effect) beyond the sensors' noise. As a part of what is explained, whatever is named
    alone at a joint would be all of it."""
    explained: dict[str, float] = {}
    for f in found:
        explained[f.where["joint"]] = explained.get(f.where["joint"], 0.0) + f.where["share_of_mismatch"]
    beyond = {j: p["before"] ** 2 - (p.get("noise_floor") or 0.0) ** 2 for j, p in declared.items()}
    whole = {j: max(e, beyond.get(j, 0.0), 1e-300) for j, e in explained.items()}
    return [replace(f, where={**f.where, "share_of_mismatch": f.where["share_of_mismatch"] / whole[f.where["joint"]]}) for f in found]


def statement(effect: str, variant: str, joint: str, parameters: Mapping[str, float], proof: Mapping[str, Any]) -> str:
    """One plain sentence: what, where, how much, and what it is worth on recordings held out."""
    listed = ", ".join(f"{k.replace('_', ' ')}{': ' if k[-1].isdigit() else ' '}{v:.4g}" for k, v in parameters.items())
    return (f"{joint}: {effect.replace('_', ' ')}{f' ({variant})' if variant else ''}: {listed}; held-out "
            f"{proof['metric'].replace('_', ' ')} falls from {proof['before']:.4g} to {proof['after']:.4g} {proof['unit']}.")  # fmt: skip
