"""Balances of two joints of a finger, whose markers err alike, heard beside each other's errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_kinematic_stations import joint

from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.station import Station
from hand_model.diagnose.unrelated import Regression, _of_markers, left_of_seen, less_foretold, together
from hand_model.effects import catalogue
from hand_model.effects.base import DriveState

ALIKE = -0.8  # correlation of what the markers say wrongly of the two angles
NOISE = 0.4  # deg
SLOPE = 0.7  # of the second angle over the first
FULL = 80.0  # deg of the first angle
States = tuple[DriveState, ...]


def ripple(amplitude_deg: float):
    return lambda t, x, v: amplitude_deg * np.sin(2 * np.pi * x / 23.0)


def follower(driver: DriveState, add=None) -> DriveState:
    """Recording of an angle that follows another one (its noise-free course), and what is added to it."""
    first, rate = driver.effort, np.gradient(driver.effort, driver.time_s)
    angle = SLOPE * first + (0.0 if add is None else add(driver.time_s, driver.position, driver.velocity))
    declared = np.stack([(first / FULL) ** k for k in range(5)], axis=-1)
    extra = {**driver.extra, "scale": np.full(len(first), FULL), "slope": np.full(len(first), SLOPE)}
    names = tuple(f"power_{k}" for k in range(5))
    return replace(
        driver, position=first, velocity=rate, acceleration=0 * rate, effort=angle, declared=declared, position_unit="deg",
        extra=extra, declared_names=names,
    )  # fmt: skip


def two_joints(seed: int, first=None, second=None, alike: float = ALIKE) -> tuple[States, States]:
    """Recordings of an angle behind its encoder and of the next one behind it, with the noise of markers, which they have
    alike. first, second: (t, x, v) on either; what is on the first moves the second, too."""
    rng = np.random.default_rng(seed)
    drivers = joint(seed, add=first, noise=0.0)
    out = ([], [])
    for driver in drivers:
        errors = rng.multivariate_normal([0, 0], NOISE**2 * np.array([[1, alike], [alike, 1]]), len(driver.time_s))
        for k, state in enumerate((driver, follower(driver, second))):
            out[k].append(replace(state, effort=state.effort + errors[:, k]))
    return tuple(out[0]), tuple(out[1])


def heard(states: States, kind: str) -> Regression:
    signal = "encoder" if kind == "encoder" else "markers"

    def judge(told: States) -> Station:
        return judged(signal, "index", "index", "proximal", told, catalogue(kind))

    return Regression(judge(states), states, judge)


def both(first: States, second: States) -> tuple[Regression, Regression, tuple[Station, Station]]:
    driver, follows = heard(first, "encoder"), heard(second, "linkage")
    return driver, follows, together(driver, follows, lambda _: second)


def names(station: Station) -> list[str]:
    return [f.term.effect.name for f in station.naming.found]


def test_what_one_angle_errs_by_is_taken_off_the_other_and_nothing_else() -> None:
    states, others = two_joints(1, first=ripple(0.05))
    driver, follows = heard(states, "encoder"), heard(others, "linkage")
    less = less_foretold(states, driver.left, left_of_seen(follows, driver))
    clean = joint(1, add=ripple(0.05), noise=0.0)
    left = np.concatenate([a.effort - b.effort for a, b in zip(less, clean, strict=True)])
    # of errors a and b, b - SLOPE a is seen, whatever moves both
    seen = np.array([-SLOPE, 1.0]) @ np.array([[1, ALIKE], [ALIKE, 1]])
    foretold = seen[0] ** 2 / (seen @ np.array([-SLOPE, 1.0]))
    assert np.std(left) == pytest.approx(NOISE * np.sqrt(1 - foretold), rel=0.05)
    x = np.concatenate([s.position for s in clean])
    assert abs(np.polyfit(ripple(1.0)(0, x, 0), left, 1)[0]) < 0.01  # the ripple is as it was


def test_an_effect_that_the_noise_of_one_angle_hides_is_named() -> None:
    driver, _, (own, other) = both(*two_joints(2, first=ripple(0.03)))
    assert names(driver.station) == [] and names(own) == ["encoder_periodic_error"] and names(other) == []


def test_what_the_other_angle_lacks_is_not_named_here() -> None:
    states, others = two_joints(2, second=ripple(0.06))  # no linkage has such a law: it is found at neither
    driver, follows, stations = both(states, others)
    mirrored = driver.judge(less_foretold(states, driver.left, left_of_seen(follows, driver)))
    assert names(mirrored) == ["encoder_periodic_error"] and names(stations[0]) == []


def test_healthy_joints_stay_consistent() -> None:
    assert [names(s) for s in both(*two_joints(3))[2]] == [[], []]


def test_a_follower_that_tells_nothing_of_its_driver_leaves_it_as_it_is() -> None:
    driver, follows, stations = both(*two_joints(4, alike=SLOPE))  # what is seen of both is then none of the first's
    assert less_foretold(driver.states, driver.left, left_of_seen(follows, driver)) is None
    assert stations[0] is driver.station


def test_what_the_log_s_clock_does_is_none_of_the_markers_errors() -> None:
    def recorded(noise: float, drift: float = 0.003) -> States:
        told = joint(2, noise=noise, drift=drift)
        return tuple(replace(s, acceleration=np.gradient(s.velocity, s.time_s)) for s in told)

    driver, clean = heard(recorded(NOISE), "encoder"), {s.trial: s for s in recorded(0.0)}
    assert names(driver.station) == ["clock_drift"]
    errors = {s.trial: s.effort - clean[s.trial].effort for s in driver.states}

    def beyond(left) -> float:
        rest = [v - errors[k][np.searchsorted(clean[k].time_s, t)] for k, (t, v) in left.items()]
        return float(np.std(np.concatenate(rest)))

    assert beyond(_of_markers(driver)) < 0.9 * beyond(driver.left)
    healthy = heard(recorded(NOISE, drift=0.0), "encoder")
    assert all(np.array_equal(v, healthy.left[k][1]) for k, (_, v) in _of_markers(healthy).items())
