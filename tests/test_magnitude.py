"""How large an effect is for its kind."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnose import drive, planted

from hand_model.diagnose.assemble import SIGNALS, _stiffness
from hand_model.diagnose.magnitude import (
    LEAST,
    MOST,
    PLAIN,
    Channel,
    channel_figures,
    likely_magnitude,
    magnitude,
    sure_magnitude,
    sure_share,
    values_of,
)
from hand_model.diagnose.name.balance import Balance, Fit
from hand_model.diagnose.name.term import Term
from hand_model.effects import catalogue, effect

RAW = {
    "asymmetric_friction": {"half_difference": 4.0},
    "detent_load": {"load": 5.0},
    "elastoplastic_hysteresis": {"yield_load": 3.0},
    "quadratic_damping": {"drag": 3e-4},
    "position_dependent_friction": {"extra_friction": 4.0},
    "torque_ripple": {"amplitude": 2.0},
    "viscoelastic_spring": {"stiffness": 0.1},
    "gravity_load": {"largest": 3.6},
    "thermal_friction_drift": {"cold_excess": -2.0},
    "nonlinear_spring": {"bend": 4.0},
}


@pytest.mark.parametrize("effect", RAW)
def test_a_tenth_is_a_tenth_and_the_unit_of_the_current_does_not_matter(effect: str) -> None:
    states = drive(0, planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-12.0]))
    milliampere = tuple(replace(s, effort=1e3 * s.effort) for s in states)
    plain = magnitude(effect, RAW[effect], channel_figures(states))
    assert LEAST < plain < MOST
    thousand = {k: 1e3 * v for k, v in RAW[effect].items()}
    assert magnitude(effect, thousand, channel_figures(milliampere)) == pytest.approx(plain)
    assert magnitude(effect, {k: 0.1 * v for k, v in RAW[effect].items()}, channel_figures(states)) == pytest.approx(
        0.1 * plain
    )


def test_every_effect_of_a_hand_has_a_figure_and_what_has_none_counts_as_plain() -> None:
    named = {e.name for e in catalogue()} - {"command_as_measurement"}  # a refusal
    # and its figure refers to the channel in which it shows
    assert {e.station for e in catalogue()} - {"markers"} == set(SIGNALS)
    assert named - set(PLAIN) == set()
    assert magnitude("something_new", {"size": 7.0}) == 1.0
    assert magnitude("detent_load", {"load": np.nan}) == 1.0


@pytest.mark.parametrize(
    ("entry", "share"),
    [
        ({"value": 4.0}, 1.0),
        ({"value": -4.0, "ci95": [-5.0, -3.0]}, 0.75),
        ({"value": 4.0, "ci95": [-1.0, 9.0]}, 0.0),
        ({"value": 4.0, "ci95": None}, 1.0),
        ({"value": 4.0, "ci95": [None, None]}, 1.0),
    ],
)
def test_what_is_sure_of_a_magnitude_is_that_of_the_end_of_its_interval(entry, share) -> None:
    plain = magnitude("detent_load", {"load": 4.0}, channel_figures(drive(0)))
    assert sure_magnitude("detent_load", {"load": entry}, channel_figures(drive(0))) == pytest.approx(
        max(share * plain, LEAST)
    )


@pytest.mark.parametrize(
    ("interval", "travel"),
    [([0.2e-3, 3.2e-3], 0.8e-3), ([0.2e-3, 0.3e-3], 0.3e-3), (None, 0.3e-3), ([-0.2e-3, 3.2e-3], 0.3e-3)],
)
def test_what_is_told_as_at_least_so_large_is_likely_larger(interval, travel) -> None:
    """Between the ends of its interval by order of magnitude, and never less than the value."""
    figures = {"travel": {"value": 0.3e-3, "ci95": interval}}
    assert likely_magnitude("moving_centre", figures) == pytest.approx(magnitude("moving_centre", {"travel": travel}))


def test_intervals_of_several_figures_take_less_together_than_each_at_its_worst() -> None:
    """A rise of friction that is higher where it is narrower; a stop that begins later is smaller."""
    channel = channel_figures(drive(0))
    rise = {"static_excess": {"value": 4.0, "ci95": [3.0, 5.0]}, "stribeck_speed": {"value": 10.0, "ci95": [6.0, 14.0]}}
    plain = magnitude("stribeck_friction", {"static_excess": 4.0, "stribeck_speed": 10.0}, channel)
    assert sure_magnitude("stribeck_friction", rise, channel) == pytest.approx(plain * (1 - np.hypot(0.25, 0.4)))
    stop = {"from": {"value": 90.0, "unit": "%", "ci95": [88.0, 92.0]}}
    assert sure_magnitude("distal_stop", stop, channel) == pytest.approx(
        magnitude("distal_stop", {"from": 92.0}, channel)
    )


def test_bristles_count_by_what_they_are_longer_than_any_drive_is_granted() -> None:
    states = tuple(replace(s, extra={**s.extra, "granted": np.full(len(s.time_s), 0.9)}) for s in drive(0))
    sizes = [
        magnitude("presliding_friction", {"bristle_length": length}, channel_figures(states))
        for length in (0.9, 1.9, 2.9)
    ]
    assert sizes[0] == LEAST and sizes[2] == pytest.approx(2 * sizes[1])


def test_an_obstacle_that_stiffens_counts_by_the_load_at_the_end_of_the_range() -> None:
    """Stiffness is told over the first 10 % of either form."""
    channel = channel_figures(drive(0))
    even = {"begin": 50.0, "form": 0.0, "stiffness": 0.5}
    bent = {**even, "form": 1.0, "stiffness": 0.1}  # 0.1 * 50^2 / 10 = 0.5 * 50
    assert magnitude("external_contact", bent, channel) == pytest.approx(
        magnitude("external_contact", even, channel), rel=0.05
    )


def test_a_ceiling_counts_by_what_it_would_cut_without_the_other_effects() -> None:
    """A tight spot that pushes the current beyond a ceiling does not make the ceiling lower."""
    states = drive(0)
    declared = {name: float(name == "preload") for name in states[0].declared_names}  # a drive that needs one unit
    channel = channel_figures(states, declared)
    high, low = ({"limit": limit, "share_cut": 0.15} for limit in (1.01, 0.99))
    assert magnitude("current_saturation", high, channel) == LEAST
    assert magnitude("current_saturation", low, channel) == pytest.approx(1.0)
    assert magnitude("current_saturation", high, channel_figures(states)) == pytest.approx(1.0)  # nothing known of it
    stiffer = {**declared, "preload": 3.0}  # of two accounts the one that says least counts
    assert magnitude("current_saturation", high, channel_figures(states, stiffer)) == pytest.approx(1.0)
    assert magnitude("current_saturation", high, channel_figures(states, stiffer, declared)) == LEAST


def test_a_give_counts_by_what_load_and_drag_move_together() -> None:
    channel = Channel(effort=15.0, load=40.0, fastest=100.0)
    plain = magnitude("linkage_compliance", {"form": 1.0, "compliance": 0.01}, channel)
    # of 10 raw at half of the speed
    dragged = {"form": 5.0, "compliance": 0.0001, "drag_compliance": 0.04, "drag": 0.2}
    assert magnitude("linkage_compliance", dragged, channel) == pytest.approx(plain, rel=0.01)


def test_a_weight_that_preload_and_spring_take_up_must_be_larger_to_be_plain() -> None:
    sizes = [
        magnitude("gravity_load", {"largest": 5.0}, Channel(effort=20.0, turned=turned)) for turned in (True, False)
    ]
    assert sizes == pytest.approx([1.0, 1 / 3])


@pytest.mark.parametrize(
    ("before", "after", "fall", "share"),
    [
        (5.0, 3.0, [2.0, 2.0], 1.0),
        (5.0, 3.0, [5.0 - 17.0**0.5, 3.0], 0.5**0.5),  # half of the square for sure
        (5.0, 3.0, [-0.1, 3.0], 0.0),
        (5.0, 5.1, [-0.2, 0.1], 0.0),
        (5.0, 3.0, None, 0.0),
        (5.0, 3.0, [None, None], 0.0),
        (None, None, None, 0.0),
    ],
)
def test_what_recordings_kept_out_say_for_sure_is_by_how_much_their_error_falls_at_least(
    before, after, fall, share
) -> None:
    """Of the mean square, whose root goes with the size."""
    assert sure_share({"before": before, "after": after, "ci95_reduction": fall}) == pytest.approx(share)


def test_friction_by_load_counts_by_the_stiffness_of_the_whole_spring() -> None:
    """Beside a spring that bends, the straight part may be nothing and the ratio to it anything."""
    figures = {
        "load_coefficient": {"value": 5.0, "ci95": [-9.0, 19.0]},
        "per_load": {"value": 0.08, "ci95": [0.06, 0.1]},
    }
    channel = channel_figures(drive(0), stiffness=0.2)
    assert magnitude("load_dependent_friction", values_of(figures), channel) == pytest.approx(1.0)
    assert sure_magnitude("load_dependent_friction", figures, channel) == pytest.approx(0.75)
    assert sure_magnitude("load_dependent_friction", figures, channel_figures(drive(0))) == LEAST


def test_a_springs_stiffness_is_that_of_its_line_through_the_bend() -> None:
    states = drive(0)
    balance = Balance(states)
    position = balance.gather(lambda s: s.position)
    term = Term(effect("nonlinear_spring"), {"form": 0.0, "knee": 50.0})
    bend = {"quadratic_stiffness": 2e-3, "cubic_stiffness": 0.0}
    fit = Fit((term,), {"spring": 0.05}, (bend,), position, 0.0, 0)
    station = SimpleNamespace(naming=SimpleNamespace(balance=balance, fit=fit))
    line = np.polyfit(position, 0.05 * position + 2e-3 * position**2, 1)[0]
    assert _stiffness(station) == pytest.approx(line)


def test_a_stop_that_damps_is_as_large_as_one_that_does_not() -> None:
    plain = {"side": 1.0, "begin": 85.0, "stiffness": 2.0}
    sizes = {magnitude("end_stop_contact", {**plain, **damped}) for damped in ({}, {"form": 1.0, "loss": 0.01})}
    assert len(sizes) == 1
    soft = {"begin": 95.0, "stiffness": 0.05}  # an obstacle's may grow with the square of its depth
    assert magnitude("external_contact", {**soft, "form": 1.0}) < magnitude("external_contact", soft)
