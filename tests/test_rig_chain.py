"""A chain of joints: weights off their axes are shared by joints, an offset is one joint's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.rig import diagnose_rig
from hand_model.rig.dynamics import inertial_columns, inertial_parameters
from hand_model.session import read_session

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.3" frictionloss="0.4"/>
<inertial pos="{upper}" mass="2" diaginertia="0.02 0.02 0.004"/>
<body name="lower" pos="0 0 -0.4"><joint name="elbow" axis="0 1 0" damping="0.2" frictionloss="0.2"/>
<inertial pos="{lower}" mass="1.5" diaginertia="0.01 0.01 0.002"/></body></body></worldbody>
<actuator><motor name="shoulder" joint="shoulder"/><motor name="elbow" joint="elbow"/></actuator></mujoco>
"""
HEAD = """format = "hand-session/1"
[hand]
name = "arm"
[rig]
model = "rig.xml"
[signals]
q1 = "joint:shoulder:position"
q2 = "joint:elbow:position"
t1 = "actuator:shoulder:force"
t2 = "actuator:elbow:force"
"""
DECLARED = ARM.format(upper="0 0 -0.2", lower="0 0 -0.15")
TRUE = ARM.format(upper="0.004 0 -0.2", lower="0.06 0 -0.15")
OFFSET = -2.1  # N m, at the shoulder


def arm(folder: Path) -> Path:
    """Five recordings of the arm with other centres of mass, and a shoulder torque that is off, the last held out."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(DECLARED)
    model, random, text = mujoco.MjModel.from_xml_string(TRUE), np.random.default_rng(2), HEAD
    parameters = inertial_parameters(model)
    for k in range(5):
        t = np.arange(0, 12, 0.01)
        w = 2 * np.pi * random.uniform([[0.15, 0.4], [0.2, 0.5]], [[0.3, 0.7], [0.35, 0.8]])
        size = random.uniform([[0.2, 0.08], [0.3, 0.1]], [[0.35, 0.15], [0.5, 0.2]])
        phase = w[..., None] * t + random.uniform(0, 6, (2, 2, 1))
        q, v, a = (
            np.einsum("jk,jkn->nj", size * rate, wave)
            for rate, wave in ((1, np.sin(phase)), (w, np.cos(phase)), (-(w**2), np.sin(phase)))
        )
        load = np.einsum("njbp,bp->nj", inertial_columns(model, q, v, a, np.array([0, 0, -9.81])), parameters)
        torque = load + v * [0.3, 0.2] + np.sign(v) * [0.4, 0.2] + [OFFSET, 0.0]
        torque += random.normal(0, [0.05, 0.02], torque.shape)
        table = np.column_stack([t, np.round(q / 1e-4) * 1e-4, torque])
        np.savetxt(folder / f"log/{k}.csv", table, delimiter=",", header="time,q1,q2,t1,t2", comments="", fmt="%.8g")
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n' + ('purpose = "validate"\n' if k == 4 else "")
    (folder / "session.toml").write_text(text)
    return folder


def test_an_offset_beside_weights_off_their_axes_is_that_of_its_joint(tmp_path: Path) -> None:
    findings = diagnose_rig(read_session(arm(tmp_path / "s")))
    assert [(f.effect, f.where["joint"]) for f in findings.findings[1:]] == [("asymmetric_friction", "shoulder")]
    weights, offset = findings.findings
    assert weights.effect == "gravity_load"
    assert weights.parameters["inertial:lower:hx"]["value"] == pytest.approx(1.5 * 0.06, rel=0.05)
    assert offset.parameters["offset"]["value"] == pytest.approx(OFFSET, rel=0.05)
