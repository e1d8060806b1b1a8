"""A fitted swing written as MJCF: the declared parameters and, where they exist, MuJoCo's own attributes for
effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mjcf import find, number, parse, serialise, write_effects
from ..model import RigModel
from ..overrides import body_records, compile_model
from ..patch import _actuator
from .simulation import DECLARED, INDEX, LOW_SPEED, NEUTRAL, PARAMETERS, RIPPLE, Swing

Array = NDArray[np.float64]
# Dry friction is a soft constraint in MuJoCo; left at its defaults a joint creeps while it should stick.
SOLREF, SOLIMP = (0.002, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)


def write_swing(rig: RigModel, swing: Swing, theta: Array) -> bytes:
    """The rig's MJCF with parameters theta (len(PARAMETERS),) of the swing.

    Inertia goes to the joint's armature where the declared bodies hold less than it, else the bodies are scaled.
    Native: inertia, gain, back-EMF, damping, Coulomb friction, quadratic drag. All else: custom/text.
    """
    value = {name: float(theta[i]) for name, i in INDEX.items()}
    joint = rig.joints[0]
    root = parse(rig.xml)
    element = find(root, "joint", joint)
    if value["inertia"] >= swing.bodies:
        element.set("armature", number(value["inertia"] - swing.bodies))
    else:
        element.set("armature", number(0.0))
        _scale_bodies(root, rig, value["inertia"] / swing.bodies)
    effects = {k: v for k, v in value.items() if k not in DECLARED and _matters(k, v, value)}
    drag = effects.pop("drag", 0.0)
    element.set("damping", number(value["damping"], drag) if drag else number(value["damping"]))
    element.set("frictionloss", number(max(value["coulomb"], 1e-9)))
    element.set("solreffriction", number(*SOLREF))
    element.set("solimpfriction", number(*SOLIMP))
    drive = rig.drive(joint)
    if drive is not None and drive.kind == "voltage":
        constant = max(value["back_emf"], 1e-9) / value["gain"]
        motor = _actuator(root, drive.name)
        motor.set("motorconst", number(constant, constant))
        motor.set("resistance", number(constant * drive.gear / value["gain"]))
    kept = [*body_records(rig), *_levels(rig, value["coulomb"])]
    kept += [{"joint": joint, "swing": effects}] if effects else []
    return write_effects(serialise(root), kept)


def _matters(name: str, value: float, all_values: dict[str, float]) -> bool:
    if name in NEUTRAL:
        return any(all_values[k] for k in (RIPPLE if name == "ripple_period" else LOW_SPEED))
    return value != 0.0


def _scale_bodies(root: Any, rig: RigModel, share: float) -> None:
    """Bodies with a share of their inertia about the joint, and the same weight: of a hinge as much larger masses on
    shorter levers (the first moments stay, the second ones shrink: a congruence of the pseudo-inertia, so that such
    bodies exist where the declared ones do), of a slide, which lies level, smaller masses."""
    import mujoco

    model = compile_model(rig)
    data, j = mujoco.MjData(model), model.joint(rig.joints[0]).id
    mujoco.mj_forward(model, data)
    slides = model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE
    for b in range(int(model.jnt_bodyid[j]), model.nbody):
        inertial = find(root, "body", model.body(b).name).find("inertial")
        if inertial is None or model.body_weldid[b] != model.jnt_bodyid[j]:
            continue
        for attribute in {"diaginertia", "fullinertia"} & set(inertial.attrib):
            inertial.set(attribute, number(*(share * float(x) for x in inertial.get(attribute).split())))
        inertial.set("mass", number(float(model.body_mass[b]) * (share if slides else 1.0 / share)))
        if not slides:
            centre = data.xanchor[j] + share * (data.xipos[b] - data.xanchor[j]) - data.xpos[b]
            inertial.set("pos", number(*(data.xmat[b].reshape(3, 3).T @ centre)))


def _levels(rig: RigModel, coulomb: float) -> list[dict[str, Any]]:
    """Coulomb levels of trials that set their own, in the ratio in which they are declared."""
    joint, declared = rig.joints[0], float(compile_model(rig).dof_frictionloss[0])
    given = {
        float(np.atleast_1d(t.set[k])[0]) for t in rig.trials for k in [f"joint:{joint}:frictionloss"] if k in t.set
    }
    if not given or not declared:
        return []
    return [{"joint": joint, "frictionloss_levels": {repr(v): coulomb * v / declared for v in sorted(given)}}]


__all__ = ["PARAMETERS", "write_swing"]
