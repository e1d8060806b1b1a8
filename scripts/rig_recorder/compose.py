"""Sets of sessions: which machine hides what, and the answers, kept apart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .chains import arm, brake, stages
from .machines import Made, hinge, servo, slide, swing

Machine = Callable[[Path, tuple[str, ...], str, np.random.Generator], Made]
TORQUE = (
    "load_dependent_friction",
    "stribeck_friction",
    "asymmetric_viscous_friction",
    "quadratic_damping",
    "elastoplastic_hysteresis",
    "asymmetric_friction",
    "late_channel",
)
# Machine -> (recorder, effects that it can hide, those beyond the vocabulary, faults of its channel).
MACHINES: dict[str, tuple[Machine, tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    "hinge": (hinge, (*TORQUE, "load_dependent_friction"), ("outside_grit", "outside_slosh"), ("command", "dead", "unsigned", "clipped")),
    "slide": (slide, ("asymmetric_viscous_friction", "stribeck_friction", "position_dependent_friction", "elastoplastic_hysteresis", "quadratic_damping",
                      "detent_load", "late_channel"), ("outside_grit",), ("unsigned", "dead")),
    "servo": (servo, ("load_dependent_friction", "load_dependent_friction", "stribeck_friction", "off_axis", "drive_sag", "late_drive"), ("outside_grit",), ()),
    "swing": (swing, ("quadratic_damping", "stribeck_friction"), ("outside_slosh",), ()),
    "arm": (arm, ("load_dependent_friction", "stribeck_friction", "asymmetric_friction", "quadratic_damping", "asymmetric_viscous_friction"), (), ("unsigned", "dead")),
    "stages": (stages, ("load_dependent_friction", "elastoplastic_hysteresis", "drive_backlash", "series_elasticity"), (), ()),
    "brake": (brake, ("elastoplastic_hysteresis", "elastoplastic_hysteresis", "stribeck_friction"), (), ()),
}  # fmt: skip
KINDS = ("one", "one", "two", "none", "one", "two", "fault", "outside")


def make_set(folder: Path, seed: int, cases: int) -> dict[str, dict[str, Any]]:
    """Sessions in `folder`; their answers by name: machine, kind, effects, fault and the true laws."""
    random, answers = np.random.default_rng(seed), {}
    order = [name for _ in range(cases) for name in random.permutation(list(MACHINES))][:cases]
    kinds = random.permutation([KINDS[k % len(KINDS)] for k in range(cases)])
    for k, (machine, kind) in enumerate(zip(order, kinds, strict=True)):
        make, known, beyond, faults = MACHINES[str(machine)]
        kind = "one" if (kind == "fault" and not faults) or (kind == "outside" and not beyond) else str(kind)
        count = {"one": 1, "two": 2, "outside": 0, "none": 0, "fault": 0}[kind]
        effects = tuple(str(e) for e in random.choice(sorted(set(known)), count, replace=False, p=_weights(known)))
        effects = (str(random.choice(beyond)),) if kind == "outside" else effects
        fault = str(random.choice(faults)) if kind == "fault" else ""
        name = f"rig_{k:02d}"
        made = make(folder / name, effects, fault, np.random.default_rng([seed, k]))
        answers[name] = {
            "machine": str(machine),
            "kind": kind,
            "effects": list(effects),
            "fault": fault,
            "law": made.law,
            "late_s": made.late_s,
            "extra": made.extra or {},
        }
    return answers


def _weights(known: tuple[str, ...]) -> list[float]:
    return [known.count(e) / len(known) for e in sorted(set(known))]
