"""Balances of two joints of a finger, whose markers err alike, heard beside each other's errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_kinematic_stations import joint

from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.station import Station
from hand_model.diagnose.unrelated import Heard, left_of, less_foretold, together
from hand_model.effects import catalogue
from hand_model.effects.base import DriveState

ALIKE = -0.8  # correlation of what the markers say wrongly of the two angles
NOISE = 0.4  # deg
States = tuple[DriveState, ...]


def ripple(amplitude_deg: float):
    return lambda t, x, v: amplitude_deg * np.sin(2 * np.pi * x / 23.0)


def two_joints(seed: int, first=None, second=None) -> tuple[States, States]:
    """Recordings of an angle behind its encoder and of the next one behind it, without noise but that of markers, which
    they have alike. first, second: (t, x, v) on either."""
    rng = np.random.default_rng(seed)
    made = [joint(seed, add=add, noise=0.0) for add in (first, second)]
    out = ([], [])
    for pair in zip(*made, strict=True):
        errors = rng.multivariate_normal([0, 0], NOISE**2 * np.array([[1, ALIKE], [ALIKE, 1]]), len(pair[0].time_s))
        for k, state in enumerate(pair):
            out[k].append(replace(state, effort=state.effort + errors[:, k]))
    return tuple(out[0]), tuple(out[1])


def heard(states: States, kind: str) -> Heard:
    signal = "encoder" if kind == "encoder" else "markers"

    def judge(told: States) -> Station:
        return judged(signal, "index", "index", "proximal", told, catalogue(kind))

    return Heard(judge(states), states, judge)


def names(station: Station) -> list[str]:
    return [f.term.effect.name for f in station.naming.found]


def test_what_one_angle_errs_by_is_taken_off_the_other_and_nothing_else() -> None:
    states, others = two_joints(1, first=ripple(0.05))
    plain, beside = heard(states, "encoder"), heard(others, "linkage")
    less = less_foretold(states, plain.left, beside.left)
    quieter = [
        np.nanstd(a.effort - b.effort + c) / np.nanstd(c)
        for a, b, c in zip(
            less, states, (left_of(states, plain.station.naming)[s.trial][1] for s in states), strict=True
        )
    ]
    assert quieter == pytest.approx([np.sqrt(1 - ALIKE**2)] * 2, rel=0.05)


def test_an_effect_that_the_noise_of_one_angle_hides_is_named() -> None:
    states, others = two_joints(2, first=ripple(0.035))
    plain, beside = heard(states, "encoder"), heard(others, "linkage")
    own, other = together(plain, beside)
    assert names(plain.station) == [] and names(own) == ["encoder_periodic_error"] and names(other) == []


def test_what_the_other_angle_lacks_is_not_named_here() -> None:
    states, others = two_joints(2, second=ripple(0.06))  # no linkage has such a law: it is found at neither
    plain, beside = heard(states, "encoder"), heard(others, "linkage")
    mirrored = plain.judge(less_foretold(states, plain.left, beside.left))
    assert names(mirrored) == ["encoder_periodic_error"] and names(together(plain, beside)[0]) == []


def test_healthy_joints_stay_consistent() -> None:
    states, others = two_joints(3)
    assert [names(s) for s in together(heard(states, "encoder"), heard(others, "linkage"))] == [[], []]


def test_angles_that_err_apart_are_left_as_they_are() -> None:
    states, others = joint(4, noise=NOISE), joint(5, noise=NOISE)
    plain, beside = heard(states, "encoder"), heard(others, "linkage")
    assert less_foretold(states, plain.left, beside.left) is None
    assert together(plain, beside) == (plain.station, beside.station)
