"""Which effects of a balance stand: each is held to validation recordings beside those before it, all in the shapes
that suit them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .declared import DeclaredFit
from .findings import NOT_BORNE_OUT, Finding, measured, whereabouts
from .horizon import NO_LAW, open_loop
from .laws import ALL_TURNING, TURNING
from .model import RigModel
from .name.candidates import STOP, WHOLE, candidates
from .name.compete import LEAST_SHARE, Step
from .name.problem import Term, amplitudes, pose, resampled, solution
from .name.refit import refit
from .name.settled import settled
from .proof import Bench
from .words import alternatives, joint_unit, shape_unit, statement

Array = NDArray[np.float64]
PART = 0.05  # of a friction: less of it is no part
FITS = 1.6**0.5  # an error within so many noise floors is taken to be noise: a variance 1.6 times as large
END = 0.99  # of the longest delay that is tried
# What two effects leave at a joint may be the form of their laws, which no catalogue has to better than 7 % of its
# amplitude: share of the mismatch.
FORMED, FORM = 2, 0.07**2
AT_OTHERS = "what it takes off at its joint it adds at others"
HARMFUL = "beside all others it leaves its joint worse off than the declared model does"
OF_FORM = "it takes no more than the forms of the effects before it may be off by"


Proof = tuple[Step, dict[str, Any]]


def proved(
    bench: Bench,
    fit: DeclaredFit,
    stories: Sequence[tuple[Step, Term]],
    kept: Sequence[Term],
    rejected: list[dict[str, Any]],
) -> tuple[list[Proof], list[Term]]:
    """What holds on the validation recordings, one after the other beside `kept`, all in the shapes that are best
    without the later ones; the rest goes to rejected. Returns rounds and proofs, and all terms that hold, in order."""
    terms, found = list(kept), list(kept)
    proofs: list[Proof] = []
    whole = Counter(t.candidate.joint for t in [*kept, *(t for _, t in stories)])
    plain, few = (fit, *solved(bench, fit, [])), solved(bench, fit, kept)
    todo, reasons = list(stories), {}
    while todo:
        again = []
        for step, term in todo:
            more = _shaped(fit, terms, [*found, term], whole)
            many = solved(bench, fit, more)
            proof = bench.proof(term.candidate.joint, (fit, *few), (fit, *many))
            reason = _withdrawn(bench, proof, plain, (fit, *few), (fit, *many)) or _of_form(
                bench, term, found, proof, plain
            )
            if reason is None:
                found, terms, few = [*found, term], more, many
                proofs.append((step, proof))
                continue
            reasons[id(term)] = term.candidate.key, reason
            again += [(step, term)] if reason == AT_OTHERS else []
        # what it adds at others may be what these lacked themselves then
        todo = again if len(again) < len(todo) else []
    stand = {id(t) for t in found}
    rejected += [{"effect": key, "reason": reason} for at, (key, reason) in reasons.items() if at not in stand]
    return proofs, _in_order(terms, found)


def in_the_end(
    bench: Bench,
    fits: tuple[DeclaredFit, DeclaredFit],
    terms: Sequence[Term],
    proofs: Sequence[Proof],
    rejected: list[dict[str, Any]],
) -> tuple[list[Finding], list[Term]]:
    """Findings of all terms, sized as they are beside each other, and these (fits: the declared one, and that of the
    terms). Where all of them together leave a joint worse off than the declared model does, those of its terms go,
    last first, without which the error over all joints is less: to rejected."""
    (declared, fit), terms, proofs = fits, list(terms), list(proofs)
    plain, every = (declared, *solved(bench, declared, [])), (fit, *solved(bench, fit, terms))
    ends = {j: bench.proof(j, plain, every) for j in dict.fromkeys(t.candidate.joint for t in terms)}
    worse = {j for j, end in ends.items() if end["after"] > end["before"]}
    for k in reversed([k for k, t in enumerate(terms) if t.candidate.joint in worse]):
        without = fit, *solved(bench, fit, [*terms[:k], *terms[k + 1 :]])
        if bench.ratio(plain, without) < bench.ratio(plain, every):
            rejected.append({"effect": terms[k].candidate.key, "reason": HARMFUL})
            every = without
            del terms[k], proofs[k]
    ends = {j: bench.proof(j, plain, every) for j in dict.fromkeys(t.candidate.joint for t in terms)}
    told = _told_apart(bench, every)
    size = every[2] if told == every[1] else solved(bench, fit, told)[1]
    return _named(bench, fit, told, size, proofs, ends), terms


def _told_apart(bench: Bench, side: tuple[DeclaredFit, Sequence[Term], Array]) -> list[Term]:
    """Terms, in which a friction by load and a constant one that turn round together is one of them where hardly
    anything of the other is left in the end."""
    fit, terms, theta = side
    out = []
    for term, size in zip(terms, amplitudes(fit, terms, theta), strict=True):
        c = term.candidate
        if c.variant == ALL_TURNING:
            loads = np.concatenate([r.load(fit.theta) for r in fit.rows if r.joint == c.joint])
            by_load, constant = size * [np.sqrt(np.mean(loads**2)), 1.0]
            effect, variant = (STOP, "") if by_load < PART * constant else (c.effect, TURNING)
            if min(by_load, constant) < PART * max(by_load, constant):
                every = candidates(bench.rig, fit, c.joint, only={effect})
                term = replace(term, candidate=next(o for o in every if (o.effect, o.variant) == (effect, variant)))
        out.append(term)
    return out


def _shaped(fit: DeclaredFit, standing: Sequence[Term], found: Sequence[Term], whole: Mapping[str, int]) -> list[Term]:
    """Terms with the last of `found`, its joint last: there in their best shapes beside each other, as they were found
    where the joint has them all (whole: joint -> how many), else those without the others; at other joints as they
    stand."""
    joint = found[-1].candidate.joint
    mine = [t for t in found if t.candidate.joint == joint]
    best = mine if len(mine) == whole[joint] else refit(pose(fit, joint), mine)
    return [*(t for t in standing if t.candidate.joint != joint), *best]


def _in_order(terms: Sequence[Term], found: Sequence[Term]) -> list[Term]:
    """Terms in the order in which they were found: each joint has them in that order already."""
    left = {j: iter([t for t in terms if t.candidate.joint == j]) for j in {t.candidate.joint for t in terms}}
    return [next(left[t.candidate.joint]) for t in found]


def _named(
    bench: Bench,
    fit: DeclaredFit,
    terms: Sequence[Term],
    theta: Array,
    proofs: Sequence[Proof],
    ends: Mapping[str, Mapping[str, Any]],
) -> list[Finding]:
    """Findings of terms with their solution theta (P + J,); ends: joint -> proof of all of them together. One of a
    name that its joint has once more later on is sized without that, which would share its size."""
    # beside what does not fit, an interval would promise too much
    close = {j for j, end in ends.items() if end["after"] <= FITS * end["noise_floor"]}
    spread = amplitudes(fit, terms, resampled(pose(fit), terms)) if close else [None] * len(terms)
    found = []
    for term, (step, proof), size, draws in zip(terms, proofs, amplitudes(fit, terms, theta), spread, strict=True):
        own = draws if term.candidate.joint in close else None
        if again := _again(terms, term):
            own, size = None, _sized(bench, fit, [t for t in terms if t not in again], term)
        found.append(_joint_finding(bench.rig, fit, step, term, size, proof, own))
    return found


def _again(terms: Sequence[Term], term: Term) -> list[Term]:
    """Later terms of the same name at the same joint."""
    said = [
        t for t in terms if (t.candidate.effect, t.candidate.joint) == (term.candidate.effect, term.candidate.joint)
    ]
    return said[said.index(term) + 1 :]


def _sized(bench: Bench, fit: DeclaredFit, terms: Sequence[Term], term: Term) -> Array:
    """Amplitudes (j,) of one of the terms."""
    told, theta = solved(bench, fit, terms)
    return amplitudes(fit, told, theta)[terms.index(term)]


def _withdrawn(bench: Bench, proof: Mapping[str, Any], plain: tuple, before: tuple, after: tuple) -> str | None:
    """Why an effect does not hold on the validation recordings (its proof; fits of the declared model, without it and
    with it), or None where it does."""
    if _beyond_reach(after[1][-1]):
        return "its delay is the longest that is asked: what is best may lie beyond"
    if proof["before"] <= proof["noise_floor"]:
        return "without it the error is within the sensors' noise already"
    if proof["after"] ** 2 > (1 - LEAST_SHARE) * proof["before"] ** 2:
        return NOT_BORNE_OUT
    if bench.mujoco and bench.ratio(plain, after) >= bench.ratio(plain, before):
        return AT_OTHERS
    return _motion_says(bench, before, after) if bench.mujoco else None


def _of_form(bench: Bench, term: Term, found: Sequence[Term], proof: Mapping[str, Any], plain: tuple) -> str | None:
    """Why an effect may be the form of those found before it at its joint, two or more, or None where it takes more of
    what the declared model leaves."""
    joint = term.candidate.joint
    if sum(t.candidate.joint == joint for t in found) < FORMED:
        return None
    whole = bench.proof(joint, plain, plain)["before"]
    return OF_FORM if proof["before"] ** 2 - proof["after"] ** 2 < FORM * whole**2 else None


def _beyond_reach(term: Term) -> bool:
    """Whether a delay lies at the end of those that are tried: there it stands in for what no delay is."""
    tried = [abs(g["delay"]) for g in term.candidate.grid if "delay" in g]
    return bool(tried) and abs(term.shape["delay"]) > END * max(tried)


def _motion_says(bench: Bench, before: tuple, after: tuple) -> str | None:
    """What the motion of the training recordings says against the file with one term more: that it moves further from
    them, by as much as would be worth a name, or that it cannot be simulated; never anything where efforts are
    recorded.

    Where they are not, the balance holds what the drives' declared law makes of their commands: only the motion can
    tell whether they act so. Where it hardly depends on the term it says nothing against it.
    """
    if any(t.effort for t in bench.rig.trials) or not bench.rig.drives:
        return None
    told = open_loop(bench.rig, bench.file(*before), bench.file(*after), validate=False, known=bench.moved)
    if told.get("not_run", "").startswith(NO_LAW):
        return f"no effort is recorded, and only a simulated motion could tell: {told['not_run']}"
    worse = told.get("ratio", 0.0) ** 2 > 1 + LEAST_SHARE
    return "the motion of the training trials, simulated from the commands, gets worse" if worse else None


def solved(bench: Bench, fit: DeclaredFit, terms: Sequence[Term]) -> tuple[list[Term], Array]:
    """Terms and solution, at its own loads where there are any (angles of couplings have none)."""
    return settled(bench.rig, fit, terms)[:2] if bench.mujoco else (list(terms), solution(pose(fit), terms))


def first_of(fit: DeclaredFit, terms: Sequence[Term], count: int) -> list[Term]:
    """The first so many terms of every joint, in their best shapes without the others."""
    out: list[Term] = []
    for joint in dict.fromkeys(t.candidate.joint for t in terms):
        mine = [t for t in terms if t.candidate.joint == joint]
        out += refit(pose(fit, joint), mine[:count]) if len(mine) > count else mine
    return out


def _joint_finding(
    rig: RigModel, fit: DeclaredFit, step: Step, term: Term, amplitude: Array, proof: dict, spread: Array | None
) -> Finding:
    c = term.candidate
    position, effort = rig.unit(c.joint), rig.effort_unit(c.joint)
    parameters = {}
    for k, ((name, unit, _, _), v) in enumerate(zip(c.amplitudes, amplitude, strict=True)):
        if name == WHOLE[0]:
            continue
        ends = None if spread is None else [float(x) for x in np.percentile(spread[:, k], [2.5, 97.5])]
        parameters[name] = {"value": float(v), "unit": joint_unit(unit, position, effort), "ci95": ends}
    # what a late drive leaves comes early in the balance: its command is ahead
    sign = -1.0 if c.effect == "command_delay" else 1.0
    parameters |= {
        k: {"value": sign * v if k == "delay" else v, "unit": shape_unit(k, position, effort), "ci95": None}
        for k, v in c.told(term.shape).items()
    }
    fall = max(proof["before"] ** 2 - proof["after"] ** 2, 0.0)
    where = whereabouts(c.joint, rig.drive(c.joint), "effort", measured(rig, proof), fall)
    members = (c.effect, *(e for e in step.equals if e != c.effect))
    return Finding(
        c.effect,
        members,
        *alternatives(step.rivals, c.effect, step.probability, len(members)),
        where,
        statement(c.effect, c.variant, c.joint, parameters, proof),
        parameters,
        proof,
        {"native": False, "mjcf": 'custom/text[@name="hand_model"]', "urdf": "not expressible: kept in rig.xml"},
    )
