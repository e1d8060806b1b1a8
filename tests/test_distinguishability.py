"""Distinguishability: what recordings can tell apart, from their motions alone."""

from __future__ import annotations

import numpy as np
import pytest
from test_diagnose import drive

from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.distinguishability import distinguishability, protocol_pairs
from hand_model.effects import effect

SPEED_LAWS = [effect("stribeck_friction"), effect("quadratic_damping")]


def only(states, low: float, high: float):
    """The states with the effort of other speeds left out."""
    return tuple(
        type(s)(
            **{
                **vars(s),
                "effort": np.where((np.abs(s.velocity) >= low) & (np.abs(s.velocity) <= high), s.effort, np.nan),
            }
        )
        for s in states
    )


def test_laws_of_speed_need_many_speeds() -> None:
    states = drive(3, trials=4)
    fastest = max(float(np.abs(s.velocity).max()) for s in states)
    pair = ("stribeck_friction", "quadratic_damping")
    wide = distinguishability(Balance(states), SPEED_LAWS)[pair]
    narrow = distinguishability(Balance(only(states, 0.5 * fastest, fastest)), SPEED_LAWS)[pair]
    assert wide > 3 * narrow


def test_an_effect_cannot_be_told_from_itself_and_twice_the_recordings_tell_twice_as_much() -> None:
    class Twin:
        """The same law by another name."""

        name = "of_another_name"

        def __getattr__(self, name: str):
            return getattr(effect("torque_ripple"), name)

    laws = [effect("torque_ripple"), Twin(), effect("detent_load")]
    once, twice = (distinguishability(Balance(drive(5, trials=n)), laws) for n in (3, 6))
    assert once["torque_ripple", "of_another_name"] == pytest.approx(0.0, abs=1e-6)
    assert twice["torque_ripple", "detent_load"] == pytest.approx(2 * once["torque_ripple", "detent_load"], rel=0.3)
    told, alike = protocol_pairs(Balance(drive(5, trials=3)), laws)
    assert ["torque_ripple", "of_another_name"] in alike
    assert any({"torque_ripple", "detent_load"} == set(entry[:2]) for entry in told)


def test_events_of_one_recording_are_left_out() -> None:
    laws = [effect("external_contact"), *SPEED_LAWS]
    assert set(distinguishability(Balance(drive(3, trials=4)), laws)) == {("stribeck_friction", "quadratic_damping")}
