"""Free swings by their half swings: against what is known in closed form, another integrator, and MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hand_model.rig.swing.fit import Task, fit_together
from hand_model.rig.swing.free import free_errors, swings_free
from hand_model.rig.swing.simulation import INDEX, Lane, Swing, vector

INERTIA, WEIGHT = 0.02, 0.8
SMALL = {"inertia": INERTIA, "damping": 1e-4, "coulomb": 1e-3}
RATE = float(np.sqrt(WEIGHT / INERTIA))


def swing(start: tuple[float, float], seconds: float, leapfrog_s: float = 0.0) -> Swing:
    """One blank recording of 150 samples a second."""
    n = int(150 * seconds)
    lane = Lane("a", False, np.zeros(n), 1.0, np.zeros(n), start, np.zeros(n), np.ones(n))
    return Swing((lane,), WEIGHT, 0.0, SMALL, False, 1 / 150, 2 * np.pi / RATE, leapfrog_s)


def run(some: Swing, law: dict[str, float]) -> np.ndarray:
    """Angles of its first recording under a law (its positions are zero)."""
    assert swings_free(some)
    return free_errors(some, vector({**SMALL, **law})[None], np.array([0]))[:, 0]


def exact(law: dict[str, float], start: tuple[float, float], times: np.ndarray) -> np.ndarray:
    """The same by an adaptive integrator that stops at every reversal."""
    p = {"drag": 0.0, "static_excess": 0.0, "stribeck_speed": 1.0, "lateral": 0.0, "offset": 0.0, **SMALL, **law}

    def slope(_: float, state: np.ndarray, sign: float) -> list[float]:
        q, v = state
        dry = p["coulomb"] + p["static_excess"] * np.exp(-((v / p["stribeck_speed"]) ** 2))
        wet = (p["damping"] + p["drag"] * abs(v)) * v
        return [v, (p["offset"] - WEIGHT * np.sin(q) - p["lateral"] * np.cos(q) - wet - sign * dry) / p["inertia"]]

    def turns(t: float, state: np.ndarray, sign: float) -> float:
        return sign * state[1] if t > begin + 1e-6 else 1.0

    turns.terminal, turns.direction = True, -1
    out, begin, state, sign = np.empty(len(times)), 0.0, list(start), np.sign(start[1]) or -np.sign(start[0])
    while begin < times[-1]:
        some = solve_ivp(slope, (begin, times[-1] + 0.1), state, args=(sign,), events=turns, rtol=1e-10, atol=1e-12,
                         dense_output=True, max_step=0.1)  # fmt: skip
        now = (times >= begin) & (times <= some.t[-1])
        out[now] = some.sol(times[now])[0]
        begin, state, sign = some.t[-1], [some.y[0, -1], 0.0], -sign
    return out


def test_dry_friction_takes_four_of_its_levels_over_the_weight_a_period() -> None:
    """A small swing without damping: amplitudes at its reversals fall by 2 F / k each, until it stands within F / k."""
    level = 4e-5
    q = run(swing((0.01, 0.0), 40.0), {"damping": 0.0, "coulomb": level})
    at = np.arange(0.0, 40.0, np.pi / RATE)
    turned = np.abs(np.interp(at, np.arange(len(q)) / 150, q))
    fall = 2 * level / WEIGHT
    assert np.allclose(turned[:60], 0.01 - fall * np.arange(60), atol=2e-5)
    dead = run(swing((0.01, 0.0), 40.0), {"damping": 0.0, "coulomb": 20 * level})[-300:]
    assert np.ptp(dead) < 1e-12 and abs(dead[0]) <= 20 * level / WEIGHT


@pytest.mark.parametrize(
    "law",
    [{}, {"drag": 2e-4}, {"static_excess": 1.5e-3, "stribeck_speed": 0.8}, {"lateral": 4e-3, "offset": 2e-3}],
)
def test_half_swings_put_together_are_the_motion(law: dict[str, float]) -> None:
    """Twenty seconds from 1.5 rad, begun in the middle of a half swing, within a fiftieth of a milliradian."""
    times = np.arange(3000) / 150
    q = run(swing((1.3, 2.0), 20.0), law)
    assert np.sqrt(np.mean((q - exact(law, (1.3, 2.0), times)) ** 2)) < 5e-5


@pytest.mark.parametrize(("step", "within"), [(1e-3, 2e-4), (1e-5, 1e-4)])
def test_mujoco_moves_so(step: float, within: float) -> None:
    """With damping, dry friction and drag, MuJoCo's leapfrog of a millisecond is stood for by its modified equation; at
    a tiny step it comes to the law itself, within what its soft dry friction leaves."""
    seconds = 8.0 if step > 1e-4 else 2.0
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{step}" integrator="implicitfast"/><worldbody>
        <body><joint name="h" axis="0 -1 0" damping="2e-4 1e-4" frictionloss="1e-3" solreffriction="0.002 1"
        solimpfriction="0.9999 0.9999 0.001 0.5 2"/><inertial pos="0 0 -0.2" mass="{WEIGHT / 9.81 / 0.2}"
        diaginertia="4e-3 {INERTIA - WEIGHT / 9.81 * 0.2} 4e-3"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[0] = 1.2
    mujoco.mj_forward(model, data)
    data.qvel[:] -= 0.5 * step * data.qacc_smooth
    out = []
    for _ in range(int(seconds / step)):
        out.append(float(data.qpos[0]))
        mujoco.mj_step(model, data)
    law = {"damping": 2e-4, "drag": 1e-4}
    q = run(swing((1.2, 0.0), seconds, step if step > 1e-4 else 0.0), law)
    assert np.abs(q - np.interp(np.arange(len(q)) / 150, step * np.arange(len(out)), out)).max() < within


@pytest.mark.slow
def test_a_fit_finds_the_law_whatever_it_starts_from() -> None:
    """Friction that falls with speed, and drag, from a recording of encoder steps, its start unknown; another start,
    or one that differs by a rounding, comes to the same."""
    truth = {"drag": 1e-4, "static_excess": 1e-3, "stribeck_speed": 1.2}
    blank = swing((1.3, 0.4), 40.0)
    step = 1e-4
    noisy = np.round(run(blank, truth) / step) * step
    recorded = replace(blank, lanes=(replace(blank.lanes[0], position=noisy, start=(1.301, 0.38)),))
    free = ("inertia", "damping", "coulomb", "drag", "static_excess", "stribeck_speed")
    start = vector({"inertia": 1.0001 * INERTIA, "damping": 1.5e-4, "coulomb": 1.2e-3, "stribeck_speed": 4.0})
    other = start.copy()
    other[INDEX["stribeck_speed"]] = 0.3
    near = start * (1 + 1e-9 * np.random.default_rng(0).standard_normal(len(start)))
    fits = fit_together(recorded, [Task(free, s, (0,), True) for s in (start, other, near)], 30)
    values = np.array([f.theta for f in fits])
    assert np.sqrt(fits[0].cost) < 1.1 * step / np.sqrt(12)
    assert values[0, INDEX["inertia"]] == pytest.approx(INERTIA, rel=1e-5)
    assert values[0, INDEX["drag"]] == pytest.approx(1e-4, rel=0.1)
    assert np.allclose(values[2], values[0], rtol=1e-4, atol=0.0)
    assert fits[1].cost == pytest.approx(fits[0].cost, rel=1e-3)


def test_what_goes_over_the_top_is_stepped() -> None:
    """A swing beyond what half swings hold, and one that nothing pulls back, are no free swings here."""
    assert not swings_free(swing((3.0, 0.0), 2.0))
    assert not swings_free(replace(swing((1.0, 0.0), 2.0), sine=0.0))
    assert not swings_free(swing((0.0, 2.5 * RATE), 2.0))


@pytest.mark.parametrize("law", [{"stiffness": 0.25}, {"stiffness": -0.1, "offset": 5e-3}])
def test_a_spring_beside_the_weight_takes_part_in_half_swings(law: dict[str, float]) -> None:
    """Small swings have the period of weight and spring together; a wide one is as another integrator has it."""
    pull = WEIGHT + law["stiffness"]
    small = run(swing((0.02 + law.get("offset", 0.0) / pull, 0.0), 20.0), {**law, "coulomb": 0.0})
    rises = np.flatnonzero(np.diff(np.sign(small - np.mean(small))) > 0)
    period = (rises[-1] - rises[0]) / (len(rises) - 1) / 150
    assert period == pytest.approx(2 * np.pi * np.sqrt(INERTIA / pull), rel=1e-3)

    def slope(_: float, state: np.ndarray) -> list[float]:
        q, v = state
        dry = SMALL["coulomb"] * np.tanh(v / 1e-4)
        pulls = law.get("offset", 0.0) - WEIGHT * np.sin(q) - law["stiffness"] * q
        return [v, (pulls - SMALL["damping"] * v - dry) / INERTIA]

    times = np.arange(1500) / 150
    other = solve_ivp(slope, (0, 10.0), [1.3, 2.0], t_eval=times, rtol=1e-9, atol=1e-11, max_step=5e-3).y[0]
    assert np.sqrt(np.mean((run(swing((1.3, 2.0), 10.0), law) - other) ** 2)) < 5e-4
