"""What an effect is held to on validation recordings: what stands in its best shapes without it, all joints, the motion."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_model.rig import standing
from hand_model.rig.name.candidates import Candidate
from hand_model.rig.name.problem import Term


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
    monkeypatch.setattr(standing, "refit", lambda problem, terms: tuple(Term(t.candidate, {"reach": 5.0}) for t in terms))
    monkeypatch.setattr(standing, "solved", lambda bench, fit, terms: (list(terms), np.zeros(0)))
    monkeypatch.setattr(standing, "_motion_says", lambda bench, before, after: None)
    monkeypatch.setattr(standing, "_joint_finding", lambda rig, fit, step, term, *more: (term.candidate.effect, term.shape["reach"]))


def _reaches(side: tuple) -> tuple[float, ...]:
    return tuple(t.shape["reach"] for t in side[1])


@pytest.mark.parametrize(("errors", "whole", "holds"), [
    ({(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.3}, {(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.3}, [1.0, 2.0]),
    ({(): 1.0, (5.0,): 0.3, (1.0, 2.0): 0.32, (1.0,): 0.9}, {(): 1.0, (5.0,): 0.3}, [5.0]),
    ({(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.3}, {(): 1.0, (5.0,): 0.5, (1.0, 2.0): 0.6}, [5.0]),
], ids=["both help", "the first does as well in a shape of its own", "others pay for it"])  # fmt: skip
def test_an_effect_is_held_to_what_stands_at_its_best_without_it(monkeypatch: pytest.MonkeyPatch, errors: dict, whole: dict, holds: list) -> None:
    """Two effects of one joint, found with shapes 1 and 2 beside each other; the first alone has shape 5."""
    _table_alone(monkeypatch)
    stories = [(None, term("elbow", "a", 1.0)), (None, term("elbow", "b", 2.0))]
    found, kept = standing.proved(Bench(errors, whole), None, stories, [], rejected := [])
    assert [t.shape["reach"] for t in kept] == holds and found == list(zip("ab", holds))
    assert [r["effect"] for r in rejected] == ["b@elbow"][: 2 - len(holds)]


def test_what_stands_at_a_joint_keeps_its_shape_when_another_joint_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """The elbow's first effect, found with shape 1 beside one that is withdrawn, stands with its own, 5: in the file and as it is told."""
    _table_alone(monkeypatch)
    errors = {(): 1.0, (5.0,): 0.5, (5.0, 3.0): 0.4, (1.0, 2.0): 0.6}
    stories = [(None, term(*t)) for t in (("elbow", "a", 1.0), ("elbow", "b", 2.0), ("wrist", "c", 3.0))]
    found, kept = standing.proved(Bench(errors, errors), None, stories, [], rejected := [])
    assert [t.shape["reach"] for t in kept] == [5.0, 3.0] and found == [("a", 5.0), ("c", 3.0)]
    assert [r["effect"] for r in rejected] == ["b@elbow"]


@pytest.mark.parametrize(("told", "against"), [({"ratio": 0.9}, False), ({"ratio": 1.001}, False), ({"ratio": 1.2}, True), ({"not_run": "no law in open loop for x"}, True),
                                              ({"not_run": "a simulation leaves the recordings"}, False)])  # fmt: skip
def test_a_motion_that_hardly_depends_on_an_effect_says_nothing_against_it(monkeypatch: pytest.MonkeyPatch, told: dict, against: bool) -> None:
    """Only one that gets worse by as much as would be worth a name does, and an effect that has no motion."""
    monkeypatch.setattr(standing, "open_loop", lambda *args, **more: told)
    bench = SimpleNamespace(rig=SimpleNamespace(trials=[SimpleNamespace(effort={})], drives=(1,)), file=lambda *side: b"", moved={})
    assert (standing._motion_says(bench, (), ()) is not None) is against


@pytest.mark.parametrize(("delay", "beyond"), [(-0.0399, True), (0.02, False)])
def test_a_delay_at_the_end_of_those_tried_is_none(delay: float, beyond: bool) -> None:
    """What is best there may lie beyond it."""
    grid = tuple({"delay": s * d} for d in (0.01, 0.04) for s in (-1.0, 1.0))
    late = Candidate("current_channel_delay", "", "j1", (), grid, lambda r, s: np.zeros((0, 0)), True)
    assert standing._beyond_reach(Term(late, {"delay": delay})) is beyond and not standing._beyond_reach(term("j1", "a", 1.0))
