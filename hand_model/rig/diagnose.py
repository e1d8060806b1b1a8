"""What a rig's declared model lacks: channels first, then couplings, then every joint; each claim on held-out
trials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..background import single_threaded
from ..diagnose.findings import of_one_whole
from ..errors import HandModelError, SessionError
from ..output import refuse_file
from ..session import Session
from .channel_findings import channel_findings
from .channels import ChannelIssue, check_balance, check_channels
from .clipping import unclipped
from .couplings import diagnose_coupling, with_couplings
from .declared import DeclaredFit, fit_declared
from .findings import NOT_TAKEN, Finding, RigFindings, measured, whereabouts, within_a_sample
from .horizon import open_loop
from .mjcf import keep_couplings
from .model import RigModel, load_rig
from .name.beside import Beside, Score
from .name.candidates import OFFSET, RIPPLE, Candidate, candidates
from .name.compete import LEAST_SHARE, Step, judge
from .name.joint_search import Won, as_term, offsets_first, offsets_of_chain, search_joints
from .name.problem import Term, held_out, normal, pose, solution
from .noise import effort_noise
from .patch import write_couplings
from .proof import Bench
from .rest_known import known_at_rest
from .same_path import one_load_each, repeated_trajectory
from .standing import first_of, in_the_end, proved, solved
from .swing.build import can_swing
from .swing.diagnose import diagnose_swing
from .verdict import accuracy_notes, accurate, limit, unexplained, verdict
from .words import rejection, shares, told_on

Array = NDArray[np.float64]
# loads that a weight elsewhere gives at the postures of one recording or another
BY_PLACE = frozenset({OFFSET, RIPPLE, "detent_load", "nonlinear_spring"})
PROBABILITY = (
    "that anything is there: share of resampled blocks of the training recordings, each left out of the fit, on which "
    "the effect lowers the error against nothing; shared out among it and its alternatives by how often each is the best"
)


@single_threaded()
def diagnose_rig(
    session: Session,
    output: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
    model: bool = True,
) -> RigFindings:
    """Diagnose a rig session; with `output`, also write findings.json there and, with `model`, the improved rig.xml.

    Raises SessionError or DescriptionError where the session or its MJCF cannot be read, HandModelError for an output
    that is a file or the session's own folder, whose model would be lost.
    """
    if output is not None:
        refuse_file(output)
        if Path(output).resolve() == session.path.resolve():
            raise HandModelError(
                f"{output}: is the session itself, whose model would be written over; name another folder"
            )
    say = progress or (lambda _: None)
    recorded = with_couplings(load_rig(session))
    rig, told = unclipped(recorded), check_channels(recorded)
    if not rig.select(validate=False):
        raise SessionError(f'{session.path}: every trial has purpose = "validate"; at least one must be left to fit to')
    fit, issues = trusted_fit(rig, told)
    found = channel_findings(recorded, fit, issues)
    refused = {(t, i.joint) for i in issues if i.refuse for t in i.trials}
    say(f"{rig.name}: declared model fitted, {len(issues)} channel issues")
    if can_swing(rig) and not refused:
        result = diagnose_swing(rig, session, fit, say)
    else:
        result = _diagnose_balance(rig, fit, say)
        result[2]["open_loop"] = open_loop(rig, result[4], result[3], refused)
    parts, rejected, lack, xml, declared_xml = result
    found += parts
    fitted = replace(rig, xml=xml)  # what goes through a coupling without a sensor is what its bodies ask for
    couplings = [c for c in (diagnose_coupling(fitted, c, say) for c in rig.couplings) if c is not None]
    for coupling in couplings:
        found += coupling.findings
        rejected = [*rejected, *coupling.rejected]
    if couplings:
        lack = {**lack, "couplings": {c.residual.coupling: c.lack for c in couplings}}
        xml = write_couplings(xml, {c.residual.coupling: c.polycoef for c in couplings})
        xml = keep_couplings(xml, [record for c in couplings for record in c.records])
    found, within = within_a_sample(found, 1.0 / _rate(rig))
    lack, well_known = {**lack, "limit": limit(lack)}, accurate(fit)
    declared = lack.pop("declared", {c.label: float(t) for c, t in zip(fit.columns, fit.theta, strict=True)})
    left = unexplained(lack, found, well_known)
    again = repeated_trajectory(rig)
    found = one_load_each(found) if again and len(rig.joints) > 1 else found
    ranked, left = of_one_whole(sorted(found, key=_rank), left)
    findings = RigFindings(
        session=rig.name,
        verdict=verdict(found, lack, well_known),
        lack_of_fit=lack,
        protocol={
            "repeats": len(rig.select(False)),
            "rate_hz": _rate(rig),
            "speeds": None,
            "isolable": [],
            "held_out": [t.name for t in rig.select(True)],
            "held_out_repeats_the_training_trajectory": again,
            "probability": PROBABILITY,
            "not_isolable": [list(f.members) for f in found if len(f.members) > 1],
        },
        findings=ranked,
        rejected=tuple(rejection(r["effect"], r["reason"]) for r in rejected),
        unexplained=left,
        next_experiment=_next(found, issues, again),
        declared=declared,
        xml=xml,
        declared_xml=declared_xml,
        couplings=tuple(c.residual for c in couplings),
        notes=(
            *rig.notes,
            *_silence(rig, fit, found),
            *_unproved(rig),
            *_lost(lack),
            *within,
            *accuracy_notes(lack, found, well_known),
        ),
    )
    if output is not None:
        findings.write(output, model)
    return findings


def _silence(rig: RigModel, fit: DeclaredFit, found: Sequence[Finding]) -> tuple[str, ...]:
    """Why no effort of the rig could be balanced, where none could."""
    if fit.rows or can_swing(rig):
        return ()
    untold = rig.untold()
    if found:
        return (f"efforts were not analysed: {untold}",) if rig.drives and untold else ()
    return (f"nothing could be analysed: {untold or 'no joint moves long enough'}",)


def _unproved(rig: RigModel) -> tuple[str, ...]:
    """That errors are not held out, where no recording is."""
    return () if rig.select(True) else ('no trial has purpose = "validate": errors are those of the recordings fitted',)


def _lost(lack: Mapping[str, Any]) -> tuple[str, ...]:
    """Which recordings the simulation left, with the declared model and with effects."""
    sides = {"the declared model": "before", "the effects named": "after"}
    return tuple(
        f"with {model} the motion simulated in open loop leaves {', '.join(trials)}: it counts as off by twice the "
        "recorded range from there on"
        for model, side in sides.items()
        if (trials := lack.get("diverged", {}).get(side))
    )


def _rank(finding: Finding) -> tuple[int, int]:
    """What is refused first, for all else was found without it; then by share of the mismatch, in steps that are worth
    a name (within one in the order found: efforts before angles between encoders); clipped samples that hold none
    last."""
    steps = round(float(finding.where.get("share_of_mismatch") or 0.0) / LEAST_SHARE)
    refused = finding.effect == "command_as_measurement" and finding.model is None
    return 0 if refused else 1 if finding.model is not None or steps else 2, -steps


def trusted_fit(
    rig: RigModel, told: tuple[ChannelIssue, ...] | None = None
) -> tuple[DeclaredFit, tuple[ChannelIssue, ...]]:
    """The declared fit to the channels that can be trusted, and what is wrong with the others; told: what is known of
    that before any fit."""
    issues = list(check_channels(rig) if told is None else told)
    while True:
        refused = {(t, i.joint) for i in issues if i.refuse for t in i.trials}
        fit = fit_declared(rig, refused)
        more = check_balance(rig, fit) if fit.rows else ()
        if not more:
            return fit, tuple(issues)
        issues += more


def _rate(rig: RigModel) -> float:
    return float(1.0 / np.median(np.concatenate([np.diff(t.time_s) for t in rig.trials])))


# --- joints by the balance of effort ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Search:
    """What competition found in a balance. base, fit: the declared fit before and after centres of mass are freed
    (freed: the finding that says so); offsets, stories: rounds and winners, offsets first; left: keys of what was not
    taken; floor: joint -> noise."""

    base: DeclaredFit
    fit: DeclaredFit
    freed: Finding | None
    offsets: list[tuple[Step, Term]]
    stories: list[tuple[Step, Term]]
    left: list[str]
    floor: Mapping[str, float]


def _diagnose_balance(rig: RigModel, fit: DeclaredFit, say: Callable[[str], None]) -> tuple:
    """Findings, rejections, lack of fit, patched and declared MJCF of a rig whose efforts are recorded: of its motion
    alone, or, where what the motion shows says what holds a joint at rest as well, of all that is recorded there."""
    if not fit.rows:
        return [], [], {"metric": None, "before": None, "after": None}, rig.xml, rig.xml
    told, known = _held_out(rig, _searched(rig, fit, say))
    if known:
        say(f"{rig.name}: what holds {', '.join(known)} at rest is known: once more with it")
        told, _ = _held_out(rig, _searched(rig, fit_declared(rig, _refused(rig, fit), kept=known), say))
    return told


def _refused(rig: RigModel, fit: DeclaredFit) -> set[tuple[str, str]]:
    """(trial, joint) that have no balance."""
    return {(t.name, j) for t in rig.trials for j in rig.joints} - {(r.trial, r.joint) for r in fit.rows}


def _searched(rig: RigModel, fit: DeclaredFit, say: Callable[[str], None]) -> _Search:
    """The competition at every joint, on training recordings."""
    joints, floor, base = _balanced(rig, fit), effort_noise(rig, fit), fit
    bench = Bench(rig, floor=floor)
    first = offsets_first(rig, fit, joints)  # a sensor's zero is the recording's error: before physics
    offsets = [(w.step, as_term(rig, fit, w)) for w in first.values() if w is not None]
    freed = _freed(rig, fit)
    off_axis = _off_axis(bench, fit, freed, [t for _, t in offsets])
    if off_axis is None:
        found = _at_joints(rig, fit, first, say)
        off_axis = _off_axis(bench, fit, freed, [t for _, t in (*offsets, *found[0])]) if found[0] else None
        if off_axis is None:
            return _Search(base, fit, None, offsets, *found, floor)
        say(f"{rig.name}: centres of mass off their axes: once more beside them")
    # beside weights where they are declared, offsets and loads by place stood for what these do elsewhere
    fit, finding = off_axis
    first = offsets_of_chain(rig, fit, joints)
    stories, left = _at_joints(rig, fit, first, say)
    chain = [(w.step, as_term(rig, fit, w)) for w in first.values() if w is not None]
    return _Search(base, fit, finding, [], [*chain, *stories], left, floor)


def _at_joints(
    rig: RigModel, fit: DeclaredFit, first: Mapping[str, Won | None], say: Callable[[str], None]
) -> tuple[list[tuple[Step, Term]], list[str]]:
    """What is won at every joint beside its offset, and the keys of what is not."""
    stories: list[tuple[Step, Term]] = []
    rejected: list[str] = []
    for (joint, offset), (won, left) in zip(first.items(), search_joints(rig, fit, first), strict=True):
        stories += [(w.step, as_term(rig, fit, w)) for w in won]
        rejected += left
        say(f"{rig.name}: {joint}: {', '.join(w.key for w in (offset, *won) if w) or 'nothing'}")
    return stories, rejected


def _balanced(rig: RigModel, fit: DeclaredFit) -> list[str]:
    return [j for j in rig.joints if any(r.joint == j for r in fit.rows)]


def _held_out(rig: RigModel, search: _Search) -> tuple[tuple, tuple[str, ...]]:
    """What of a search the validation recordings bear out, as `_diagnose_balance` hands it on, and the joints of which
    it says what holds them at rest."""
    base_fit, fit, bench = search.base, search.fit, Bench(rig, floor=search.floor)
    rejected: list[dict[str, Any]] = [{"effect": key, "reason": NOT_TAKEN} for key in search.left]
    plain = (base_fit, (), solution(pose(base_fit), []))
    proofs, kept = proved(bench, base_fit, search.offsets, [], rejected)
    offsets = len(proofs)
    later, kept = proved(bench, fit, search.stories, kept, rejected)
    found, kept = in_the_end(bench, (base_fit, fit), kept, [*proofs, *later], rejected)
    if search.freed is not None:
        found.insert(min(offsets, len(found)), search.freed)
    one, two, every = ((fit, *solved(bench, fit, first_of(fit, kept, k))) for k in (1, 2, len(kept)))
    lack = {
        "metric": "effort_rmse",
        "unit": "share of the declared model's",
        "before": 1.0,
        "after": bench.ratio(plain, every),
        "one_effect": bench.ratio(plain, one),
        "two_effects": bench.ratio(plain, two),
        "engine": bench.engine,
        "joints": {j: bench.proof(j, plain, every) for j in _balanced(rig, fit)},
    }
    return (shares(found, lack["joints"]), rejected, lack, bench.file(*every), bench.file(*plain)), known_at_rest(
        *every
    )


def _freed(rig: RigModel, fit: DeclaredFit) -> DeclaredFit | None:
    """The declared fit with centres of mass free to lie off their axes; None where all are."""
    freed = fit_declared(rig, _refused(rig, fit), fit.cutoff_hz, off_axis=True, kept=fit.kept)
    return None if len(freed.columns) == len(fit.columns) else replace(freed, scale=fit.scale)


def _off_axis(
    bench: Bench, fit: DeclaredFit, freed: DeclaredFit | None, terms: Sequence[Term]
) -> tuple[DeclaredFit, Finding] | None:
    """Centres of mass off their declared axes, one change to the whole chain, beside terms, or instead of those of them
    that are loads by place where it leaves no more than these do: they may stand in for it."""
    if freed is None:
        return None
    rig = bench.rig
    problem, other = pose(fit), pose(freed)
    errors = [(kept, held_out(other, kept, normal(other, kept))) for kept in _without_stand_ins(terms)]
    kept, error = min(errors, key=lambda side: side[1].sum())
    shape = Candidate(
        "gravity_load", "centres of mass off their axes", "*", (), ({},), lambda r, s: np.zeros((len(r.time_s), 0))
    )
    found = judge(held_out(problem, kept, normal(problem, kept)), [Score(Term(shape, {}), error)], problem)
    if found is None or error.sum() > held_out(problem, terms, normal(problem, terms)).sum():
        return None
    if _better_alone(rig, fit, kept, error.sum()):
        return None
    sides = (problem, terms), (other, kept)
    before, after = (solution(p, t) for p, t in sides)
    joints = sorted({r.joint for r in fit.rows})
    proofs = {j: bench.proof(j, (fit, terms, before), (freed, kept, after)) for j in joints}
    best = max(joints, key=lambda j: 1 - proofs[j]["after"] / max(proofs[j]["before"], 1e-300))
    ratio = float(np.sqrt(np.mean([(p["after"] / p["before"]) ** 2 for p in proofs.values()])))
    if ratio >= 1 or proofs[best]["ci95_reduction"][0] <= 0:
        return None
    moved = {
        c.label: {"value": float(v), "unit": "kg m"}
        for c, v in zip(freed.columns, after)
        if c.kind == "inertial" and c.value == 0
    }
    where = whereabouts(
        best, None, "effort", measured(rig, proofs[best]), proofs[best]["before"] ** 2 - proofs[best]["after"] ** 2
    )
    words = (
        "Centres of mass lie off the axes on which they are declared: "
        f"{told_on('effort error', proofs[best]['held_out'])} falls to {100 * ratio:.0f} % over all joints (most at "
        f"{best}: "
        f"{proofs[best]['before']:.4g} to {proofs[best]['after']:.4g})."
    )
    return freed, Finding(
        "gravity_load",
        ("gravity_load",),
        found[1].probability,
        (),
        where,
        words,
        moved,
        proofs[best],
        {"native": True, "mjcf": "body/inertial/@pos", "urdf": "link/inertial/origin"},
    )


def _without_stand_ins(terms: Sequence[Term]) -> list[list[Term]]:
    """Terms without those that may stand in for weights elsewhere: none where there are offsets alone, which may be as
    well; all loads by place, or all but ripples."""
    if all(t.candidate.effect == OFFSET for t in terms):
        return [list(terms)]
    return [[t for t in terms if t.candidate.effect not in some] for some in (BY_PLACE, BY_PLACE - {RIPPLE})]


def _better_alone(rig: RigModel, fit: DeclaredFit, terms: Sequence[Term], error: float) -> bool:
    """Whether any effect at one joint leaves less held-out error than `error` of a change to the whole chain."""
    problem, beside = pose(fit), tuple(terms)
    parts = normal(problem, beside)
    for joint in dict.fromkeys(r.joint for r in fit.rows):
        with Beside(problem, beside, parts, candidates(rig, fit, joint), len(beside)) as rivals:
            if any(s.error.sum() < error for s in rivals.scores()):
                return True
    return False


def _next(found: Sequence[Finding], issues: Sequence[ChannelIssue], again: bool) -> str:
    if any(i.refuse for i in issues):
        return "record the torque that the drive measures (phase current), not the one that it is asked for"
    if again:
        return (
            "record another trajectory: the held-out recording repeats the fitted one, "
            "so what is tied to time or place passes"
        )
    for f in found:
        if len(f.members) > 1:
            return (
                "repeat the motion at other speeds and loads: that separates "
                f"{', '.join(f.members[:-1])} and {f.members[-1]}"
            )
    return "repeat one trial three times unchanged: that shows the noise floor"


__all__ = ["diagnose_rig", "trusted_fit"]
