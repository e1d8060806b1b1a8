"""What is planted in foreign recordings: friction against the motion, gaps that hold back, segments that stay rigid."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from planting.compose import EFFECTS
from planting.plant import Motor, Moving, Seen, smoothed, turned_over
from planting.segments import play, turned
from shown_answers import all_named

MOTOR = Motor(coulomb=35.0, viscous=0.15, stiffness=0.22, preload=9.0, low=12000.0, high=17700.0)
TIME_S = np.linspace(0.0, 20.0, 2001)
PLACE = 50 - 50 * np.cos(2 * np.pi * TIME_S / 4)
MOVING = Moving(TIME_S, PLACE, np.gradient(PLACE, TIME_S), TIME_S + 3.0, 0)
FRICTION = (
    "stribeck_friction",
    "load_dependent_friction",
    "position_dependent_friction",
    "quadratic_damping",
    "asymmetric_viscous_friction",
)


def seen(seed: int = 1) -> Seen:
    """A palm at rest and two segments of three markers each, whose joints turn by up to 1.4 and 1.2 rad."""
    rng = np.random.default_rng(seed)
    angle = (0.014 * PLACE, 0.012 * PLACE)
    axis = np.broadcast_to([0.0, 1.0, 0.0], (len(TIME_S), 3))
    still = np.broadcast_to(np.eye(3), (len(TIME_S), 3, 3))
    first = Rotation.from_rotvec(axis * angle[0][:, None]).as_matrix()
    centre = (np.zeros((len(TIME_S), 3)), first @ np.array([0.03, 0.0, 0.0]))
    spots = rng.uniform(-0.02, 0.02, (9, 3))
    both = Rotation.from_rotvec(axis * (angle[0] + angle[1])[:, None]).as_matrix()
    position = np.concatenate(
        [
            np.broadcast_to(spots[:3], (len(TIME_S), 3, 3)),
            np.einsum("nij,mj->nmi", first, spots[3:6]),
            np.einsum("nij,mj->nmi", both, spots[6:]) + centre[1][:, None],
        ],
        axis=1,
    )
    upper, lower = np.arange(3, 6), np.arange(6, 9)
    labels = tuple("abcdefghi")
    return Seen(
        TIME_S,
        TIME_S,
        position,
        labels,
        (upper, lower),
        np.arange(3),
        angle,
        (axis, axis),
        centre,
        np.array(still),
        first,
        np.zeros(len(TIME_S)),
    )


def apart(position: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Distances (n, 3) [m] of three markers from each other."""
    points = position[:, rows]
    return np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2)


@pytest.mark.parametrize("name", FRICTION)
def test_planted_friction_takes_power_and_grows_with_its_size(name: str) -> None:
    one, half, none = (EFFECTS[name](np.random.default_rng(4), size, MOTOR).load(MOVING) for size in (1.0, 0.5, 0.0))
    assert (one * MOVING.speed > -1e-9).all() and np.abs(one).max() > 1
    assert np.allclose(half, one / 2) and np.allclose(none, 0)


def test_a_gap_holds_back_by_half_of_it_and_a_bristle_yields_within_its_reach() -> None:
    followed = play(PLACE, 2.0)
    rising, falling = ((TIME_S > a) & (TIME_S < a + 0.9) for a in (0.8, 2.8))
    assert np.abs(followed - PLACE).max() <= 2.0 + 1e-12
    assert np.allclose(followed[rising], PLACE[rising] - 2) and np.allclose(followed[falling], PLACE[falling] + 2)
    state = turned_over(PLACE, 3.0)
    assert np.allclose(state[rising], 1) and np.allclose(state[falling], -1) and np.abs(state).max() <= 1


def test_a_spline_leaves_no_more_than_the_noise() -> None:
    values = PLACE + np.random.default_rng(0).normal(0, 0.5, len(PLACE))
    course = smoothed(TIME_S, values, 0.5)
    assert np.std(values - course(TIME_S)) <= 0.5 and np.std(course(TIME_S) - PLACE) < 0.2


def test_turned_segments_stay_rigid_and_turn_by_as_much() -> None:
    given = seen()
    more = 0.1 * np.sin(TIME_S)
    other = turned(given, more, 2 * more)
    for rows in given.segments:
        assert np.allclose(apart(other, rows), apart(given.position, rows))
    assert np.array_equal(other[:, given.palm], given.position[:, given.palm])
    assert np.allclose(turned(given, 0 * more, 0 * more), given.position)
    wanted = turned(given, more, 0 * more)[:, given.segments[0]]
    turn = Rotation.from_rotvec(np.array([0.0, 1.0, 0.0]) * more[:, None]).as_matrix()
    assert np.allclose(wanted, np.einsum("nij,nmj->nmi", turn, given.position[:, given.segments[0]]))


@pytest.mark.parametrize("name", [n for n in EFFECTS if EFFECTS[n](np.random.default_rng(2), 1.0, MOTOR).markers])
def test_what_is_planted_in_markers_moves_some_and_leaves_their_number(name: str) -> None:
    given = seen()
    moved = EFFECTS[name](np.random.default_rng(2), 1.0, MOTOR).markers(given)
    far = np.linalg.norm(moved - given.position, axis=2)
    assert moved.shape == given.position.shape and 1e-4 < far.max() < 0.05
    assert (far.max(0) < 1e-12).any()  # of one finger's parts or the palm's some stay


def test_every_effect_changes_log_or_markers() -> None:
    for name, plant in EFFECTS.items():
        drawn = plant(np.random.default_rng(1), 1.0, MOTOR)
        assert drawn.load or drawn.columns or drawn.markers, name
        assert drawn.figures


def test_all_that_is_hidden_must_be_named_and_nothing_else() -> None:
    one, two = ("marker_slip", "index"), ("clock_drift", "ring")
    assert all_named([two, one], [one, two]) and all_named([one, ("clock_drift", None)], [one, two])
    assert all_named([], [])
    assert not all_named([one, one], [one, two]) and not all_named([one], [one, two])
    assert not all_named([("marker_slip", "ring"), two], [one, two]) and not all_named([one, two], [one])
