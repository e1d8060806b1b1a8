"""The competition at every joint of a rig: joints know nothing of each other there, so two processes share them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...background import Background
from ..declared import DeclaredFit
from ..model import RigModel
from .candidates import OFFSET, PRELOADED, Candidate, candidates
from .compete import Step, compete
from .problem import Term, pose
from .settled import settled


@dataclass(frozen=True)
class Won:
    """A round of the competition at a joint and its winner, by the key and shape of the candidate: these, unlike its
    columns, a process can hand back."""

    step: Step
    joint: str
    key: str
    shape: Mapping[str, float]


def offsets_first(rig: RigModel, fit: DeclaredFit, joints: Sequence[str]) -> dict[str, Won | None]:
    """Of every joint, a constant offset of its effort, where it wins the first round."""
    return dict(zip(joints, _each(_offset_first, [(rig, _own(fit, j), j) for j in joints]), strict=True))


def offsets_of_chain(rig: RigModel, fit: DeclaredFit, joints: Sequence[str]) -> dict[str, Won | None]:
    """Of every joint, a constant offset of its effort where it wins a round among those of all joints, all declared
    parameters of the chain free beside them: a weight off its axis is shared by joints, and what it does at one posture
    an offset does, too."""
    offsets = [c for j in joints for c in candidates(rig, fit, j, only={OFFSET})]
    taken, steps, _ = compete(pose(fit), offsets, most=len(joints))
    won = {t.candidate.joint: _won(s, t) for t, s in zip(taken, steps, strict=True)}
    return {joint: won.get(joint) for joint in joints}


def search_joints(
    rig: RigModel, fit: DeclaredFit, begin: Mapping[str, Won | None]
) -> Iterator[tuple[list[Won], list[str]]]:
    """Of every joint (begin: what stands there already), what was won beside that and the keys of what was not."""
    return _each(_search, [(rig, _own(fit, joint), joint, won) for joint, won in begin.items()])


def as_term(rig: RigModel, fit: DeclaredFit, won: Won) -> Term:
    """The winner of a round as a term of the balance."""
    return Term(next(c for c in candidates(rig, fit, won.joint) if c.key == won.key), won.shape)


def _won(step: Step, term: Term) -> Won:
    return Won(step, term.candidate.joint, term.candidate.key, term.shape)


def _each(function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
    if len(calls) < 2:
        return iter([function(*call) for call in calls])
    return Background(function, calls).results()


def _own(fit: DeclaredFit, joint: str) -> DeclaredFit:
    return replace(fit, rows=tuple(r for r in fit.rows if r.joint == joint))


def _offset_first(rig: RigModel, fit: DeclaredFit, joint: str) -> Won | None:
    everything, problem = candidates(rig, fit, joint), pose(fit, joint)
    offset = [c for c in everything if c.effect == OFFSET]
    if not compete(problem, offset, most=1)[0]:
        return None
    taken, steps, _ = compete(problem, [c for c in everything if c.variant != PRELOADED], most=1)
    if taken and taken[0].candidate.effect == OFFSET:
        return _won(steps[0], taken[0])
    return None


def _search(rig: RigModel, fit: DeclaredFit, joint: str, begin: Won | None) -> tuple[list[Won], list[str]]:
    stands = () if begin is None else (as_term(rig, fit, begin),)

    def settle(terms: tuple[Term, ...]) -> tuple[tuple[Term, ...], Sequence[Candidate]]:
        same, _, at = settled(rig, fit, terms)
        return tuple(same), candidates(rig, at, joint)

    taken, steps, scores = compete(pose(fit, joint), candidates(rig, fit, joint), stands, settle=settle)
    won = [_won(s, t) for s, t in zip(steps, taken[len(stands) :], strict=True)]
    stand = {t.candidate.key for t in taken}
    return won, [s.term.candidate.key for s in scores if s.term.candidate.key not in stand]
