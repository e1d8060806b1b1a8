"""What a follower goes by in a loaded model: the inputs and maps between it and its driver, as `input` writes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .input import MAPPED, SUFFIX


def map_to(model: Any, follower: int) -> int | None:
    """The equality that moves a joint; None where none does."""
    import mujoco

    rows = np.flatnonzero((model.eq_obj1id == follower) & (model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)))
    return int(rows[0]) if len(rows) else None


def source(model: Any, joint: int) -> int:
    """The joint behind a chain of inputs and maps."""
    joint = behind_inputs(model, joint)
    row = map_ahead(model, joint)
    return joint if row is None else source(model, int(model.eq_obj2id[row]))


def map_ahead(model: Any, joint: int) -> int | None:
    """The equality that moves a joint of a map's own, ahead of what lies behind that map; None where it is none."""
    return map_to(model, joint) if MAPPED in model.joint(joint).name else None


def behind_inputs(model: Any, joint: int) -> int:
    """The joint that an input joint follows, over any number of inputs."""
    for _, tendon in inputs(model, joint):
        joint = int(model.wrap_objid[model.tendon_adr[tendon]])
    return joint


def inputs(model: Any, joint: int) -> Iterator[tuple[int, int]]:
    """Inputs from a joint on, towards the driver, each with the tendon by which it follows the next."""
    while SUFFIX in model.joint(joint).name:
        tendon = next(
            t
            for t in range(model.ntendon)
            if model.wrap_objid[model.tendon_adr[t] + 1] == joint and model.tendon_num[t] == 2
        )
        yield joint, tendon
        joint = int(model.wrap_objid[model.tendon_adr[tendon]])
