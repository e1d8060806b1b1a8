"""What an effect is held to on validation recordings: what stands in its best shapes without it, all joints, the
motion."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_model.rig import standing
from hand_model.rig.findings import Finding
from hand_model.rig.laws import ALL_TURNING, TURNING
from hand_model.rig.name.candidates import Candidate
from hand_model.rig.name.problem import Term
from hand_model.rig.same_path import one_load_each


def term(joint: str, effect: str, reach: float) -> Term:
    """An effect without columns."""
    return Term(Candidate(effect, "", joint, (), ({"reach": reach},), lambda r, s: np.zeros((0, 0))), {"reach": reach})


class Bench:
    """Measures by a table: error of a joint and of all under the reaches of the terms."""

    mujoco = True
    rig = None

    def __init__(self, errors: dict[tuple[float, ...], float], whole: dict[tuple[float, ...], float]) -> None:
        self.errors, self.whole = errors, whole

    def proof(self, joint: str, before: tuple, after: tuple) -> dict[str, Any]:
        """Error of the joint without and with a term."""
        return {"before": self.errors[_reaches(before)], "after": self.errors[_reaches(after)], "noise_floor": 0.0}

    def ratio(self, before: tuple, after: tuple) -> float:
        """Error of all joints over that of the declared model."""
        return self.whole[_reaches(after)]


def _table_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is fitted: without another the best shape is 5; a finding is its effect and reach."""
    monkeypatch.setattr(standing, "pose", lambda fit, joint=None: None)
    monkeypatch.setattr(
        standing, "refit", lambda problem, terms: tuple(Term(t.candidate, {"reach": 5.0}) for t in terms)
    )
    monkeypatch.setattr(standing, "solved", lambda bench, fit, terms: (list(terms), np.zeros(0)))
    monkeypatch.setattr(standing, "_motion_says", lambda bench, before, after: None)
    monkeypatch.setattr(
        standing, "_joint_finding", lambda rig, fit, step, term, *more: (term.candidate.effect, term.shape["reach"])
    )


def _reaches(side: tuple) -> tuple[float, ...]:
    return tuple(t.shape["reach"] for t in side[1])


@pytest.mark.parametrize(
    ("errors", "whole", "holds"),
    [
        ({(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.3}, {(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.3}, [1.0, 2.0]),
        ({(): 1.0, (5.0,): 0.3, (1.0, 2.0): 0.32, (1.0,): 0.9}, {(): 1.0, (5.0,): 0.3}, [5.0]),
        ({(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.3}, {(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.6}, [5.0]),
    ],
    ids=["both help", "the first does as well in a shape of its own", "others pay for it"],
)
def test_an_effect_is_held_to_what_stands_at_its_best_without_it(
    monkeypatch: pytest.MonkeyPatch, errors: dict, whole: dict, holds: list
) -> None:
    """Two effects of one joint, found with shapes 1 and 2 beside each other; the first alone has shape 5."""
    _table_alone(monkeypatch)
    stories = [(None, term("elbow", "a", 1.0)), (None, term("elbow", "b", 2.0))]
    proofs, kept = standing.proved(Bench(errors, whole), None, stories, [], rejected := [])
    assert [(t.candidate.effect, t.shape["reach"]) for t in kept] == list(zip("ab", holds)) and len(proofs) == len(kept)
    assert [r["effect"] for r in rejected] == ["b@elbow"][: 2 - len(holds)]


def test_what_stands_at_a_joint_keeps_its_shape_when_another_joint_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """The elbow's first effect, found with shape 1 beside one that is withdrawn, stands with its own, 5."""
    _table_alone(monkeypatch)
    errors = {(): 1.0, (5.0,): 0.5, (5.0, 3.0): 0.4, (1.0, 2.0): 0.6}
    stories = [(None, term(*t)) for t in (("elbow", "a", 1.0), ("elbow", "b", 2.0), ("wrist", "c", 3.0))]
    _, kept = standing.proved(Bench(errors, errors), None, stories, [], rejected := [])
    assert [(t.candidate.effect, t.shape["reach"]) for t in kept] == [("a", 5.0), ("c", 3.0)]
    assert [r["effect"] for r in rejected] == ["b@elbow"]


def test_what_adds_error_elsewhere_is_asked_again_once_these_have_what_they_lacked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The elbow's effect makes the wrist worse as long as this lacks its own."""
    _table_alone(monkeypatch)
    joint = {(): 1.0, (1.0,): 0.5, (2.0,): 0.5, (2.0, 1.0): 0.3}
    stories = [(None, term("elbow", "a", 1.0)), (None, term("wrist", "b", 2.0))]
    _, kept = standing.proved(Bench(joint, {**joint, (1.0,): 1.2}), None, stories, [], rejected := [])
    assert [t.candidate.effect for t in kept] == ["b", "a"] and not rejected
    _, kept = standing.proved(Bench(joint, {**joint, (1.0,): 1.2, (2.0, 1.0): 0.6}), None, stories, [], rejected)
    assert [t.candidate.effect for t in kept] == ["b"]
    assert [(r["effect"], r["reason"]) for r in rejected] == [("a@elbow", standing.AT_OTHERS)]


@pytest.mark.parametrize(("alone", "stays"), [(0.7, False), (0.9, True)])
def test_what_leaves_its_joint_worse_off_in_the_end_stays_only_where_all_joints_are_better_with_it(
    monkeypatch: pytest.MonkeyPatch, alone: float, stays: bool
) -> None:
    """The second of two effects, of a joint at which all of them leave more than the declared model does; alone: what
    the first leaves of all joints, both 0.8."""
    _table_alone(monkeypatch)
    errors = {(): 1.0, (1.0,): 0.5, (1.0, 2.0): 1.1}
    terms = [term("elbow", "a", 1.0), term("wrist", "b", 2.0)]
    monkeypatch.setattr(Bench, "proof", _proof_by_joint({"elbow": {**errors, (1.0, 2.0): 0.4}, "wrist": errors}))
    bench = Bench({}, {(): 1.0, (1.0,): alone, (1.0, 2.0): 0.8})
    fit = SimpleNamespace(columns=())
    found, kept = standing.in_the_end(bench, (fit, fit), terms, [(None, {}), (None, {})], rejected := [])
    assert [t.candidate.effect for t in kept] == ["a", "b"][: 1 + stays] == [name for name, _ in found]
    assert [r["reason"] for r in rejected] == [standing.HARMFUL] * (not stays)


@pytest.mark.parametrize(
    ("size", "told"),
    [
        ((0.2, 0.5), ("load_dependent_friction", ALL_TURNING)),
        ((0.2, 1e-4), ("load_dependent_friction", TURNING)),
        ((1e-4, 0.5), ("elastoplastic_hysteresis", "")),
    ],
)
def test_of_two_frictions_that_turn_round_together_the_one_that_is_there_is_told(
    monkeypatch: pytest.MonkeyPatch, size: tuple[float, float], told: tuple[str, str]
) -> None:
    """At a load of 3 N m."""

    def known(rig: Any, fit: Any, joint: str, only: set[str]) -> tuple[Candidate, ...]:
        pairs = [("load_dependent_friction", v) for v in (ALL_TURNING, TURNING)] + [("elastoplastic_hysteresis", "")]
        return tuple(replace(term(joint, e, 0.1).candidate, variant=v) for e, v in pairs if e in only)

    monkeypatch.setattr(standing, "candidates", known)
    row = SimpleNamespace(joint="elbow", load=lambda theta: np.full(5, -3.0))
    fit = SimpleNamespace(columns=(), rows=(row,), theta=np.zeros(0))
    both = replace(known(None, None, "elbow", {"load_dependent_friction"})[0], amplitudes=(("a",), ("b",)))
    (out,) = standing._told_apart(Bench({}, {}), (fit, [Term(both, {"reach": 0.1})], np.array(size)))
    assert (out.candidate.effect, out.candidate.variant) == told and out.shape == {"reach": 0.1}


def test_effects_are_sized_beside_all_others_but_without_a_later_one_of_their_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of three at a joint the first and the last have one name: the first has its size without the last, the others as
    all are."""
    monkeypatch.setattr(standing, "_joint_finding", lambda rig, fit, step, term, size, proof, spread: float(size[0]))
    without = np.array([9.0, 5.0, 2.5])
    monkeypatch.setattr(standing, "solved", lambda bench, fit, terms: (list(terms), without[: 1 + len(terms)]))
    terms = [
        Term(replace(term("elbow", name, reach).candidate, amplitudes=(("a",),)), {"reach": reach})
        for name, reach in (("a", 1.0), ("b", 2.0), ("a", 3.0))
    ]
    fit, proofs = SimpleNamespace(columns=(None,)), [(None, {})] * 3
    ends = {"elbow": {"after": 1.0, "noise_floor": 0.0}}
    sizes = standing._named(Bench({}, {}), fit, terms, np.array([9.0, 1.0, 2.0, 3.0]), proofs, ends)
    assert sizes == [5.0, 2.0, 3.0]


def _proof_by_joint(errors: dict[str, dict[tuple[float, ...], float]]) -> Any:
    def proof(self: Bench, joint: str, before: tuple, after: tuple) -> dict[str, Any]:
        table = errors[joint]
        return {"before": table[_reaches(before)], "after": table[_reaches(after)], "noise_floor": 0.0}

    return proof


@pytest.mark.parametrize(
    ("told", "against"),
    [
        ({"ratio": 0.9}, False),
        ({"ratio": 1.001}, False),
        ({"ratio": 1.2}, True),
        ({"not_run": "no law in open loop for x"}, True),
        ({"not_run": "a simulation leaves the recordings"}, False),
    ],
)
def test_a_motion_that_hardly_depends_on_an_effect_says_nothing_against_it(
    monkeypatch: pytest.MonkeyPatch, told: dict, against: bool
) -> None:
    """Only one that gets worse by as much as would be worth a name does, and an effect that has no motion."""
    monkeypatch.setattr(standing, "open_loop", lambda *args, **more: told)
    bench = SimpleNamespace(
        rig=SimpleNamespace(trials=[SimpleNamespace(effort={})], drives=(1,)), file=lambda *side: b"", moved={}
    )
    assert (standing._motion_says(bench, (), ()) is not None) is against


@pytest.mark.parametrize(("delay", "beyond"), [(-0.0399, True), (0.02, False)])
def test_a_delay_at_the_end_of_those_tried_is_none(delay: float, beyond: bool) -> None:
    """What is best there may lie beyond it."""
    grid = tuple({"delay": s * d} for d in (0.01, 0.04) for s in (-1.0, 1.0))
    late = Candidate("current_channel_delay", "", "j1", (), grid, lambda r, s: np.zeros((0, 0)), True)
    assert standing._beyond_reach(Term(late, {"delay": delay})) is beyond and not standing._beyond_reach(
        term("j1", "a", 1.0)
    )


def _load(effect: str, joint: str, before: float, after: float, share: float, signal: str = "effort") -> Finding:
    fit = {"before": before, "after": after, "ci95_reduction": [0.1, 0.4]}
    value = {"value": 1.0, "unit": "N m", "ci95": None}
    return Finding(
        effect,
        (effect, "stribeck_friction"),
        0.98,
        (),
        {"joint": joint, "signal": signal, "share_of_mismatch": share},
        f"{effect} at {joint}.",
        {"load": value},
        fit,
        {"native": False},
    )


def test_on_one_path_all_loads_tied_to_a_joint_are_one_name() -> None:
    """A spring, a detent and a ripple at one joint bend one curve; other joints, other effects and angles of couplings
    stay as they are."""
    found = [
        _load("nonlinear_spring", "a", 5.0, 4.0, 0.5),
        _load("asymmetric_friction", "a", 4.0, 3.5, 0.2),
        _load("detent_load", "b", 1.0, 0.5, 0.9),
        _load("detent_load", "a", 3.5, 2.5, 0.2),
        _load("torque_ripple", "a", 2.5, 2.0, 0.1),
        _load("torque_ripple", "a", 2.0, 1.0, 0.1, "position"),
    ]
    merged = one_load_each(found)
    assert [(f.effect, f.where["joint"]) for f in merged] == [
        ("nonlinear_spring", "a"),
        ("asymmetric_friction", "a"),
        ("detent_load", "b"),
        ("torque_ripple", "a"),
    ]
    one = merged[0]
    assert one.members == ("nonlinear_spring", "stribeck_friction", "detent_load", "torque_ripple", "gravity_load")
    assert one.where["share_of_mismatch"] == pytest.approx(0.8)
    assert one.fit["after"] ** 2 == pytest.approx(25 - (25 - 16) - (3.5**2 - 2.5**2) - (2.5**2 - 4.0))
    assert one.fit["ci95_reduction"] == pytest.approx([0.3, 1.2]) and len(one.parameters) == 3
    assert merged[1] is found[1] and merged[3] is found[5]
    assert merged[2].members == ("detent_load", "stribeck_friction", "gravity_load")


@pytest.mark.parametrize(("left", "count"), [(0.03, 2), (0.3, 3)])
def test_a_third_effect_takes_more_than_the_forms_of_two_may_be_off_by(
    monkeypatch: pytest.MonkeyPatch, left: float, count: int
) -> None:
    """A third that takes a fifth of the squared error that two leave is named where they leave 30 % of the error, not
    where 3 %."""
    _table_alone(monkeypatch)
    errors = {(): 1.0, (5.0,): 0.5, (5.0, 5.0): left, (1.0, 2.0, 3.0): 0.9 * left}
    stories = [(None, term("elbow", name, reach)) for name, reach in (("a", 1.0), ("b", 2.0), ("c", 3.0))]
    _, kept = standing.proved(Bench(errors, errors), None, stories, [], rejected := [])
    assert len(kept) == count and [r["reason"] for r in rejected] == [standing.OF_FORM][: 3 - count]
