"""Words, units and shares of findings, for joints and couplings alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..diagnose.name.term import DISCRETE
from .findings import Finding

# Shapes of effects at a joint, by what they measure; all others are plain numbers.
POSITIONS = frozenset({"begin", "centre", "end", "gap", "inward", "knee", "period", "reach", "width"})
SPEEDS = frozenset({"stribeck_speed"})
LOADS = frozenset({"turns_at"})
TIMES = frozenset({"cooling_time", "delay", "lag", "relaxation_time", "unseen", "warm_up_time"})


def shape_unit(name: str, position: str, effort: str = "effort") -> str:
    """Unit of an effect's shape at a joint whose position and effort are in these units."""
    units = {position: POSITIONS, f"{position}/s": SPEEDS, "s": TIMES, effort: LOADS}
    return next((unit for unit, names in units.items() if name in names), "1")


def joint_unit(unit: str, position: str, effort: str) -> str:
    """A unit with the words "effort" and "position" put as the joint has them: "effort s/position" is "N m s/rad" at a
    hinge."""
    below = f"/({effort})" if " " in effort else f"/{effort}"
    return unit.replace("/effort", below).replace("effort", effort).replace("position", position)


def alternatives(
    rivals: Sequence[tuple[str, float]], effect: str, probability: float = 1.0, members: int = 1
) -> tuple[float, tuple[tuple[str, float], ...]]:
    """Probability of an effect, and of each other one, all variants together: that any of them is there, shared out by
    how often each is the best; of the effect, which is the simplest of those that are not told apart, as much as an even
    share at least. rivals: keys "effect/variant@joint" with how often; probability: against nothing; members: of its
    class, itself included."""
    out: dict[str, float] = {}
    for key, share in rivals:
        name, _, _ = named(key)
        if name != effect:
            out[name] = out.get(name, 0.0) + probability * share
    others = sum(out.values())
    mine = max(probability - others, probability / members if members > 1 else 0.0)
    left = min((probability - mine) / others, 1.0) if others > 0 else 1.0
    return mine, tuple(sorted(((name, left * share) for name, share in out.items()), key=lambda item: -item[1]))


def rejection(key: str, reason: str) -> dict[str, str]:
    """What was tried and not taken, as the format has it. key: "effect/variant@joint"."""
    name, variant, joint = named(key)
    return {
        "effect": name,
        **({"variant": variant} if variant else {}),
        **({"where": joint} if joint else {}),
        "reason": reason,
    }


def named(key: str) -> tuple[str, str, str]:
    """Effect, variant and joint of a key "effect/variant@joint"; "" for what it does not say."""
    name, _, joint = key.partition("@")
    effect, _, variant = name.partition("/")
    return effect, variant, joint


def shares(found: Sequence[Finding], declared: Mapping[str, Mapping[str, Any]]) -> list[Finding]:
    """share_of_mismatch as a part of all that could be explained at a joint: what the declared model leaves there
    (declared: joint -> a proof with what it leaves `before` any effect) beyond the sensors' noise. As a part of what is
    explained, whatever is named alone at a joint would be all of it."""
    explained: dict[str, float] = {}
    for f in found:
        explained[f.where["joint"]] = explained.get(f.where["joint"], 0.0) + f.where["share_of_mismatch"]
    beyond = {j: p["before"] ** 2 - (p.get("noise_floor") or 0.0) ** 2 for j, p in declared.items()}
    whole = {j: max(e, beyond.get(j, 0.0), 1e-300) for j, e in explained.items()}
    return [
        replace(f, where={**f.where, "share_of_mismatch": f.where["share_of_mismatch"] / whole[f.where["joint"]]})
        for f in found
    ]


def told_on(metric: str, held_out: Sequence[str]) -> str:
    """A metric with what it was measured on: recordings held out, or, where there are none, those that were fitted."""
    return f"held-out {metric}" if held_out else f"{metric} on what was fitted"


def statement(
    effect: str, variant: str, joint: str, parameters: Mapping[str, Mapping[str, Any]], proof: Mapping[str, Any]
) -> str:
    """One plain sentence: what, where, how much, and what it is worth on recordings held out. parameters: name -> value
    and unit, as in a finding; which form of an effect it is, is no figure."""
    figures = {
        k: f"{v['value']:.4g}{'' if v['unit'] == '1' else ' ' + v['unit']}"
        for k, v in parameters.items()
        if k not in DISCRETE
    }
    listed = ", ".join(f"{k.replace('_', ' ')}{': ' if k[-1].isdigit() else ' '}{v}" for k, v in figures.items())
    metric = told_on(proof["metric"].replace("_", " "), proof["held_out"])
    return (
        f"{joint}: {effect.replace('_', ' ')}{f' ({variant})' if variant else ''}: {listed}; {metric} falls from "
        f"{proof['before']:.4g} to {proof['after']:.4g} {proof['unit']}."
    )
