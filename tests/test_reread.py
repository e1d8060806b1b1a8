"""Findings among themselves: sizes without what is no finding, maps beside lost motion, what belongs to the
recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_diagnose import drive, planted
from test_kinematic_stations import MAP, joint

from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.entries import finding_of
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.reread import of_recording, reread
from hand_model.diagnose.name.selection import name_effects
from hand_model.diagnose.name.shapes import error_beside, polish
from hand_model.diagnose.name.term import Term
from hand_model.effects import catalogue, effect

COMPLIANCE = 0.04  # % per raw


def yielding(states):
    """The same recordings behind a give at the driver's end, whose slope was read from angles that hold the give
    already."""
    out = []
    for state in states:
        polynomial = np.polynomial.Polynomial(MAP)
        give = COMPLIANCE * state.extra["load"]
        x = state.position
        angle = state.effort + polynomial((x - give) / 100) - polynomial(x / 100)
        bent = np.polynomial.Polynomial.fit(x, angle, 3).deriv()(x)
        out.append(replace(state, effort=angle, extra={**state.extra, "slope": bent}))
    return tuple(out)


def test_the_map_beside_a_give_has_its_own_slope() -> None:
    states = yielding(joint(4, noise=0.2))
    naming = name_effects(states, (effect("series_elasticity"),))
    assert [f.term.effect.name for f in naming.found] == ["series_elasticity"]
    for state in naming.balance.states:
        true = np.polynomial.Polynomial(MAP).deriv()(state.position / 100) / 100
        before = next(s for s in states if s.trial == state.trial).extra["slope"]
        assert np.abs(state.slope - true).max() < 0.25 * np.abs(before - true).max()
    assert naming.found[0].amplitudes["compliance"] == pytest.approx(COMPLIANCE, rel=0.03)


def test_a_balance_without_a_map_is_as_it_was() -> None:
    balance = Balance(drive(1))
    assert balance.remapped(balance.fit()) is balance


def test_what_is_no_finding_is_not_in_the_sizes_of_the_others() -> None:
    def add(state):
        return planted("stribeck_friction", {"form": 0.0, "stribeck_speed": 20.0}, [18.0])(state) + planted(
            "detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-10.0]
        )(state)

    station = judged("current", "index", "index", None, drive(3, add), catalogue("drive"))
    assert {f.term.effect.name for f in station.kept} == {"stribeck_friction", "detent_load"}
    both = tuple(finding_of(station, f, 0.5, f.size)[1] for f in station.kept)
    rising = next(f for f in both if f.effect == "stribeck_friction")
    assert rising.where["region"]["speed"][1] == pytest.approx(2 * rising.parameters["stribeck_speed"]["value"])
    same, (whole,) = reread(both, [station])
    assert [f.parameters for f in same] == [f.parameters for f in both]
    assert whole.reading.fit is station.reading.fit
    alone = tuple(f for f in both if f.effect == "stribeck_friction")
    (found,), (written,) = reread(alone, [station])
    assert [t.effect.name for t in written.reading.fit.terms] == ["stribeck_friction"]
    figures = written.reading.fit.terms[0].effect.parameters(
        written.reading.fit.terms[0].shape, written.reading.fit.amplitudes[0], written.reading.fit.declared
    )
    assert found.parameters["stribeck_speed"]["value"] == pytest.approx(figures["stribeck_speed"])
    assert found.parameters != alone[0].parameters
    assert found.where["share_of_mismatch"] == alone[0].where["share_of_mismatch"]
    assert found.fit["after"] > alone[0].fit["after"]  # the detent is nobody's now


def test_what_belongs_to_the_recording_stays_with_it() -> None:
    states = joint(5, add=lambda t, x, v: 1.2 * np.sin(2 * np.pi * x / 12.0), noise=0.3)
    balance = Balance(states)
    fit = polish(balance, balance.fit((Term(effect("encoder_periodic_error"), {"period": 12.1}),)), 0)
    for state in states:
        own = of_recording(fit, state)
        np.testing.assert_allclose(own, 1.2 * np.sin(2 * np.pi * state.position / 12.0), atol=0.15)


def test_where_a_force_from_outside_moved_a_finger_its_replay_is_given_that() -> None:
    """No recording holds the force that keeps a slack finger bent: nothing in the file could do it."""
    states = joint(5, add=lambda t, x, v: 0.3 * np.maximum(0.0, 30.0 - x), noise=0.3)
    balance = Balance(states)
    fit = balance.fit((Term(effect("spring_decoupling"), {"form": 1.0, "below": 30.0, "corner": 0.1}),))
    for state in states:
        own = of_recording(fit, state)
        np.testing.assert_allclose(own, 0.3 * np.maximum(0.0, 30.0 - state.position), atol=0.25)


@pytest.mark.parametrize(
    ("name", "shape", "start"),
    [("detent_load", {"form": 0.0, "width": 6.0}, {"centre": 55.0}), ("torque_ripple", {}, {"period": 9.02})],
)
def test_a_shape_polished_beside_a_projection_is_that_of_full_fits(name, shape, start) -> None:
    amplitude = [12.0] if name == "detent_load" else [4.0, 3.0]
    balance = Balance(drive(7, planted(name, {**shape, "centre": 57.0, "period": 9.0}, amplitude), trials=3))
    others = (
        Term(effect("stribeck_friction"), {"form": 0.0, "stribeck_speed": 20.0}),
        Term(effect("nonlinear_spring"), {"form": 0.0}),
    )
    error = error_beside(balance, others, effect(name), balance.fit(others))
    for step in (0.0, 0.3, 0.7):
        moved = {**shape, **{k: v + step for k, v in start.items()}}
        whole = balance.fit((*others, Term(effect(name), moved))).rss
        assert error(moved) == pytest.approx(whole, rel=1e-9)


def test_where_lost_motion_lay_before_the_first_motion_is_not_asked() -> None:
    from hand_model.diagnose.locate.angles import _begun

    driver = np.r_[np.full(100, 3.0), np.linspace(3.0, 80.0, 200), np.linspace(80.0, 2.0, 200)] + np.random.default_rng(
        0
    ).normal(0, 0.1, 500)
    begun = _begun(driver)
    first = int(np.argmax(begun))
    assert 105 <= first <= 115 and not begun[:first].any() and begun[first:].all()


def test_a_sag_is_read_from_what_is_asked_beside_it() -> None:
    """What is asked bends as the drive that sags by a third makes it: from the beginning, though no effect is known
    then."""
    from hand_model.diagnose.locate.drive import with_required

    truly = []

    def sagging(state):
        truth = state.declared @ np.array([0.012, 0.1, 38.0, 0.2, 9.0])
        # u (1 - 0.3 |u| / 100) = truth
        asked = (1 - np.sqrt(1 - 4 * 0.3 / 100 * np.abs(truth))) / (2 * 0.3 / 100) * np.sign(truth)
        truly.append(asked)
        return replace(
            state,
            effort=np.where(
                np.isfinite(state.effort), asked + np.random.default_rng(9).normal(0, 4, len(asked)), np.nan
            ),
        )

    states = with_required(tuple(sagging(s) for s in drive(6)))
    for state, asked in zip(states, truly, strict=True):
        np.testing.assert_allclose(state.extra["required"], asked, atol=3.0)
    station = judged("current", "index", "index", None, states, catalogue("drive"))
    assert [f.term.effect.name for f in station.kept] == ["drive_sag"]
    (found,), _ = reread((finding_of(station, station.kept[0], 1.0, 1.0)[1],), [station])
    assert found.parameters["form"]["value"] == 0.0
    assert found.parameters["torque_loss"]["value"] == pytest.approx(0.3, rel=0.07)
    values = {k: v["value"] for k, v in found.parameters.items()}
    asked = np.linspace(-130.0, 130.0, 53)
    law, sag = effect("drive_sag").law(values), effect("drive_sag")
    delivered = asked - np.array([law(type("Now", (), {"load": u})) for u in asked])
    assert np.all(np.diff(delivered) > 0)
    np.testing.assert_allclose(sag.reading(delivered, asked, asked, values), asked, atol=1e-6)


def test_preload_and_spring_of_the_file_hold_a_weight_in_the_pose_that_was_recorded() -> None:
    """A hand that never turned: the weight itself is written nowhere."""
    from hand_model.diagnose.prove.improve import holding_weight
    from hand_model.diagnose.weight import PULL

    states = tuple(
        replace(
            s,
            declared=np.column_stack([s.declared, np.cos(np.deg2rad(20 + 0.8 * s.position))]),
            declared_names=(*s.declared_names, PULL),
        )
        for s in drive(1)
    )
    declared = {**dict.fromkeys(states[0].declared_names, 0.0), "spring": 0.2, "preload": 15.0, PULL: 12.0}
    held = holding_weight(states, declared)
    for s in states:
        wanted = s.declared @ np.array([declared[k] for k in s.declared_names])
        own = s.declared[:, :-1] @ np.array([held[k] for k in s.declared_names[:-1]])
        assert np.abs(own - wanted).max() < 2.0  # of 12: all but its bend
        assert abs(np.mean(own - wanted)) < 0.05
    without = {k: v for k, v in declared.items() if k != PULL}
    assert holding_weight(states, without) is without
