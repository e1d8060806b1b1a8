"""The balance of a rig: inverse dynamics as columns, the bounded solution, bodies that can exist."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_pendulum import LEVER, MASS, planted

from hand_model.rig import fit_declared, load_rig
from hand_model.rig.balance import Column
from hand_model.rig.consistent import BASIS, _Barrier, consistent, is_physical, pseudo_inertia
from hand_model.rig.dynamics import INERTIAL, inertial_columns, inertial_parameters
from hand_model.rig.physical import physical
from hand_model.rig.solve import Nested, solve_bounded
from hand_model.session import read_session

TREE = """<mujoco><compiler angle="radian"/><option gravity="0.3 -1 -9.81"/><worldbody>
  <body name="a" pos="0.1 0 0.2" quat="0.9 0.1 0.3 0.2"><joint name="a" axis="0.3 1 0.2" pos="0.02 0.01 -0.03"/>
   <inertial pos="0.1 0.05 -0.2" mass="1.3" fullinertia="0.02 0.03 0.025 0.001 0.002 -0.003"/>
   <body name="b" pos="0 0.1 -0.3"><joint name="b" type="slide" axis="1 0.2 0"/>
    <inertial pos="0.02 0 0.1" mass="0.7" diaginertia="0.01 0.012 0.008"/>
    <body name="c" pos="0.1 0 0"><joint name="c" axis="0 0 1" pos="0 0.05 0"/>
     <inertial pos="0 0.1 0" mass="0.4" diaginertia="0.002 0.001 0.002"/></body></body></body></worldbody></mujoco>"""


def test_regressor_is_mujocos_inverse_dynamics() -> None:
    """Hinges with offset anchors, a slide, turned frames, tilted gravity: columns x parameters = mj_inverse."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(TREE)
    data = mujoco.MjData(model)
    q, v, a = np.random.default_rng(1).normal(size=(3, 6, model.nv))
    effort = np.einsum(
        "njbp,bp->nj", inertial_columns(model, q, v, a, np.array(model.opt.gravity)), inertial_parameters(model)
    )
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[i], v[i], a[i]
        mujoco.mj_inverse(model, data)
        assert np.allclose(effort[i], data.qfrc_inverse, atol=1e-12)


def test_bounded_solution_meets_the_optimality_conditions() -> None:
    """Inside the box the gradient vanishes; on a bound it points outwards."""
    random = np.random.default_rng(0)
    for _ in range(20):
        x, y = random.normal(size=(40, 6)), random.normal(size=40) * 3
        low, high = np.array([0, 0, -np.inf, 0, -1, 0.0]), np.full(6, np.inf)
        theta = solve_bounded(x.T @ x, x.T @ y, low, high, np.zeros(6), np.zeros(6))
        slope = x.T @ (x @ theta - y)
        assert np.all(theta >= low - 1e-12)
        free = theta > low + 1e-9
        assert np.all(np.abs(slope[free]) < 1e-6 * np.abs(x.T @ y).max())
        assert np.all(slope[~free] > -1e-6)


def test_columns_beside_others_get_the_bounded_solution_of_all() -> None:
    """Nested in what stands, one or two columns more give what all give at once, whichever bounds they move, be they new
    or all but known already."""
    random, quick = np.random.default_rng(0), 0
    for k in range(200):
        x, y, many = random.normal(size=(40, 8)), random.normal(size=40) * 3, 1 + k % 2
        x[:, 6] += random.choice([0.0, 3.0, 1e7]) * x[:, 0]
        low = np.where(random.random(8) < 0.5, 0.0, -np.inf)
        few, more = x[:, : 8 - many], x[:, 8 - many :]
        box = low, np.full(8, np.inf), np.r_[random.normal(size=8 - many), np.zeros(many)], np.full(8, 1e-3)
        nested = Nested(few.T @ few, few.T @ y, *(b[: 8 - many] for b in box))
        sums = few.T @ more, more.T @ more, more.T @ y
        theta = nested.solve(*sums, *(box[i][8 - many :] for i in (0, 1, 3)))
        everything = solve_bounded(x.T @ x, x.T @ y, *box)

        def cost(at: np.ndarray, x: np.ndarray = x, y: np.ndarray = y, box: tuple = box) -> float:
            return float(np.sum((y - x @ at) ** 2) + np.sum(box[3] * (at - box[2]) ** 2))

        assert np.all(theta >= low - 1e-12) and cost(theta) == pytest.approx(cost(everything), rel=1e-9)
        quick += (
            nested._quick(sums[0], sums[1] + 1e-3 * np.eye(many), sums[2], *(b[8 - many :] for b in box[:2]))
            is not None
        )
    assert 60 < quick < 200  # both ways were gone


def test_slopes_of_the_barrier_are_those_of_its_value() -> None:
    """Gradient and Hessian by finite differences, of two bodies of which one has parameters that stay as declared, and
    an edge."""
    body = np.array([1.2, 0.1, -0.2, 0.3, 0.9, 1.0, 1.1, 0.05, -0.04, 0.03])
    own = np.array([[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], [11, -1, 12, -1, 13, 14, 15, -1, -1, -1]])
    x = np.zeros(16)
    for places in own:
        x[places[places >= 0]] = body[places >= 0]
    x[10], unit = 0.7, np.linspace(0.5, 2.0, 16)
    barrier = _Barrier(own, np.array([body, body]), unit, np.array([10]), np.array([1.0]), np.array([0.2]))
    x, step = x / unit, 1e-5
    slope, bend = barrier.slopes(x)
    for i, e in enumerate(step * np.eye(16)):
        assert slope[i] == pytest.approx((barrier.value(x + e) - barrier.value(x - e)) / (2 * step), rel=1e-5, abs=1e-6)
        turned = (barrier.slopes(x + e)[0] - barrier.slopes(x - e)[0]) / (2 * step)
        np.testing.assert_allclose(bend[i], turned, rtol=1e-5, atol=1e-5 * np.abs(bend).max())


def test_physical_keeps_what_is_physical_and_mends_what_is_not() -> None:
    """A true body comes back as it is; an impossible inertia becomes one with positive, triangular principal
    moments."""
    mass, centre, inertia = 2.0, np.array([0.1, -0.2, 0.3]), np.diag([0.3, 0.4, 0.5])
    about = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    p = np.array([mass, *(mass * centre), about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2]])
    back = physical(p)
    assert back[0] == mass and np.allclose(back[1], centre) and np.allclose(back[2], inertia)
    p[4] -= 1.0
    level = np.linalg.eigvalsh(physical(p)[2])
    assert level[0] > 0 and level[2] <= level[0] + level[1] + 1e-9


def test_declared_fit_finds_the_true_weight_and_friction(tmp_path: Path) -> None:
    """Mass moment, damping and Coulomb friction of a planted pendulum within two per cent."""
    fit = fit_declared(load_rig(read_session(planted(tmp_path / "s"))))
    value = {c.label: t for c, t in zip(fit.columns, fit.theta, strict=True)}
    assert value["inertial:arm:hz"] == pytest.approx(-MASS * LEVER, rel=0.02)
    assert value["frictionloss:hinge"] == pytest.approx(0.08, rel=0.05)
    assert value["damping:hinge"] == pytest.approx(0.03, rel=0.1)


def test_bodies_of_a_solution_can_exist() -> None:
    """Where least squares asks for a negative moment of inertia, the constrained solution has none, and fits no worse
    than any physical body drawn at random; a solution that is physical already comes back untouched."""
    declared = np.array([1.0, 0, 0, -0.3, 0.15, 0.15, 0.02, 0, 0, 0])
    free = [i for i, v in enumerate(declared) if v]
    columns = tuple(Column("inertial", "arm", INERTIAL[i], declared[i]) for i in free)
    random = np.random.default_rng(4)
    x = random.normal(size=(60, len(free)))
    box = np.full(len(free), -np.inf), np.full(len(free), np.inf), np.zeros(len(free)), np.full(len(free), 1e-9)
    for wrong, physical_ in ((0.0, True), (0.3, False)):
        wanted = declared[free] - wrong * np.eye(len(free))[2]
        theta = consistent(columns, declared[None], wanted, x.T @ x, x.T @ (x @ wanted), *box)
        full = declared.copy()
        full[free] = theta
        assert is_physical(full)
        if physical_:
            assert np.array_equal(theta, wanted)
            continue
        cost = np.sum((x @ (theta - wanted)) ** 2)
        for _ in range(200):
            other = full.copy()
            other[free] = theta * (1 + 0.05 * random.normal(size=len(free)))
            if is_physical(other):
                assert np.sum((x @ (other[free] - wanted)) ** 2) >= cost * (1 - 1e-6)


def test_pseudo_inertia_is_linear_in_the_parameters() -> None:
    """The sum of its basis, and symmetric."""
    p = np.random.default_rng(0).normal(size=10)
    assert np.allclose(np.einsum("k,kij->ij", p, BASIS), pseudo_inertia(p))
    assert np.allclose(pseudo_inertia(p), pseudo_inertia(p).T)
