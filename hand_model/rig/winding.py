"""A drive whose effort falls as it turns faster, in proportion, and of which what it is told is recorded: a motor on a
supply, written down as one."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from .mjcf import number, parse, serialise

# of an actuator, what any kind of it may have
COMMON = ("name", "group", "joint", "jointinparent", "ctrllimited", "ctrlrange", "forcelimited", "forcerange", "gear")


def with_windings(xml: bytes, model: Any, names: Collection[str]) -> bytes:
    """The MJCF in which each actuator of those names (of `model`, compiled from it) that gives g u - b v under control u
    at velocity v is the `dcmotor` that gives the same: its constant k = b / g, its resistance k / g. Others, and
    those with dynamics of their own, stay as they are; where all do, the file does, byte for byte.
    """
    root = parse(xml)
    turned = [e for section in root.iter("actuator") for e in section if e.get("name") in names and _turn(e, model)]
    return serialise(root) if turned else xml


def _turn(element: Any, model: Any) -> bool:
    """Make an actuator's element a `dcmotor`; whether it can be."""
    import mujoco

    a = model.actuator(element.get("name")).id
    gain, (constant, by_position, by_velocity) = float(model.actuator_gainprm[a, 0]), model.actuator_biasprm[a, :3]
    affine = model.actuator_biastype[a] == int(mujoco.mjtBias.mjBIAS_AFFINE)
    fixed = model.actuator_gaintype[a] == int(mujoco.mjtGain.mjGAIN_FIXED)
    plain = model.actuator_dyntype[a] == int(mujoco.mjtDyn.mjDYN_NONE)
    if not (affine and fixed and plain and gain > 0 and by_velocity < 0 and constant == by_position == 0):
        return False
    kept = {key: element.get(key) for key in COMMON if element.get(key) is not None}
    kept["gear"] = number(*model.actuator_gear[a])  # it may stand in a default class
    for what in ("ctrl", "force"):
        if getattr(model, f"actuator_{what}limited")[a]:
            kept[f"{what}range"] = number(*getattr(model, f"actuator_{what}range")[a])
    turns = float(-by_velocity) / gain
    element.tag = "dcmotor"
    element.attrib.clear()
    element.attrib.update({**kept, "motorconst": number(turns, turns), "resistance": number(turns / gain)})
    return True
