"""What a coupling between two encoders lacks, and its polynomial beside that."""

from __future__ import annotations

from dataclasses import replace

from .declared import DeclaredFit
from .model import Coupling, RigModel
from .name.beside import Score
from .name.compete import Step, compete
from .name.problem import Term, pose, solution
from .patch import write_couplings
from .transmission import coupling_candidates, fit_coupling, zero_shift

Known = tuple[DeclaredFit, tuple[Term, ...], tuple[Step, ...], tuple[Score, ...], bool]


def with_couplings(rig: RigModel) -> RigModel:
    """The rig with its couplings' polynomials fitted to the encoders, beside what the couplings lack: what follows
    projects efforts through them, and a polynomial that has bent to lost motion or stretch would make loads out of
    nothing."""
    couplings, values = [], {}
    for c in rig.couplings:
        known = coupling_terms(rig, c)
        values[c.name] = c.polycoef if known is None else solution(pose(known[0]), known[1])[: len(c.polycoef)]
        couplings.append(replace(c, polycoef=values[c.name]))
    return replace(rig, couplings=tuple(couplings), xml=write_couplings(rig.xml, values)) if couplings else rig


def coupling_terms(rig: RigModel, coupling: Coupling) -> Known | None:
    """The coupling's balance, the terms it lacks, their rounds, all scores of the last round, and whether recordings
    have zeros of their own; None where an encoder is missing."""
    fit = fit_coupling(rig, coupling)
    if fit is None:
        return None
    result = compete(pose(fit), coupling_candidates(fit, coupling))
    moved = zero_shift(fit, solution(pose(fit), result[0]), result[0])
    if moved is not None:
        fit = moved
        result = compete(pose(fit), coupling_candidates(fit, coupling))
    return fit, *result, moved is not None
