"""Compiled motors: what the recordings gave is what MuJoCo obeys; the drive pushes and yields."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from hand_model.compile.motor import complete_keyframes, write_motors
from hand_model.hand import EncoderMap, Estimate, Finger, Hand, Joint, Motor

mujoco = pytest.importorskip("mujoco")
etree = pytest.importorskip("lxml.etree")

VALUES = {
    "inertia": 0.0125,
    "viscous": 0.15,
    "coulomb": 34.0,
    "stiffness": 0.23,
    "preload": 9.0,
    "gain": 22.0,
    "damping": 3.0,
}
XML = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body name="palm"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body name="index_proximal_link"><inertial pos="0.02 0 0" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>
<joint name="index_proximal" type="hinge" axis="0 1 0" armature="1e-4" damping="1e-3"/>
<body name="index_distal_link" pos="0.04 0 0"><inertial pos="0.01 0 0" mass="0.005" diaginertia="1e-6 1e-6 1e-6"/>
<joint name="index_distal" type="hinge" axis="0 1 0"/></body></body></body></worldbody>
<equality><joint name="index_linkage" joint1="index_distal" joint2="index_proximal" polycoef="0 0.9 0 0 0" solref="0.002 1"
 solimp="0.9999 0.9999 0.001 0.5 2"/></equality>
<actuator><position name="index" joint="index_proximal" kp="1"/></actuator>
<keyframe><key name="close" qpos="0 0 1.2 1.08"/></keyframe></mujoco>"""


def _hand(**more: float) -> Hand:
    values = {**VALUES, **more}
    joint = Joint("proximal", np.array([0, 1.0, 0]), np.zeros(3), np.zeros((6, 6)), (0.0, 1.35), {})
    encoder = EncoderMap(12000.0, 18000.0, np.array([0.0, 1.2, 0.25, -0.1]), {}, {})
    finger = Finger("index", "index", (joint, dataclasses.replace(joint, name="distal")), (encoder,))
    motor = Motor("index", 12100.0, 17900.0, {n: Estimate(v, None, "", "") for n, v in values.items()}, 5.0, ())
    return Hand("test", "left", {}, {}, (finger,), 1e-4, {}, (motor,))


def _model(hand: Hand, scale: float | None = None) -> tuple[mujoco.MjModel, mujoco.MjData]:
    root = etree.fromstring(XML)
    for key in root.findall("keyframe"):
        root.remove(key)
    notes = write_motors(root, hand, scale)
    assert any("nominal" in n for n in notes)
    model = mujoco.MjModel.from_xml_string(etree.tostring(root).decode())
    return model, mujoco.MjData(model)


def _q(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> float:
    return float(data.joint(name).qpos[0])


@pytest.mark.parametrize("scale", [None, 0.002])
def test_motor_accelerates_as_identified(scale: float | None) -> None:
    """(u - b v - Fc - k p - tau0) / m at a known state, frictionloss saturated while sliding."""
    model, data = _model(_hand(), scale)
    unit = model.numeric("index_effort_per_raw").data[0]
    percent, speed, current = 40.0, 50.0, 90.0
    encoder = np.polynomial.Polynomial([0.0, 1.2, 0.25, -0.1])
    u = (12100 + 58 * percent - 12000) / 6000
    slope = encoder.deriv()(u) * 58 / 6000
    for name, value, rate in (
        ("index_motor", percent, speed),
        ("index_drive", encoder(u), slope * speed),
        ("index_proximal", encoder(u), slope * speed),
    ):
        data.joint(name).qpos[0], data.joint(name).qvel[0] = value, rate
    data.joint("index_distal").qpos[0], data.joint("index_distal").qvel[0] = 0.9 * encoder(u), 0.9 * slope * speed
    data.ctrl[model.actuator("index").id] = percent + (current + 3.0 * speed) / 22.0
    mujoco.mj_forward(model, data)
    assert data.actuator("index").force[0] == pytest.approx(unit * current, rel=1e-9)
    wanted = (current - 0.15 * speed - 34.0 - 0.23 * percent - 9.0) / 0.0125
    assert data.joint("index_motor").qacc[0] == pytest.approx(wanted, rel=2e-2 if scale is None else 0.2)


def test_finger_follows_the_encoder_map_and_holds() -> None:
    model, data = _model(_hand())
    data.ctrl[model.actuator("index").id] = 60.0
    for _ in range(1500):
        mujoco.mj_step(model, data)
    percent = _q(model, data, "index_motor")
    assert 55 < percent < 60  # friction and spring hold it short of the setpoint
    u = (12100 + 58 * percent - 12000) / 6000
    assert _q(model, data, "index_proximal") == pytest.approx(
        np.polynomial.polynomial.polyval(u, [0.0, 1.2, 0.25, -0.1]), abs=2e-3
    )
    still = percent
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert _q(model, data, "index_motor") == pytest.approx(still, abs=0.02)  # friction sticks: no creep


def test_finger_yields_to_a_push_and_returns() -> None:
    model, data = _model(_hand())
    data.ctrl[model.actuator("index").id] = 40.0
    for _ in range(1500):
        mujoco.mj_step(model, data)
    motor, finger = _q(model, data, "index_motor"), _q(model, data, "index_proximal")
    body = model.body("index_distal_link").id
    for _ in range(500):
        data.xfrc_applied[body, 4] = 0.3  # N m about the flexion axis
        mujoco.mj_step(model, data)
    assert _q(model, data, "index_proximal") > finger + 0.1
    assert abs(_q(model, data, "index_motor") - motor) < 0.5
    for _ in range(1000):
        data.xfrc_applied[:] = 0
        mujoco.mj_step(model, data)
    assert _q(model, data, "index_proximal") == pytest.approx(finger, abs=3e-3)


def test_lugre_where_presliding_was_found() -> None:
    root = etree.fromstring(XML)
    notes = write_motors(root, _hand(presliding=0.6, bristle=0.005))
    assert any("LuGre" in n for n in notes)
    element = root.find("actuator/dcmotor")
    sigma0, sigma1, coulomb, static, _ = map(float, element.get("lugre").split())
    assert sigma0 == pytest.approx(34.0 / 0.6) and sigma1 == pytest.approx(0.005 * sigma0) and coulomb == static == 34.0
    assert root.find(".//joint[@name='index_motor']").get("frictionloss") is None


@pytest.mark.parametrize("more", [{}, {"presliding": 0.6}])
def test_keyframe_puts_motor_where_the_finger_is(more: dict[str, float]) -> None:
    root = etree.fromstring(XML)
    write_motors(root, _hand(**more))
    root.find("keyframe/key").set("qpos", "1.2 1.08 0 0")
    complete_keyframes(root, _hand())
    model = mujoco.MjModel.from_xml_string(etree.tostring(root).decode())
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    u = (12100 + 58 * _q(model, data, "index_motor") - 12000) / 6000
    assert np.polynomial.polynomial.polyval(u, [0.0, 1.2, 0.25, -0.1]) == pytest.approx(1.2, abs=1e-3)
    assert data.ctrl[model.actuator("index").id] == pytest.approx(_q(model, data, "index_motor"))


def test_pinocchio_is_given_what_it_leaves_out() -> None:
    """Pinocchio's dynamics know no damping, friction, spring, actuator or equality: supplied from the file's numbers
    (and the equality's and push's forces from MuJoCo), both agree to 1e-8 of the largest acceleration; without them
    they do not."""
    pin = pytest.importorskip("pinocchio")
    model, data = _model(_hand())
    body = pin.Model()
    order = ("index_proximal", "index_distal", "index_motor", "index_drive")
    inertias = {"index_proximal": (0.01, [0.02, 0, 0], 1e-6), "index_distal": (0.005, [0.01, 0, 0], 1e-6)}
    parent = 0
    for name in order:
        shift = pin.SE3(np.eye(3), np.array([0.04, 0, 0]) if name == "index_distal" else np.zeros(3))
        axis = pin.JointModelRY() if name in inertias else pin.JointModelRZ()
        parent = body.addJoint(parent if name == "index_distal" else 0, axis, shift, name)
        mass, centre, inertia = inertias.get(name, (1e-9, [0, 0, 0], 1e-9))
        body.appendBodyToJoint(
            parent, pin.Inertia(mass, np.array(centre, float), inertia * np.eye(3)), pin.SE3.Identity()
        )
    body.gravity.setZero()
    address = np.array([model.joint(n).dofadr[0] for n in order])
    body.armature = model.dof_armature[address].copy()
    rng = np.random.default_rng(0)
    for _ in range(5):
        percent, speed = rng.uniform(20, 80), rng.choice([-1, 1]) * rng.uniform(40, 80)
        data.joint("index_motor").qpos[0], data.joint("index_motor").qvel[0] = percent, speed
        encoder = np.polynomial.Polynomial([0.0, 1.2, 0.25, -0.1])
        u = (12100 + 58 * percent - 12000) / 6000
        angle, rate = encoder(u), encoder.deriv()(u) * 58 / 6000 * speed
        for name, share in (("index_drive", 1.0), ("index_proximal", 1.0), ("index_distal", 0.9)):
            data.joint(name).qpos[0], data.joint(name).qvel[0] = share * angle, share * rate
        data.ctrl[0] = percent + 3.0 * speed / 22.0 + rng.uniform(-3, 3)  # short of where the soft friction lets go
        mujoco.mj_forward(model, data)
        q, v = data.qpos[address], data.qvel[address]
        motor = np.array([n == "index_motor" for n in order])
        current = 22.0 * (data.ctrl[0] - percent) - 3.0 * speed
        own = motor * (current - 0.15 * speed - 0.23 * percent - 9.0 - 34.0 * np.sign(speed))
        damping = np.array([1e-6, 0.0, 0.0, 0.0]) * v
        rows = data.efc_type != mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
        jacobian = data.efc_J.reshape(data.nefc, model.nv)[rows]
        push = np.zeros(model.nv)
        push[model.joint("index_proximal").dofadr[0]], push[model.joint("index_drive").dofadr[0]] = 1.0, -1.0
        length, rate = push @ data.qpos, push @ data.qvel
        tendon = push * (-model.tendon_stiffness[0] * length - model.tendon_damping[0] * rate)
        supplied = own - damping + (jacobian.T @ data.efc_force[rows] + tendon)[address]
        wanted = data.qacc[address]
        pin_data = body.createData()
        assert np.max(np.abs(pin.aba(body, pin_data, q, v, supplied) - wanted)) < 1e-8 * np.max(np.abs(wanted))
        bare = pin.aba(body, pin_data, q, v, motor * current)
        assert np.max(np.abs(bare - wanted)[motor]) > 100  # %/s^2: friction and spring are missing from it


def test_names_are_shared_by_no_two_things() -> None:
    root = etree.fromstring(XML)
    etree.SubElement(root.find("worldbody/body"), "site", name="index_map")
    write_motors(root, _hand(presliding=0.6))
    names = [
        e.get("name") for e in root.iter() if isinstance(e.tag, str) and e.getparent() is not None and e.get("name")
    ]
    assert len(names) == len(set(names)) and "index_map_2" in names


def test_motor_and_finger_stop_at_the_end_of_the_range() -> None:
    """Full current into either end: the rotor is held within 2 % of its travel, the finger is not thrown far off."""
    model, data = _model(_hand())
    for control in (150.0, -50.0):
        data.ctrl[model.actuator("index").id] = control
        seen = []
        for _ in range(1500):
            mujoco.mj_step(model, data)
            seen.append(_q(model, data, "index_motor"))
        assert -4.0 < min(seen) and max(seen) < 104.0


def test_scale_of_efforts_must_be_positive(tmp_path) -> None:
    from hand_model.compile import compile
    from hand_model.errors import DescriptionError

    with pytest.raises(DescriptionError, match="positive"):
        compile(_hand(), tmp_path / "hand", newton_metre_per_unit=-1.0)
