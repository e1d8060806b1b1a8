"""Effects that MuJoCo has elements for: the forces of the written file."""

from __future__ import annotations

import numpy as np
import pytest

from hand_model.effects import effect
from hand_model.effects.base import DriveState

MOTOR = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body><inertial pos="0 0 0" mass="1e-9"
 diaginertia="1e-9 1e-9 1e-9"/><joint name="index_motor" axis="0 0 1" limited="false" damping="0.15" stiffness="0.22"
 springref="-40" armature="0.01" frictionloss="35"/></body></worldbody><custom><numeric name="index_effort_per_raw" data="2.0"/></custom>
 <actuator><general name="index" joint="index_motor" gainprm="0" biastype="none"/></actuator></mujoco>"""
NATIVE = [
    ("quadratic_damping", {}, {"drag": 0.002}, [0.002]),
    ("nonlinear_spring", {}, {"quadratic_stiffness": 1e-3, "cubic_stiffness": 3e-5}, [1e-3, 3e-5]),
    (
        "end_stop_contact",
        {"side": 1.0, "inward": 18.0, "end": 100.0},
        {"side": 1.0, "begin": 82.0, "stiffness": 1.5},
        [1.5],
    ),
    (
        "end_stop_contact",
        {"side": -1.0, "inward": 12.0, "end": 0.0},
        {"side": -1.0, "begin": 12.0, "stiffness": 1.5},
        [1.5],
    ),
    (
        "torque_ripple",
        {"period": 9.0},
        {"amplitude": 5.0, "period": 9.0, "phase": float(np.arctan2(3.0, 4.0))},
        [4.0, 3.0],
    ),
]


@pytest.mark.parametrize(
    ("name", "shape", "parameters", "amplitude"), NATIVE, ids=[f"{n[0]}_{i}" for i, n in enumerate(NATIVE)]
)
def test_native_element_forces_are_the_effects_own(name, shape, parameters, amplitude) -> None:
    """MuJoCo's force at the motor joint changes by minus the effect's load, times the file's effort per raw unit."""
    mujoco = pytest.importorskip("mujoco")
    from lxml import etree

    root = etree.fromstring(MOTOR)
    place = effect(name).write_mjcf(root, {"actuator": "index"}, parameters)
    assert place is not None
    x, v = np.array([0.0, 3.0, 11.0, 50.0, 81.0, 90.0, 99.0]), np.array([0.0, -20.0, 35.0, -80.0, 110.0, 10.0, -5.0])
    state = DriveState(
        "t",
        "index",
        np.arange(7) * 0.02,
        x,
        v,
        0 * x,
        0 * x,
        np.stack([np.sign(v)], -1),
        declared_names=("coulomb",),
        extra={"bandwidth_s": np.zeros(7)},
    )
    load = effect(name).columns(state, shape) @ np.array(amplitude)

    def force(xml: bytes | str) -> np.ndarray:
        model = mujoco.MjModel.from_xml_string(xml if isinstance(xml, str) else xml.decode())
        data, out = mujoco.MjData(model), []
        for position, velocity in zip(x, v, strict=True):
            data.qpos[0], data.qvel[0] = position, velocity
            mujoco.mj_forward(model, data)
            out.append(float(data.qfrc_passive[0] + data.qfrc_actuator[0]))
        return np.array(out)

    np.testing.assert_allclose(force(etree.tostring(root)) - force(MOTOR), -2.0 * load, atol=1e-8)


def test_native_elements_are_not_written_where_there_is_no_motor() -> None:
    from lxml import etree

    for name in ("quadratic_damping", "stribeck_friction", "torque_ripple"):
        root = etree.fromstring(MOTOR)
        before = etree.tostring(root)
        assert effect(name).write_mjcf(root, {"actuator": "thumb"}, {}) is None
        assert etree.tostring(root) == before


@pytest.mark.parametrize(
    ("name", "parameters", "lugre"),
    [
        (
            "stribeck_friction",
            {"static_ratio": 1.8, "stribeck_speed": 18.0, "static_excess": 14.0, "exponent": 2.0},
            [350.0, 0.0, 35.0, 63.0, 18.0],
        ),
        ("presliding_friction", {"bristle_length": 7.0}, [5.0, 0.0, 35.0, 35.0, 20.0]),
        ("presliding_friction", {"bristle_length": 7.0, "bristle_time": 0.04}, [5.0, 0.2, 35.0, 35.0, 20.0]),
    ],
)
def test_lugre_replaces_the_joints_friction(name, parameters, lugre) -> None:
    mujoco = pytest.importorskip("mujoco")
    from lxml import etree

    root = etree.fromstring(MOTOR)
    assert (
        effect(name).write_mjcf(root, {"actuator": "index"}, parameters) == "actuator/dcmotor[@name='index_friction']"
    )
    assert mujoco.MjModel.from_xml_string(etree.tostring(root).decode()).dof_frictionloss[0] == 0
    written = [float(x) for x in root.find("actuator/dcmotor").get("lugre").split()]
    np.testing.assert_allclose(written, lugre, rtol=1e-9)


@pytest.mark.parametrize(("damping", "nearly"), [(0.0, 0.025), (0.05, 0.02), (0.15, 0.014), (0.5, 0.0125)])
def test_a_rise_of_exponent_one_is_written_as_near_as_the_joints_damping_allows(damping, nearly) -> None:
    """Friction and damping of the file against 35 + 28 exp(-v / 18) + damping v (root mean square over the rise, 0.25
    to 9 Stribeck speeds)."""
    from lxml import etree

    root = etree.fromstring(MOTOR.replace('damping="0.15"', f'damping="{damping}"'))
    effect("stribeck_friction").write_mjcf(
        root,
        {"actuator": "index"},
        {"static_ratio": 1.8, "stribeck_speed": 18.0, "static_excess": 14.0, "exponent": 1.0},
    )
    _, _, sliding, static, speed = (float(x) for x in root.find("actuator/dcmotor").get("lugre").split())
    linear, quadratic = ([float(x) for x in root.find(".//joint").get("damping").split()] + [0.0])[:2]
    v = np.linspace(0.25 * 18, 9 * 18, 300)
    written = sliding + (static - sliding) * np.exp(-((v / speed) ** 2)) + linear * v + quadratic * v**2
    assert linear >= 0 and np.sqrt(np.mean((written - (35 + 28 * np.exp(-v / 18) + damping * v)) ** 2)) < nearly * 28
