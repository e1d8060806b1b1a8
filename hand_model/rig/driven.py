"""Equalities between joints, and which of two follows the other: the one that no drive moves."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mjcf import number, parse, serialise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coupling:
    """An equality between joints: `dependent` = polynomial of `independent`, coefficients ascending (MuJoCo
    polycoef)."""

    name: str
    dependent: str
    independent: str
    polycoef: Array


def couplings_of(model: Any) -> tuple[Coupling, ...]:
    """The equalities between two joints of a compiled MJCF."""
    import mujoco

    return tuple(
        Coupling(
            model.equality(e).name,
            model.joint(int(model.eq_obj1id[e])).name,
            model.joint(int(model.eq_obj2id[e])).name,
            np.array(model.eq_data[e, :5], float),
        )
        for e in range(model.neq)
        if model.eq_type[e] == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj2id[e] >= 0
    )


def driven_first(xml: bytes, couplings: Sequence[Coupling], driven: Collection[str]) -> bytes:
    """The MJCF with every gear written from its drive on: where a joint without a drive is the second of a straight
    line of an equality, and of the joints that follow it one has a drive, that one is the second and the first follows.
    The equality says the same; what a joint carries is reckoned from its drive on, though. couplings: of the MJCF;
    driven: joints that have a drive."""
    fixed = {*driven, *(c.dependent for c in couplings)}
    turned = {
        (c.dependent, c.independent): c.polycoef
        for c in couplings
        if c.independent not in fixed and _leads(c, couplings, driven)
    }
    if not turned:
        return xml
    root = parse(xml)
    for element in (j for section in root.iter("equality") for j in section.iter("joint")):
        pair = element.get("joint1"), element.get("joint2")
        if pair in turned:
            offset, slope = (float(c) for c in turned[pair][:2])
            element.set("joint1", pair[1])
            element.set("joint2", pair[0])
            element.set("polycoef", number(-offset / slope, 1.0 / slope, 0.0, 0.0, 0.0))
    return serialise(root)


def _leads(coupling: Coupling, couplings: Sequence[Coupling], driven: Collection[str]) -> bool:
    """Whether a straight line's dependent joint is the only one with a drive that follows its independent one."""
    with_drive = [c.name for c in couplings if c.independent == coupling.independent and c.dependent in driven]
    straight = coupling.polycoef[1] != 0 and not np.any(coupling.polycoef[2:])
    return bool(straight) and coupling.dependent in driven and len(with_drive) == 1
