"""The time steps of simulated moves, derivatives along narrow valleys, and the state that one move leaves to the
next."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from hand_model.identify.motor import output_error
from hand_model.identify.motor.batch import Moves
from hand_model.identify.motor.creep import begins, continued, creeping, end_state
from hand_model.identify.motor.drive import run
from hand_model.identify.motor.friction import Bristles
from hand_model.identify.motor.grid import NEVER, grid, rows
from hand_model.identify.motor.jacobian import linearise
from hand_model.identify.motor.moves import MoveData
from hand_model.identify.motor.parameters import BOUNDS
from hand_model.identify.motor.residuals import simulate_moves
from hand_model.identify.motor.stribeck import hardened

VALUES = {
    "inertia": 0.0125,
    "viscous": 0.145,
    "coulomb": 34.0,
    "stiffness": 0.23,
    "preload": 9.0,
    "presliding": 0.0,
    "bristle": 0.0,
    "static_ratio": 1.0,
    "stribeck_speed": 20.0,
    "stribeck_exponent": 1.0,
    "speed_full": 115.0,
    "rise": 0.08,
    "fall": 0.1,
    "gain": 12.0,
    "damping": 2.5,
    "delay": 5e-4,
    "lead": 5e-4,
    "lag": 0.0,
    "edge": 0.05,
    "position_gain": 14.0,
    "deadband": 1.0,
}


def _move(
    origin: float,
    target: float,
    speed: float,
    duration_s: float,
    values: dict,
    controller: str,
    index: int = 0,
    hold: float = 0.0,
) -> MoveData:
    """A move as its own simulation, sampled every 15 ms."""
    t = np.arange(1, int(duration_s / 0.015)) * 0.015
    blank = MoveData(
        "t",
        index,
        t,
        0 * t,
        0 * t,
        origin,
        target,
        np.inf,
        np.array([0.006, origin, speed, hold]),
        np.array([5e-3, 0.02, 1e-3, 1.0]),
    )
    y = simulate_moves([blank], values, blank.own[None], controller, 5e-4)[0]
    return dataclasses.replace(blank, position=y[:, 0], current=y[:, 1])


def test_grid_counts_its_own_steps() -> None:
    """Rows and times are each other's inverse; the stretches are as long as asked for, and in whole steps."""
    calm = np.array([[0.2, 0.3, NEVER], [0.9, NEVER, NEVER], [1.4, NEVER, NEVER]])
    duration, step = np.array([2.0, 2.0, 2.0]), 2e-3
    ends, n = rows(calm, duration, step)
    found = grid(ends, int(n.max()), step)
    i = np.arange(int(n.max()))
    for c in range(3):
        assert np.allclose(found.index(found.at_s[:, [c]], np.array([c]))[:, 0], i)
        assert found.at_s[n[c] - 1, c] >= duration[c]
        within = found.steps()[:, c][
            (found.at_s[:, c] > calm[0, c] + 0.02) & (found.at_s[:, c] < min(calm[1, c], 2.0) - 0.02)
        ]
        assert np.allclose(within, 4 * step) if c < 2 else len(within) == 0
    assert n[2] == 1002 and n[1] < n[0] < 700


@pytest.mark.parametrize("controller", ["cascade", "profile"])
def test_long_steps_change_nothing_that_matters(controller: str) -> None:
    """Half of an encoder's noise and a tenth of a current's at most (0.05 %, 5 raw), most of it where the drive creeps
    after its stop."""
    moves = [_move(0.0, 100.0, s, 2.5, VALUES, controller) for s in (1.0, 0.45, 0.2)]
    own = np.array([m.own for m in moves])
    short, long = (np.concatenate(simulate_moves(moves, VALUES, own, controller, calm=c)) for c in (False, True))
    assert np.all(np.abs(long - short).max(axis=0) < [0.025, 0.5])


@pytest.mark.parametrize("controller", ["cascade", "profile"])
def test_full_speed_and_the_moves_own_make_up_for_each_other(controller: str) -> None:
    """More full speed, less of every share, as much more time to reach it: nothing moves, so the Jacobian has to say
    so."""
    moves = [_move(0.0, 100.0, s, 1.5, VALUES, controller) for s in (1.0, 0.45)]
    own, names = np.array([m.own for m in moves]), ("speed_full", "rise", "fall")[: 3 if controller == "profile" else 2]
    _, shared, local, _ = linearise(moves, VALUES, names, own, (0.05, 5.0), controller, 2e-3)
    for a, b, x in zip(shared, local, own, strict=True):
        times = sum(VALUES[n] * a[:, i] for i, n in enumerate(names) if n != "speed_full")
        left = VALUES["speed_full"] * a[:, 0] + times - x[2] * b[:, 2]
        assert np.abs(left).max() < 1e-6 * np.abs(x[2] * b[:, 2]).max()


def test_a_cascade_creeps_on_into_the_next_move() -> None:
    """The velocity that a move leaves is that of the same drive left alone for longer."""
    first = _move(0.0, 100.0, 1.0, 1.4, VALUES, "cascade")
    on = _move(0.0, 100.0, 1.0, 1.7, VALUES, "cascade")
    later = np.polyfit(on.time_s[-18:], on.position[-18:], 1)[0]
    second = _move(100.0, 0.0, 1.0, 1.4, VALUES, "cascade", 1 + len(first.time_s), float(first.current[-1]))
    moves = [first, second]
    states = begins(moves, VALUES, np.array([m.own for m in moves]), "cascade")
    assert states[0] is None and abs(later) > 0.1
    assert states[1][2] == pytest.approx(later, rel=0.1)
    assert states[1][0] == pytest.approx(first.position[-1], abs=0.01)
    assert creeping(moves, states)[1].velocity == states[1][2] and creeping(moves, states)[0] is first
    assert (
        continued(moves, states)[1].own[1] == states[1][0] and continued(moves, states)[1].own_sd[1] < second.own_sd[1]
    )
    # seen to move otherwise, or not the next move
    assert (
        begins(
            [first, dataclasses.replace(second, seen=(states[1][2] + 1.0, 0.1))],
            VALUES,
            np.array([m.own for m in moves]),
            "cascade",
        )[1]
        is None
    )
    assert (
        begins([first, dataclasses.replace(second, trial="u")], VALUES, np.array([m.own for m in moves]), "cascade")[1]
        is None
    )
    assert begins(moves, VALUES, np.array([m.own for m in moves]), "profile") == [None, None]


def test_state_at_the_end_of_a_move() -> None:
    t = np.arange(10) * 0.01
    assert end_state(t, np.c_[50 + 2 * t, 3 * np.ones(10)]) == (pytest.approx(50.18), 3.0, pytest.approx(2.0))
    assert end_state(t, np.c_[50 + 0 * t, 3 * np.ones(10)])[2] == 0.0


@pytest.mark.parametrize("controller", ["cascade", "profile"])
def test_neighbours_that_share_their_steps_move_as_they_do_alone(controller: str) -> None:
    """Two moves, three sets of parameters each, at once: each as it is by itself."""
    each = {n: np.full(6, v) for n, v in VALUES.items()} | {"coulomb": np.array([34.0, 30.0, 38.0] * 2)}
    zero, one = np.zeros(6), np.ones(6)
    target, end_s = np.repeat([90.0, 60.0], 3), np.repeat([1.6, 1.2], 3)
    moves = Moves(
        0.006 * one, zero, target, one, np.inf * one, zero, zero, end_s, zero, 0.3 * one, 0.5 * one, 1.1 * one
    )
    times = [np.arange(1, 70) * 0.015] * 2
    together = run(moves, each, 2e-3, controller, 3).sample(times, 3)
    for k in range(6):
        alone = run(moves.some(np.array([k])), {n: v[k : k + 1] for n, v in each.items()}, 2e-3, controller).sample(
            times[:1]
        )
        of_move = slice(69 * (k // 3), 69 * (k // 3 + 1))
        assert all(np.allclose(x[of_move, k % 3], y[:, 0], atol=1e-9) for x, y in zip(together, alone, strict=True))


def test_bristles_are_as_stiff_whatever_friction_does_later() -> None:
    """LuGre: at first friction grows by Coulomb's over the distance, however much it rises as speed falls."""
    q = {n: np.full(2, VALUES[n]) for n in ("coulomb", "stribeck_speed", "stribeck_exponent", "bristle")} | {
        "presliding": np.full(2, 0.5),
        "static_ratio": np.array([1.0, 1.8]),
    }
    friction, step_s, v, fresh = Bristles(q), np.full(2, 1e-3), np.full(2, 0.1), np.empty(2)
    friction.begin(np.zeros(2), np.zeros(2))
    friction.pace(0, 1, step_s)
    friction.velocities(np.full(2, 10.0), np.full(2, 20.0), v)
    friction.advance(v, 2 * v, fresh)
    assert np.allclose(friction.f, VALUES["coulomb"] / 0.5 * 1e-4, rtol=1e-3)


def test_a_hard_drive_with_a_rise_is_not_left_on_bristles() -> None:
    """Bristles shorter than the encoder's noise give way to friction that sticks, where that explains the moves as
    well."""
    values = {**VALUES, "static_ratio": 1.6, "rise": 0.0, "fall": 0.0}
    moves = [
        _move(a, b, s, 1.2, values, "profile", hold=VALUES["preload"] + VALUES["stiffness"] * a)
        for a, b, s in ((0.0, 60.0, 1.0), (60.0, 0.0, 0.6), (0.0, 30.0, 0.3), (30.0, 80.0, 0.6))
    ]
    rng = np.random.default_rng(2)
    moves = [
        dataclasses.replace(
            m,
            position=m.position + 0.05 * rng.normal(size=len(m.time_s)),
            current=m.current + 5 * rng.normal(size=len(m.time_s)),
        )
        for m in moves
    ]
    names = ("coulomb", "viscous", "presliding", "bristle", "static_ratio")
    soft = output_error.fit(
        moves,
        {**values, "presliding": 0.021, "bristle": 0.004},
        names,
        (0.05, 5.0),
        BOUNDS,
        "profile",
        (output_error.NEARLY,),
    )
    hard = hardened(soft)
    assert hard is not None and hard.values["presliding"] == 0.0 and "bristle" not in hard.names
    assert hardened(hard) is None
