"""Preload: what only a comparison of a hand's motors tells."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnose import drive

from hand_model.diagnose.locate.known_motors import MEDIAN, PRELOAD, kinship, preload_by_chance
from hand_model.diagnose.locate.preload import preload_findings
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.term import Term
from hand_model.effects import effect

OTHER = 8.0  # times the currents of a known hand


def hand(*half_difference: float, scale: float = 1.0):
    """Stations of as many motors as given, each with that much more current flexing than extending [raw]. scale: of
    their currents; with one they are like those of a known hand."""

    return [
        judged(
            "current",
            f"finger_{i}",
            f"motor_{i}",
            None,
            scaled(drive(11 + i, lambda s, half=half: np.full(len(s.time_s), half)), scale),
            [effect("torque_ripple")],
        )
        for i, half in enumerate(half_difference)
    ]


def scaled(states, scale: float):
    """The states with other currents."""
    return tuple(replace(s, effort=scale * s.effort) for s in states)


def test_motors_alike_are_not_accused() -> None:
    assert not preload_findings(hand(0.0, 2.0))
    assert not preload_findings(hand(0.0))


@pytest.mark.parametrize("half", [25.0, -12.0])
def test_the_lopsided_one_is_named_in_a_class_with_another_preload(half: float) -> None:
    found = preload_findings(hand(0.0, half, 0.5))
    assert [f.where["finger"] for _, f in found] == ["finger_1"]
    finding = found[0][1]
    assert finding.effect == "asymmetric_friction" and "spring_preload" in finding.members
    low, high = finding.parameters["half_difference"]["ci95"]
    assert low < half < high
    assert "the same" in finding.statement
    value, noise = finding.parameters["half_difference"]["value"], finding.fit["noise_floor"]
    assert finding.fit["after"] == pytest.approx(noise, rel=0.1)
    assert finding.fit["before"] == pytest.approx(np.hypot(noise, value), rel=0.1)


@pytest.mark.slow
def test_of_two_that_differ_the_heavier_is_odd_unless_one_has_lost_its_preload() -> None:
    for scale in (1.0, OTHER):
        assert [f.where["finger"] for _, f in preload_findings(hand(25.0, 0.0, scale=scale))] == ["finger_0"]
        assert [f.where["finger"] for _, f in preload_findings(hand(-12.0, 0.0, scale=scale))] == ["finger_0"]


def test_motors_of_a_known_hand_are_told_by_their_figures_and_known_by_their_preload() -> None:
    medians = [MEDIAN] * 2
    assert kinship(medians) > 0.99
    assert kinship([{k: f * v for (k, v), f in zip(MEDIAN.items(), (0.9, 1.15, 0.85), strict=True)}] * 2) > 0.9
    assert kinship([{**MEDIAN, "coulomb": OTHER * MEDIAN["coulomb"], "spring": OTHER * MEDIAN["spring"]}] * 2) < 0.01
    assert kinship([{k: v for k, v in MEDIAN.items() if k != "spring"}]) == 0.0
    assert preload_by_chance(1.1 * PRELOAD, 0.1) > 0.3
    assert preload_by_chance(0.4 * PRELOAD, 0.1) < 0.01
    assert preload_by_chance(-PRELOAD, 0.1) < 1e-6
    # another motor of the same hand that is unlike them, too, says that these differ more
    assert preload_by_chance(1.5 * PRELOAD, 0.1) < 0.02 < preload_by_chance(1.5 * PRELOAD, 0.1, [0.6 * PRELOAD])
    assert preload_by_chance(1.5 * PRELOAD, 0.1, [PRELOAD]) < 0.02
    # so do motors that differ in all else
    known, unlike = MEDIAN, {name: 1.4 * value for name, value in MEDIAN.items()}
    assert preload_by_chance(1.5 * PRELOAD, 0.1, [PRELOAD], [known, unlike]) > 0.02
    assert preload_by_chance(1.5 * PRELOAD, 0.1, [PRELOAD], [known, known]) < 0.02


def test_of_two_motors_of_a_known_kind_the_one_unlike_those_is_odd_and_one_alone_can_be() -> None:
    """A preload of 3 beside the usual 9: by sizes alone the other one would be odd."""
    assert [f.where["finger"] for _, f in preload_findings(hand(-6.0, 0.0))] == ["finger_0"]
    assert [f.where["finger"] for _, f in preload_findings(hand(-6.0, 0.0, scale=OTHER))] == ["finger_1"]
    assert [f.where["finger"] for _, f in preload_findings(hand(10.0))] == ["finger_0"]
    assert not preload_findings(hand(10.0, scale=OTHER))


def test_drives_alike_in_everything_else_are_held_to_be_alike_in_their_preload_and_others_are_not() -> None:
    assert [f.where["finger"] for _, f in preload_findings(hand(8.0, 0.0, scale=OTHER))] == ["finger_0"]
    other = judged(
        "current",
        "ring",
        "ring",
        None,
        scaled(drive(12, lambda s: 14.0 * s.direction + 0.07 * s.velocity), OTHER),
        [effect("torque_ripple")],
    )
    assert not preload_findings([*hand(8.0, scale=OTHER), other])


def test_of_two_either_may_be_the_odd_one_and_the_probability_says_so() -> None:
    two, three = (
        next(f for _, f in preload_findings(hand(*halves))).probability for halves in ((25.0, 0.0), (25.0, 0.0, 0.5))
    )
    assert 0.5 < two < three
    assert three > 0.95


def test_a_motor_that_does_not_repeat_itself_is_not_compared() -> None:
    def shaken(state):
        return 12.0 + 15.0 * np.sin(2 * np.pi * 0.37 * state.elapsed_s)

    one = judged("current", "index", "index", None, drive(4, shaken), [effect("torque_ripple")])
    assert one.wander > 1.0
    assert not preload_findings([one, *hand(0.0, 0.5)])


def test_a_motor_of_which_something_is_missing_accuses_no_other() -> None:
    spot = effect("position_dependent_friction")
    one = judged(
        "current",
        "ring",
        "ring",
        None,
        scaled(drive(9, lambda s: 25.0 * spot.columns(s, {"centre": 50.0, "width": 6.0})[:, 0]), OTHER),
        [spot],
    )
    assert one.missing and one.believed
    assert preload_findings(hand(25.0, 0.0, scale=OTHER)) and not preload_findings([*hand(25.0, scale=OTHER), one])


def test_a_motor_that_met_an_obstacle_once_says_what_is_usual() -> None:
    contact = effect("external_contact")
    shape = {"trial": 1.0, "form": 0.0, "since": 0.3, "until": 0.8, "begin": 55.0}
    one = judged("current", "ring", "ring", None, drive(9, lambda s: contact.columns(s, shape)[:, 0]), [contact])
    assert one.missing and one.believed
    assert [f.where["finger"] for _, f in preload_findings([*hand(25.0), one])] == ["finger_0"]


@pytest.mark.parametrize(("below", "accused"), [(4.0, ["finger_0"]), (40.0, [])])
def test_only_a_finger_that_is_plainly_pulled_off_its_drive_keeps_its_drive_from_being_compared(
    below: float, accused: list[str]
) -> None:
    states = tuple(replace(s, effort=80.0 * s.position / 100, effort_unit="deg") for s in drive(11))
    term = Term(effect("spring_decoupling"), {"form": 1.0, "below": below, "corner": 0.1})
    naming = SimpleNamespace(balance=SimpleNamespace(states=states), fit=SimpleNamespace(terms=(term,)))
    named = SimpleNamespace(
        signal="encoder",
        actuator="motor_0",
        naming=naming,
        standing={"spring_decoupling": SimpleNamespace(term=term)}.get,
        parameters={0: {"form": {"value": 1.0}, "below": {"value": below}, "lead": {"value": 0.3}}},
    )
    assert [f.where["finger"] for _, f in preload_findings([*hand(-12.0, 0.0), named])] == accused
