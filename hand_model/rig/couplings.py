"""What a coupling between two encoders lacks, and its polynomial beside that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .declared import DeclaredFit
from .findings import NOT_TAKEN, CouplingResidual, Finding
from .model import Coupling, RigModel
from .name.beside import Score
from .name.compete import Step, compete
from .name.problem import Term, pose, solution
from .patch import write_couplings
from .proof import Bench, term_records
from .standing import in_the_end, proved
from .transmission import angle_residual, coupling_candidates, fit_coupling, zero_shift
from .words import shares

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


@dataclass(frozen=True)
class CouplingDiagnosis:
    """What a coupling lacks. rejected: what does not hold, and why; lack: error of its angle on recordings held out,
    before and after; polycoef (5,) beside what was found; records: what the file keeps of that."""

    findings: list[Finding]
    rejected: list[dict[str, Any]]
    residual: CouplingResidual
    lack: dict[str, Any]
    polycoef: NDArray[np.float64]
    records: list[dict[str, Any]]


def diagnose_coupling(rig: RigModel, coupling: Coupling, say: Callable[[str], None]) -> CouplingDiagnosis | None:
    """Findings at a coupling that hold on recordings held out; None where an encoder is missing."""
    known = coupling_terms(rig, coupling)
    say(f"{rig.name}: coupling {coupling.name}")
    if known is None:
        return None
    fit, taken, steps, scores, moved = known
    rejected = [{"effect": s.term.candidate.key, "reason": NOT_TAKEN} for s in scores]
    bench = Bench(rig, mujoco=False)
    proofs, kept = proved(bench, fit, list(zip(steps, taken, strict=True)), [], rejected)
    found, kept = in_the_end(bench, (fit, fit), kept, proofs, rejected)
    named = []
    for f in found:
        where = {**f.where, "actuator": None, "signal": "position", "coupling": coupling.name}
        zero = (
            " The zero between the two encoders differs between recordings and was taken out of each." if moved else ""
        )
        named.append(replace(f, where=where, statement=f.statement + zero))
    declared = {f.where["joint"]: f.fit for f in reversed(named)}  # the first was held to nothing else
    residual, theta = angle_residual(rig, coupling, fit, kept), solution(pose(fit), kept)
    before, after = (float(np.sqrt(np.mean(side**2))) for side in (residual.before, residual.after))
    lack = {"metric": "angle_rmse", "unit": residual.unit, "before": before, "after": after, "engine": bench.engine}
    records = [{"coupling": coupling.name, **record} for record in term_records(kept, theta[len(fit.columns) :])]
    return CouplingDiagnosis(
        shares(named, declared), rejected, residual, lack, theta[: len(coupling.polycoef)], records
    )
