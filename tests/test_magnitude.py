"""How large an effect is for its kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_diagnose import drive, planted

from hand_model.diagnose.assemble import SIGNALS, _sure
from hand_model.diagnose.magnitude import LEAST, MOST, PLAIN, channel_figures, magnitude
from hand_model.effects import catalogue

RAW = {"asymmetric_friction": {"half_difference": 4.0}, "detent_load": {"load": 5.0}, "elastoplastic_hysteresis": {"yield_load": 3.0},
       "quadratic_damping": {"drag": 3e-4}, "position_dependent_friction": {"extra_friction": 4.0}, "torque_ripple": {"amplitude": 2.0},
       "viscoelastic_spring": {"stiffness": 0.1}, "gravity_load": {"along": 3.0, "across": -2.0}, "thermal_friction_drift": {"cold_excess": -2.0},
       "nonlinear_spring": {"bend": 4.0}}


@pytest.mark.parametrize("effect", RAW)
def test_a_tenth_is_a_tenth_and_the_unit_of_the_current_does_not_matter(effect: str) -> None:
    states = drive(0, planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-12.0]))
    milliampere = tuple(replace(s, effort=1e3 * s.effort) for s in states)
    plain = magnitude(effect, RAW[effect], channel_figures(states))
    assert LEAST < plain < MOST
    thousand = {k: 1e3 * v for k, v in RAW[effect].items()}
    assert magnitude(effect, thousand, channel_figures(milliampere)) == pytest.approx(plain)
    assert magnitude(effect, {k: 0.1 * v for k, v in RAW[effect].items()}, channel_figures(states)) == pytest.approx(0.1 * plain)


def test_every_effect_of_a_hand_has_a_figure_and_what_has_none_counts_as_plain() -> None:
    named = {e.name for e in catalogue()} - {"command_as_measurement"}  # a refusal
    assert {e.station for e in catalogue()} - {"markers"} == set(SIGNALS)  # and its figure refers to the channel in which it shows
    assert named - set(PLAIN) == set()
    assert magnitude("something_new", {"size": 7.0}) == 1.0
    assert magnitude("detent_load", {"load": np.nan}) == 1.0


@pytest.mark.parametrize(("entry", "sure"), [({"value": 3.0}, 3.0), ({"value": -3.0, "ci95": [-4.0, -2.0]}, -2.0), ({"value": 3.0, "ci95": [-1.0, 7.0]}, 0.0),
                                             ({"value": None, "ci95": None}, None)])
def test_what_is_sure_of_a_figure_is_the_end_of_its_interval_nearer_to_zero(entry, sure) -> None:
    assert _sure(entry) == sure


def test_bristles_count_by_what_they_are_longer_than_any_drive_is_granted() -> None:
    states = tuple(replace(s, extra={**s.extra, "granted": np.full(len(s.time_s), 0.9)}) for s in drive(0))
    sizes = [magnitude("presliding_friction", {"bristle_length": length}, channel_figures(states)) for length in (0.9, 1.9, 2.9)]
    assert sizes[0] == LEAST and sizes[2] == pytest.approx(2 * sizes[1])
