"""Recordings that follow one and the same path: what is tied to position there is one load along it, whatever pieces it
is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .findings import Finding
from .model import RigModel
from .states import fill_gaps

Array = NDArray[np.float64]
TIED_TO_POSITION = frozenset({"nonlinear_spring", "end_stop_contact", "detent_load", "torque_ripple"})
# of a joint that others move: along one path a load tied to its position is as well a weight elsewhere
ELSEWHERE = "gravity_load"


def repeated_trajectory(rig: RigModel) -> bool:
    """Whether every validation recording follows a training recording so closely (1 % of the range) that it repeats
    it."""

    def path(trial: Any, joint: str) -> Array:
        q = fill_gaps(trial.time_s, trial.position[joint])
        return np.interp(np.linspace(0, trial.time_s[-1], 200), trial.time_s, q)

    def same(a: Any, b: Any) -> bool:
        return all(
            np.std(path(a, j) - path(b, j)) < 0.01 * np.ptp(path(a, j))
            for j in rig.joints
            if j in a.position and j in b.position
        )

    held = rig.select(True)
    return bool(held) and all(any(same(v, t) for t in rig.select(False)) for v in held)


def one_load_each(found: Sequence[Finding]) -> list[Finding]:
    """The findings with all loads that are tied to a joint's position as one at each joint, named by the first of them:
    along one path a spring, a stop or a ripple beside it bends the same unknown curve, and a weight elsewhere would be
    any of them. What is written into the file stays."""
    pieces = {f.where["joint"]: [g for g in found if g.where["joint"] == f.where["joint"] and _tied(g)] for f in found}
    return [
        _together(pieces[f.where["joint"]]) if _tied(f) else f
        for f in found
        if not _tied(f) or f is pieces[f.where["joint"]][0]
    ]


def _tied(finding: Finding) -> bool:
    told = all(finding.fit.get(k) is not None for k in ("before", "after", "ci95_reduction"))
    return told and finding.effect in TIED_TO_POSITION and finding.where["signal"] == "effort"


def _together(pieces: Sequence[Finding]) -> Finding:
    """One finding of several at a joint: shares, falls and ends of their intervals (at the widest) add up; parameters
    of the later ones are numbered."""
    first, fit = pieces[0], pieces[0].fit
    members = [*first.members, *(m for p in pieces for m in p.members if m in TIED_TO_POSITION), ELSEWHERE]
    falls = sum(p.fit["before"] ** 2 - p.fit["after"] ** 2 for p in pieces)
    ends = np.sum([p.fit["ci95_reduction"] for p in pieces], 0)
    parameters = {
        k if not i else f"{p.effect}_{i + 1}_{k}": v for i, p in enumerate(pieces) for k, v in p.parameters.items()
    }
    return replace(
        first,
        members=tuple(dict.fromkeys(members)),
        parameters=parameters,
        where={**first.where, "share_of_mismatch": sum(p.where["share_of_mismatch"] for p in pieces)},
        fit={
            **fit,
            "after": float(np.sqrt(max(fit["before"] ** 2 - falls, 0.0))),
            "ci95_reduction": [float(x) for x in ends],
        },
        statement=" Along the same path, as part of the same load: ".join(p.statement for p in pieces),
    )
