"""What the laboratory changed between recordings, applied to a compiled model: "kind:name:attribute" = value.

A trial's own body (another weight, a longer arm) is the declared one with that change; what a fit has moved the body by
since (the arm's own mass) stays: a patched file keeps the bodies as they were declared in `custom/text`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import SessionError
from .dynamics import inertial_parameters
from .mjcf import read_effects
from .physical import physical

if TYPE_CHECKING:
    from .model import RigModel, RigTrial

BODY = ("mass", "inertia", "ipos", "iquat")
VIEW = {("body", "diaginertia"): "inertia", ("joint", "ref"): "qpos0", ("joint", "springref"): "qpos_spring"}
# Attributes that MuJoCo keeps in vectors with others.
PLACE = {
    "kp": (("gainprm", 0, 1.0), ("biasprm", 1, -1.0)),
    "kv": (("biasprm", 2, -1.0),),
    "resistance": (("gainprm", 0, 1.0),),
}


def apply_overrides(
    model: Any, overrides: Mapping[str, Any], declared: Mapping[str, Any] | None = None, bodies: bool = True
) -> None:
    """Set the overrides on a compiled mjModel.

    declared: body -> (10,) inertial parameters as first declared, where the file's differ (a fitted file); bodies:
    False leaves mass, centre and inertia of bodies as the file has them. Raises SessionError where an override names
    nothing in the model, or its value does not fit.
    """
    import mujoco

    before = inertial_parameters(model)
    moved = set()
    for key, value in overrides.items():
        kind, _, rest = key.partition(":")
        name, _, attribute = rest.partition(":")
        attribute = VIEW.get((kind, attribute), attribute)
        if kind == "body" and attribute in BODY:
            if not bodies:
                continue
            moved.add(name)
        try:
            _assign(model, kind, name, attribute, value)
        except (AttributeError, KeyError):
            raise SessionError(f'set "{key}": the model has no such {kind} or attribute') from None
        except (ValueError, TypeError):
            raise SessionError(f'set "{key}" = {value!r}: the attribute does not take this value') from None
    for name in moved & set(declared or {}):
        b = model.body(name).id
        _set_body(model, b, inertial_parameters(model)[b - 1] + before[b - 1] - np.asarray(declared[name]))
    if moved:
        mujoco.mj_setConst(model, mujoco.MjData(model))


def compile_model(rig: RigModel, trial: RigTrial | None = None, bodies: bool = True) -> Any:
    """The rig's mjModel, with a trial's overrides applied (of bodies only where `bodies`)."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(rig.xml.decode())
    if trial is not None and trial.set:
        declared = next((r["bodies"] for r in read_effects(rig.xml) if "bodies" in r), None)
        apply_overrides(model, trial.set, declared, bodies)
    return model


def _assign(model: Any, kind: str, name: str, attribute: str, value: Any) -> None:
    if kind == "option":
        if np.ndim(getattr(model.opt, name)) == 0:
            setattr(model.opt, name, value)
        else:
            getattr(model.opt, name)[:] = value
        return
    view = getattr(model, kind)(name)
    if kind == "actuator" and attribute in PLACE:
        for vector, at, sign in PLACE[attribute]:
            getattr(view, vector)[at] = sign * float(np.atleast_1d(value)[0])
        return
    target = getattr(view, attribute)
    given = np.atleast_1d(np.asarray(value, float))
    target[: len(given)] = given  # MJCF leaves out trailing entries (gear)


def _set_body(model: Any, b: int, parameters: Any) -> None:
    """Mass, centre and inertia of body b from parameters (10,), the nearest that a body can have."""
    mass, centre, inertia = physical(parameters)
    level, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    model.body_mass[b], model.body_ipos[b], model.body_inertia[b] = mass, centre, level
    import mujoco

    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    model.body_iquat[b] = quat
    model.body_sameframe[b] = 0


def body_records(rig: RigModel) -> list[dict[str, Any]]:
    """The bodies that trials override, as declared, for a file whose bodies are fitted; none where no trial does."""
    names = sorted({n for t in rig.trials for n in body_names(t.set)})
    if not names:
        return []
    model = compile_model(rig)
    return [{"bodies": {n: [float(x) for x in inertial_parameters(model)[model.body(n).id - 1]] for n in names}}]


def body_names(overrides: Mapping[str, Any]) -> frozenset[str]:
    """Bodies whose mass, centre or inertia the overrides change."""
    parts = (key.split(":") for key in overrides)
    return frozenset(p[1] for p in parts if len(p) == 3 and p[0] == "body" and VIEW.get(("body", p[2]), p[2]) in BODY)


__all__ = ["apply_overrides", "body_names", "body_records", "compile_model"]
