"""Candidates beside terms that would turn to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_motion import state

from hand_model.background import Pair
from hand_model.diagnose.name.balance import Balance, Fit
from hand_model.diagnose.name.candidates import rank
from hand_model.diagnose.name.evidence import evidence, gain
from hand_model.diagnose.name.naming import Rival
from hand_model.diagnose.name.shapes import refit, scan
from hand_model.diagnose.name.tangent import Tangents, turned
from hand_model.diagnose.name.term import Term, reshaped
from hand_model.effects import effect
from hand_model.effects.base import DriveState
from hand_model.effects.path import dahl

BRISTLES, RISE, DRAG = (effect(n) for n in ("presliding_friction", "stribeck_friction", "quadratic_damping"))


def dragging(seed: int, length: float = 2.0, drag: float = 0.0002) -> DriveState:
    """A drive that rubs over soft bristles, and more by the square of its speed."""
    motion = state(3000)
    turned_over = dahl(motion.position, length)
    effort = motion.declared @ np.array([0.01, 0.12, 0.0, 0.2, 9.0]) + (38.0 + drag * motion.velocity**2) * turned_over
    return replace(motion, effort=effort + np.random.default_rng(seed).normal(0, 1.0, len(effort)))


@pytest.fixture(scope="module")
def risen() -> tuple[Balance, Fit]:
    """Such a drive, and bristles with a Stribeck rise fitted to it."""
    balance = Balance((dragging(1),)).learning()
    terms = (scan(balance, BRISTLES, ()).terms[0], Term(RISE, {"form": 1.0, "stribeck_speed": 100.0}))
    return balance, refit(balance, balance.fit(terms), rounds=4)


def test_tangents_foretell_what_a_joint_fit_gains(risen: tuple[Balance, Fit]) -> None:
    balance, fit = risen
    beside = balance.fit((fit.terms[0], scan(balance, DRAG, fit.terms[:1]).terms[-1]))
    jointly = refit(balance, beside)
    gained = beside.rss - jointly.rss
    assert gained > 100.0
    assert Tangents.of(balance, fit).gain(balance, beside, [0]) == pytest.approx(gained, rel=0.2)
    assert Tangents.of(balance, fit).gain(balance, beside, []) == 0.0
    assert Tangents.of(balance, jointly).gain(balance, jointly, [0]) < 0.02 * gained  # it has turned


def test_a_rival_is_weighed_beside_the_others_as_they_turn_to_it(risen: tuple[Balance, Fit]) -> None:
    balance, fit = risen
    without = balance.fit(fit.terms[:1])
    own = Rival(RISE.name, evidence(balance, fit, without), fit)
    with Pair(balance) as pair:
        ranked = rank(pair, (DRAG, effect("detent_load")), fit.terms[:1], without)
    before = {r.name: r for r in ranked}
    after = {r.name: r for r in turned(balance, ranked, own, without, Tangents.of(balance, fit), [0])}
    assert before[DRAG.name].evidence < own.evidence < after[DRAG.name].evidence
    assert gain(balance, after[DRAG.name].fit, fit) > 0
    assert after["detent_load"] is before["detent_load"]  # turning does not bring it near


def test_one_of_several_terms_takes_another_shape() -> None:
    terms = (Term(BRISTLES, {"form": 0.0}), Term(RISE, {"form": 1.0}), Term(DRAG, {}))
    for which in range(len(terms)):
        wanted = tuple(Term(t.effect, {"form": 2.0}) if i == which else t for i, t in enumerate(terms))
        assert reshaped(terms, which, {"form": 2.0}) == wanted
        assert reshaped(terms, which - len(terms), {"form": 2.0}) == wanted  # counted from the end
