"""Fitted numbers and named effects written into the rig's MJCF.

What MuJoCo has an attribute for goes there. The rest is kept in the same file, as JSON in
`custom/text[@name="hand_model"]`. Records with "swing" are applied by `stepper.EffectStepper` while MuJoCo steps;
records with "effect" and "amplitude" are columns at the recorded motion, added by `inverse.effort_residuals` to what
mj_inverse says, and in open loop laws that the stepper applies, where `laws.law` has one; "cutoff_hz" is the filter of
that balance;
"frictionloss_levels" are Coulomb levels of trials that set their own; "bodies" are those that trials override, as
declared.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError
from .balance import Column
from .dynamics import INERTIAL, inertial_parameters
from .mjcf import find, number, parse, serialise
from .model import RigModel
from .overrides import compile_model
from .physical import physical

Array = NDArray[np.float64]


def write_declared(rig: RigModel, columns: Sequence[Column], theta: Array) -> bytes:
    """The rig's MJCF with the fitted declared parameters (theta (P,) of columns) in place of the starting values."""
    root = parse(rig.xml)
    model = compile_model(rig)
    values = {(c.kind, c.name, c.part): float(t) for c, t in zip(columns, theta, strict=True)}
    _write_bodies(root, model, values)
    for (kind, name, part), value in values.items():
        if kind in ("armature", "damping", "frictionloss", "stiffness") and not part:
            find(root, "joint", name).set(kind, number(value))
        elif kind == "offset":
            drive = _actuator(root, name)
            drive.set("biasprm", number(value, 0.0, 0.0))
        elif kind == "spring":
            _tendon(root, name).set("stiffness", number(value))
        elif kind == "back_emf":
            gain = next(d for d in rig.drives if d.name == name)
            constant = max(value, 1e-12) / abs(gain.gain)
            _actuator(root, name).set("motorconst", number(constant, constant))
            _actuator(root, name).set("resistance", number(constant * abs(gain.gear) / abs(gain.gain)))
    return serialise(root)


def _actuator(root: Any, name: str) -> Any:
    for section in root.iter("actuator"):
        for element in section:
            if element.get("name") == name:
                return element
    raise DescriptionError(f'the rig\'s MJCF has no actuator "{name}"')


def _tendon(root: Any, name: str) -> Any:
    for section in root.iter("tendon"):
        for element in section:
            if element.get("name") == name:
                return element
    raise DescriptionError(f'the rig\'s MJCF has no tendon "{name}"')


def _write_bodies(root: Any, model: Any, values: Mapping[tuple[str, str, str], float]) -> None:
    """Mass, centre and inertia of every body whose parameters were fitted, kept physical."""
    declared = inertial_parameters(model)
    for b in range(1, model.nbody):
        name = model.body(b).name
        p = declared[b - 1].copy()
        for i, part in enumerate(INERTIAL):
            p[i] = values.get(("inertial", name, part), p[i])
        if np.allclose(p, declared[b - 1], rtol=1e-12, atol=0):
            continue
        body = find(root, "body", name)
        inertial = body.find("inertial")
        if inertial is None:
            continue
        mass, centre, inertia = physical(p)
        inertial.set("mass", number(mass))
        inertial.set("pos", number(*centre))
        for attribute in ("diaginertia", "fullinertia", "quat", "euler", "axisangle"):
            inertial.attrib.pop(attribute, None)
        if np.allclose(inertia, np.diag(np.diag(inertia)), atol=1e-12 * np.trace(inertia)):
            inertial.set("diaginertia", number(*np.diag(inertia)))
        else:
            i = inertia
            inertial.set("fullinertia", number(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]))


def write_couplings(xml: bytes, polycoef: Mapping[str, Array]) -> bytes:
    """The MJCF with the polynomials (5,) of named equality joints."""
    root = parse(xml)
    for section in root.iter("equality"):
        for element in section:
            if element.get("name") in polycoef:
                element.set("polycoef", number(*polycoef[element.get("name")]))
    return serialise(root)
