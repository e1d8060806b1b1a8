"""All friction acts through the bristles, where there are any."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnose import drive

from hand_model.diagnose.locate.doubt import LEAST_GIVE
from hand_model.diagnose.locate.drive import GIVE_USUAL, gives, with_gives
from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.bristles import bristled, with_bristles
from hand_model.diagnose.name.shapes import refit
from hand_model.diagnose.name.term import Term, replaced
from hand_model.diagnose.prove.improve import as_fitted
from hand_model.effects import catalogue, effect, outsiders
from hand_model.effects.base import DriveState
from hand_model.effects.path import dahl
from hand_model.hand import Hand

BRISTLES = Term(effect("presliding_friction"), {"bristle_length": 6.0, "bristle_time": 0.0, "form": 0.0})
READ = {"position_noise": 0.02, "steady": 1.0, "smoothed": 1.0}  # of a motion
OF_A_DRIVE = [*catalogue("drive"), *outsiders("drive")]


@pytest.mark.parametrize("candidate", OF_A_DRIVE, ids=[e.name for e in OF_A_DRIVE])
def test_what_has_the_direction_of_friction_says_so(candidate) -> None:
    states = tuple(
        replace(s, extra={**s.extra, "required": s.declared[:, 2], "load": np.ones(len(s.time_s))})
        for s in drive(1, trials=2)
    )
    for shape in candidate.grid(states)[:40:8]:
        as_it_is, turned = (candidate.columns(s, shape) for s in (states[0], replaced(states[0], (BRISTLES,))))
        assert candidate.rubs or np.array_equal(as_it_is, turned)


def test_bristles_turn_over_what_is_friction_and_nothing_else() -> None:
    balance = Balance(drive(1, trials=2))
    warm = Term(effect("thermal_friction_drift"), {"form": 0.0, "warm_up_time": 60.0, "cooling_time": 5.0})
    drag = Term(effect("quadratic_damping"), {})
    matrix, _, _ = balance.design((BRISTLES, warm, drag))
    z, elapsed = matrix[:, balance.names.index("coulomb")], balance.gather(lambda s: s.elapsed_s)
    assert np.mean(np.abs(z) < 0.9) > 0.05  # bristles give
    np.testing.assert_allclose(matrix[:, 5], z * np.exp(-elapsed / 60.0), atol=1e-12)
    np.testing.assert_array_equal(matrix[:, 6], balance.design((drag,))[0][:, 5])


def test_columns_of_a_grid_are_those_of_a_fit() -> None:
    balance = Balance(drive(1, trials=2))
    warm = effect("thermal_friction_drift")
    weight = balance.weight * balance.train
    grid = balance.grid(warm)
    for terms in ((), (BRISTLES,), ()):
        terms = tuple(t.coarse for t in terms)
        stacked = balance.grid_columns(grid, weight, terms).matrix
        wanted = (
            np.concatenate([balance.design((*terms, Term(warm, shape)))[0][:, -1:] for shape in grid.shapes], axis=1)
            * weight[:, None]
        )
        np.testing.assert_allclose(
            np.asarray(stacked if isinstance(stacked, np.ndarray) else stacked.toarray()), wanted, atol=1e-12
        )


def test_bristles_and_a_slow_warm_up_are_no_hysteresis() -> None:
    """A warm-up of many times the session is friction that does not change: it must not stand in for the friction that
    bristles took over."""
    hysteresis = Term(effect("elastoplastic_hysteresis"), {"form": 0.0, "reach": 12.0})
    balance = Balance(drive(5, lambda s: hysteresis.effect.columns(s, hysteresis.shape) @ [18.0]))
    warm = Term(effect("thermal_friction_drift"), {"form": 0.0, "warm_up_time": 600.0, "cooling_time": 5.0})
    nothing, true, both = (refit(balance, balance.fit(terms)).rss for terms in ((), (hysteresis,), (BRISTLES, warm)))
    assert nothing - both < 0.1 * (nothing - true)


def test_a_written_motor_has_the_bristles_that_were_named() -> None:
    """Every law of friction in the written model is turned over by them, as it was in the fit."""
    states = tuple(replace(s, extra={**s.extra, "give": np.full(len(s.time_s), 0.7)}) for s in drive(1, trials=2))
    balance = Balance(states)
    station = SimpleNamespace(
        signal="current",
        actuator="index",
        naming=SimpleNamespace(balance=balance, declared=balance.fit(), fit=balance.fit((BRISTLES,))),
    )
    station.reading = station.naming
    hand = Hand("h", "left", {}, {}, (), 1e-4, {}, (), ())
    before, after = (
        as_fitted(hand, [station], {"index": (0.0, 4000.0)}, lambda source, w=which: getattr(source, w)).motors[0]
        for which in ("declared", "fit")
    )
    assert before.parameters["presliding"].value == 0.7
    assert after.parameters["presliding"].value == BRISTLES.shape["bristle_length"]


def rubbing(seed: int, coulomb: float, length: float, late_s: float = 0.0) -> tuple[DriveState, ...]:
    """A drive with bristles of that length, whose current is read late."""

    def one(state: DriveState) -> DriveState:
        effort = state.declared @ np.array([0.0, 0.15, 0.0, 0.22, 10.0]) + coulomb * dahl(state.position, length)
        effort = np.interp(state.time_s - late_s, state.time_s, effort)
        noise = np.random.default_rng(seed).normal(0, 1.0, len(effort))
        extra = {name: np.full(len(effort), value) for name, value in READ.items()}
        read = np.where(np.isfinite(state.effort), effort + noise, np.nan)
        return replace(state, effort=read, extra={**state.extra, **extra})

    return tuple(one(s) for s in drive(seed))


@pytest.mark.parametrize(("late_s", "own"), [(0.0, False), (0.036, True)])
def test_a_late_current_leaves_its_drive_the_bristles_it_has(late_s: float, own: bool) -> None:
    """They are as long as another's where its current is early, and may be."""
    found = with_gives({"ring": rubbing(1, 25.0, 0.1, late_s), "index": rubbing(2, 25.0, 0.4)}, ["index"])
    give, granted = (found["ring"][0].extra[name][0] for name in ("give", "granted"))
    assert granted == found["index"][0].extra["granted"][0] == pytest.approx(1.6 * 0.4, rel=0.1)
    assert give == pytest.approx(0.1, rel=0.5) if own else give == granted


def test_beside_a_current_that_is_known_to_be_late_a_drive_has_the_bristles_that_go_with_it() -> None:
    """Also where they are not plainly likelier than those that stand for the delay."""
    drives = {"ring": rubbing(1, 25.0, 0.1, 0.006), "index": rubbing(2, 25.0, 0.4)}
    known = with_gives(drives, ["index"], {"ring": 0.006})["ring"][0].extra["give"][0]
    assert known == pytest.approx(0.1, rel=0.5) and with_gives(drives, ["index"])["ring"][0].extra["give"][0] > 0.6


@pytest.mark.parametrize(("friction", "granted"), [(50.0, True), (25.0, False)])
def test_bristles_may_be_as_long_as_anothers_or_as_stiff(friction: float, granted: bool) -> None:
    """Twice the friction turns over within twice the way on bristles of one stiffness; as much within twice the way is
    presliding."""

    found, _ = gives({"ring": rubbing(1, friction, 0.83), "index": rubbing(2, 25.0, 0.4)})
    assert found["index"].length == pytest.approx(0.4, rel=0.1)
    assert (found["ring"].granted > 0.83) == granted


@pytest.mark.parametrize(("other", "granted"), [(0.2, GIVE_USUAL), (0.03, LEAST_GIVE)])
def test_where_one_drive_is_sharp_another_is_granted_no_soft_friction(other: float, granted: float) -> None:
    found, _ = gives({"ring": rubbing(1, 25.0, 0.4), "index": rubbing(2, 25.0, other)})
    assert found["ring"].granted == pytest.approx(granted)


@pytest.mark.parametrize("own", [True, False])
def test_what_builds_up_after_a_reversal_leaves_a_drive_its_own_bristles(own: bool) -> None:
    """Beside a hysteresis bristles taken three times too long come out as short as they are; presliding of 1.2 % that
    was named in their place goes, one of 4 % stays."""
    hysteresis = Term(effect("elastoplastic_hysteresis"), {"form": 1.0, "reach": 12.0})
    length = 0.4 if own else 4.0

    def one(state: DriveState) -> DriveState:
        true = bristled(state, length)
        load = hysteresis.effect.columns(state, hysteresis.shape) @ [14.0]
        effort = true.declared @ np.array([0.0, 0.15, 35.0, 0.22, 10.0]) + load
        noise = np.random.default_rng(3).normal(0, 2.0, len(effort))
        told = replace(state, effort=np.where(np.isfinite(state.effort), effort + noise, np.nan))
        return bristled(replace(told, extra={**told.extra, "granted": np.full(len(effort), 1.2)}), 1.2)

    balance = Balance(tuple(one(s) for s in drive(5)))
    named = Term(BRISTLES.effect, {**BRISTLES.shape, "bristle_length": 1.2 if own else length})
    other, fit = with_bristles(balance, balance.fit((hysteresis, named)))
    assert (named in fit.terms) != own
    assert other.states[0].extra["give"][0] == pytest.approx(length if own else 1.2, rel=0.25)
    assert fit.amplitudes[0]["yield_load"] == pytest.approx(14.0, rel=0.1)
    healthy = balance.fit()
    assert with_bristles(balance, healthy) == (balance, healthy)
