"""Which of two coupled joints the other follows: the one that a drive moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from .mjcf import number, parse, serialise


def driven_first(xml: bytes, model: Any) -> bytes:
    """The MJCF with every gear written from its drive on: where a joint without a drive is the second of a straight
    line of an equality, and of the joints that follow it one has a drive, that one is the second and the first follows.
    The equality says the same; what a joint carries is reckoned from its drive on, though. model: the compiled MJCF."""
    import mujoco

    of_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    driven = {int(model.actuator_trnid[a, 0]) for a in range(model.nu) if model.actuator_trntype[a] in of_joint}
    lines = [
        (e, int(model.eq_obj1id[e]), int(model.eq_obj2id[e]))
        for e in range(model.neq)
        if model.eq_type[e] == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj2id[e] >= 0
    ]
    following = {first for _, first, _ in lines}
    turned = {}
    for e, first, second in lines:
        with_drive = [f for _, f, s in lines if s == second and f in driven]
        straight = model.eq_data[e, 1] != 0 and not np.any(model.eq_data[e, 2:5])
        if straight and second not in driven | following and with_drive == [first]:
            turned[model.joint(first).name, model.joint(second).name] = model.eq_data[e, :2]
    if not turned:
        return xml
    root = parse(xml)
    for element in (j for section in root.iter("equality") for j in section.iter("joint")):
        pair = element.get("joint1"), element.get("joint2")
        if pair in turned:
            offset, slope = (float(c) for c in turned[pair])
            element.set("joint1", pair[1])
            element.set("joint2", pair[0])
            element.set("polycoef", number(-offset / slope, 1.0 / slope, 0.0, 0.0, 0.0))
    return serialise(root)
