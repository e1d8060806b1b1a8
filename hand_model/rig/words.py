"""Words and shares of findings, for joints and couplings alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from .findings import Finding


def shares(found: Sequence[Finding]) -> list[Finding]:
    """share_of_mismatch as a part of what all findings of the same joint explain."""
    total: dict[str, float] = {}
    for f in found:
        total[f.where["joint"]] = total.get(f.where["joint"], 0.0) + f.where["share_of_mismatch"]
    return [replace(f, where={**f.where, "share_of_mismatch": f.where["share_of_mismatch"] / max(total[f.where["joint"]], 1e-300)})
            for f in found]  # fmt: skip


def statement(effect: str, variant: str, joint: str, parameters: Mapping[str, float], proof: Mapping[str, Any]) -> str:
    """One plain sentence: what, where, how much, and what it is worth on recordings held out."""
    listed = ", ".join(f"{k.replace('_', ' ')}{': ' if k[-1].isdigit() else ' '}{v:.4g}" for k, v in parameters.items())
    return (f"{joint}: {effect.replace('_', ' ')}{f' ({variant})' if variant else ''}: {listed}; held-out "
            f"{proof['metric'].replace('_', ' ')} falls from {proof['before']:.4g} to {proof['after']:.4g} {proof['unit']}.")  # fmt: skip
