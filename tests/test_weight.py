"""A weight on a hand that never turns, told from lopsided friction and a bent spring."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_diagnose import drive

from hand_model.diagnose import weight
from hand_model.diagnose.name import entries, reread
from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.candidates import EVIDENCE_LEAST
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.selection import name_effects
from hand_model.diagnose.name.station import Station
from hand_model.diagnose.name.term import Term
from hand_model.effects import effect
from hand_model.effects.path import dahl

SWEEP = 1.4
EFFECTS = [effect(name) for name in ("nonlinear_spring", "torque_ripple", "gravity_load", "presliding_friction")]


def posed(states: tuple[Any, ...]) -> tuple[Any, ...]:
    """The states with gravity along the finger and across it, and the angle that its joint turns through."""

    def one(state: Any) -> Any:
        n = np.ones(len(state.time_s))
        gravity = {
            "gravity_along": -3.0 * n,
            "gravity_across": 9.0 * n,
            "pose_seen": n,
            "sweep": np.stack([SWEEP * n, 1.6 * SWEEP * n], axis=1),
        }
        return replace(state, extra={**state.extra, **gravity})

    return tuple(one(s) for s in states)


def none(state: Any) -> Any:
    return np.zeros(len(state.time_s))


def heard(monkeypatch: pytest.MonkeyPatch, load: Any, other: Any = none) -> tuple[list[Any], list[Any]]:
    """Stations and findings of two drives, the second one loaded, the first one as `other` has it."""
    monkeypatch.setattr(weight, "in_one_pose", lambda session, fingers, states: posed(states))
    calls = [
        ("current", f"finger_{i}", f"motor_{i}", None, drive(11 + i, added), EFFECTS, None)
        for i, added in enumerate((other, load))
    ]
    stations = [judged(*call) for call in calls]
    return weight.with_weights(SimpleNamespace(), {}, stations, calls)


@pytest.mark.parametrize("size", [-14.0, -45.0])
def test_a_weight_explains_an_odd_preload_and_the_bend_that_it_foretells(
    monkeypatch: pytest.MonkeyPatch, size: float
) -> None:
    stations, findings = heard(monkeypatch, lambda s: size * np.sin(1.7 + SWEEP * s.position / 100))
    named = {f.term.effect.name for s in stations if s.believed for f in s.kept}
    assert {f.effect for _, f in findings} | named == {"gravity_load"}
    for _, finding in findings:
        assert finding.where["finger"] == "finger_1"
        largest, (low, high) = (finding.parameters["largest"][k] for k in ("value", "ci95"))
        assert low < largest < high and high - low < 0.5 * largest
        assert 9.5 / 9.81 * largest == pytest.approx(abs(size), rel=0.3)


def test_lopsided_friction_foretells_no_bend_and_stays_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    stations, findings = heard(monkeypatch, lambda s: np.full(len(s.time_s), 25.0))
    assert [f.effect for _, f in findings] == ["asymmetric_friction"]
    assert not any(s.kept for s in stations)


@pytest.mark.parametrize("bend", [30.0, -27.0])
def test_a_bent_spring_beside_a_usual_preload_stays_what_it_is(monkeypatch: pytest.MonkeyPatch, bend: float) -> None:
    """One that softens, too: as a whole it is much softer than those of other drives, where it begins it is as stiff."""
    stations, findings = heard(monkeypatch, lambda s: bend * (s.position / 100) ** 2)
    assert not findings
    assert [f.term.effect.name for s in stations for f in s.kept] == ["nonlinear_spring"]


def test_a_preload_that_pushes_is_a_weights_whatever_else_bends_the_spring(monkeypatch: pytest.MonkeyPatch) -> None:
    """No spring pushes, and lopsided friction takes at most the friction away; the usual preload here is 10."""

    def pushed(s: Any) -> Any:
        return -80.0 * np.sin(1.7 + SWEEP * s.position / 100) - 12 * (s.position / 100) ** 3

    stations, findings = heard(monkeypatch, pushed)
    named = {f.effect for _, f in findings} | {f.term.effect.name for s in stations if s.believed for f in s.kept}
    assert "gravity_load" in named and named <= {"gravity_load", "nonlinear_spring"}


def test_a_weight_is_read_beside_what_is_usual_though_another_name_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside nothing that holds its preload and spring a drive hardly tells a weight's size."""
    size = -45.0

    def pulled(s: Any) -> Any:
        return size * np.sin(1.7 + SWEEP * s.position / 100) + 3.0 * np.sin(2 * np.pi * s.position / 17.0)

    stations, findings = heard(monkeypatch, pulled)
    assert not findings
    (station,) = (s for s in stations if s.beside is not None)
    (weighed,) = (f for f in station.kept if f.term.effect.name == "gravity_load")
    finding = entries.finding_of(station, weighed, 1.0, 1.0)[1]
    assert "torque_ripple" in {f.term.effect.name for f in station.kept}
    (alone,), _ = reread.reread([finding], [station])
    largest, (low, high) = (alone.parameters["largest"][k] for k in ("value", "ci95"))
    assert low < 9.81 / 9.5 * abs(size) < high and high - low < largest


def test_a_weight_is_told_beside_a_drive_that_lacks_something_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """What presliding changes of a drive's preload is far from what a weight does to another's."""
    size = -58.0

    def preslides(s: Any) -> Any:
        return 25.0 * (dahl(s.position, 4.0) - s.declared[:, s.declared_names.index("coulomb")])

    stations, findings = heard(monkeypatch, lambda s: size * np.sin(1.7 + SWEEP * s.position / 100), preslides)
    named = {(s.finger, f.term.effect.name) for s in stations if s.believed for f in s.kept}
    named |= {(f.where["finger"], f.effect) for _, f in findings}
    assert named == {("finger_0", "presliding_friction"), ("finger_1", "gravity_load")}


@pytest.mark.parametrize("bent", [True, False])
def test_a_bend_that_a_weight_explains_is_not_looked_for_beside_it(monkeypatch: pytest.MonkeyPatch, bent: bool) -> None:
    """A weight's two columns and a bent spring's nearly cancel each other: together they may be of any size. Where one
    seems to need the other, what else may be named in the bend's place is asked, too."""
    asked = []
    alone = weight.Pull(np.array([-10.0, 10.0]), np.eye(2), 0.99)
    pull = replace(alone, alone=alone) if bent else alone
    monkeypatch.setattr(weight, "_pulled", lambda *_: pull)
    monkeypatch.setattr(weight, "_named", lambda *_: None)
    monkeypatch.setattr(weight, "judged", lambda *call: asked.append(call[5]) or judged(*call))
    heard(monkeypatch, lambda s: 60 * (s.position / 100) ** 2 - 40.0)
    assert ["nonlinear_spring" in {e.name for e in effects} for effects in asked] == (
        [True, False] if bent else [False]
    )


@pytest.mark.parametrize(("gain", "stays"), [(EVIDENCE_LEAST - 0.1, False), (EVIDENCE_LEAST + 0.1, True)])
def test_a_bend_beside_a_weight_must_bring_what_any_further_effect_must(
    monkeypatch: pytest.MonkeyPatch, gain: float, stays: bool
) -> None:
    """What is named beside a weight with its bend, and without, are held against each other on the same samples."""
    seen = []

    def judged_as(*call: Any) -> Any:
        bent = any(e.name == "nonlinear_spring" for e in call[5])
        balance = SimpleNamespace(unclipped=lambda terms: np.array([True, True, not bent]))
        return SimpleNamespace(believed=True, naming=SimpleNamespace(fit=SimpleNamespace(terms=bent), balance=balance))

    def weighed(terms: Any, inside: np.ndarray) -> Any:
        seen.append(inside.tolist())
        return SimpleNamespace(log_evidence=gain if terms else 0.0)

    monkeypatch.setattr(weight, "judged", judged_as)
    alone = weight.Pull(np.array([-10.0, 10.0]), np.eye(2), 0.99)
    call = (None,) * 5 + ([effect("nonlinear_spring"), effect("detent_load")],)
    station, pull = weight._beside(call, (), replace(alone, alone=alone), SimpleNamespace(), weighed)
    assert (station.naming.fit.terms, pull.alone is not None) == (stays, stays)
    assert seen == [[True, True, False]] * 2


@pytest.mark.parametrize(("likelier", "stays"), [(11.0, True), (1.0, False)])
def test_what_is_named_beside_a_weight_must_be_as_likely_as_what_it_replaces(
    monkeypatch: pytest.MonkeyPatch, likelier: float, stays: bool
) -> None:
    """One name less may cost what a name must bring, and no more."""

    def station(terms: int) -> Any:
        balance = SimpleNamespace(unclipped=lambda terms: np.array([True]))
        return SimpleNamespace(naming=SimpleNamespace(fit=SimpleNamespace(terms=(None,) * terms), balance=balance))

    def weighed(terms: Any, inside: np.ndarray) -> Any:
        return SimpleNamespace(log_evidence=likelier if len(terms) == 2 else 0.0)

    before, after = station(2), station(1)
    monkeypatch.setattr(weight, "judged", lambda *_: after)
    call, pull = (None,) * 5 + ([effect("detent_load")],), weight.Pull(np.array([-10.0, 10.0]), np.eye(2), 0.99)
    assert weight._beside(call, (), pull, before, weighed) == (before if stays else after, pull)


@pytest.mark.parametrize(("at_the_lowest", "weighs"), [(-150.0, True), (-101.0, False)])
def test_a_weight_is_held_against_the_lowest_preload_that_there_may_be(
    monkeypatch: pytest.MonkeyPatch, at_the_lowest: float, weighs: bool
) -> None:
    """A preload of -45 that cannot be is likelier by 25 units than a weight beside the names that were found without
    it. What counts is how likely the lowest is that can be."""

    class Known:
        names = ("inertia", "viscous", "coulomb", "spring", "preload")

        def __init__(self, *given: Any) -> None:
            lowest, weighed = given[3]["preload"][0] == pytest.approx(8.0 - 0.9 * 35.0), len(given) > 4
            self.log_evidence = -125.0 if weighed else at_the_lowest if lowest else -100.0
            self.mean = np.array([0.01, 0.1, 35.0, 0.4, -45.0, *([-40.0, 5.0] if weighed else [])])
            self.covariance = np.eye(len(self.mean))

    states = posed(drive(2))
    station = Station("current", "index", "index", None, name_effects(states, []))
    monkeypatch.setattr(weight, "_Model", Known)
    usual = {"preload": (8.0, 2.0), "spring": (0.4, 0.1)}
    assert (weight._pulled(usual, station, states, odd_preload=True) is not None) == weighs


def test_a_weight_is_no_more_than_its_drive_could_lift() -> None:
    states = posed(drive(1, trials=2))
    most = max(float(np.nanmax(np.abs(s.effort))) for s in states)
    possible = [effect("gravity_load").possible(states, {"largest": share * most}) for share in (0.3, 1.5, 2.5)]
    assert possible == [True, True, False]


@pytest.mark.parametrize(("shown", "told"), [(1.0, True), (0.02, False)])
def test_a_pose_that_hardly_shows_a_weight_tells_of_none(
    monkeypatch: pytest.MonkeyPatch, shown: float, told: bool
) -> None:
    """What would be a weight of 45 raw where the finger moves upright is one of 2250 where it moves nearly level."""

    def level(state: Any) -> Any:
        gravity = {name: shown * state.extra[name] for name in ("gravity_along", "gravity_across")}
        return replace(state, extra={**state.extra, **gravity})

    upright = posed
    monkeypatch.setattr(f"{__name__}.posed", lambda states: tuple(level(s) for s in upright(states)))
    stations, findings = heard(monkeypatch, lambda s: -45.0 * np.sin(1.7 + SWEEP * s.position / 100))
    named = {f.term.effect.name for s in stations if s.believed for f in s.kept}
    assert ("gravity_load" in {f.effect for _, f in findings} | named) == told


def test_a_bent_spring_is_taken_from_the_line_between_its_ends() -> None:
    balance = Balance(drive(1, trials=2))
    terms = tuple(Term(effect(n), s) for n, s in (("torque_ripple", {"period": 9.0}), (weight.BENT, {"form": 0.0})))
    design = balance.design(terms)[0]
    bent = weight._from_chords(balance, terms, design)
    position = balance.gather(lambda s: s.position)
    ends = [int(np.argmin(position)), int(np.argmax(position))]
    np.testing.assert_array_equal(bent[:, :-2], design[:, :-2])
    np.testing.assert_allclose(bent[ends, -2:], 0.0, atol=1e-6)
    line = np.c_[np.ones(len(position)), position]
    for column in (design - bent)[:, -2:].T:  # what was taken off is a line
        np.testing.assert_allclose(line @ np.linalg.lstsq(line, column, rcond=None)[0], column, atol=1e-6)
