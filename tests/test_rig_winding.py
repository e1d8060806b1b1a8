"""Drives whose effort falls with speed, told by their control: written as the motor that they equal."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from rig_bench import ARM, HEAD, written

from hand_model.rig import load_rig
from hand_model.rig.winding import with_windings
from hand_model.session import read_session

MOTOR = '<motor name="motor" joint="hinge"/>'
KINDS = {
    "general": '<general name="motor" joint="hinge" gear="2" gainprm="0.104" biastype="affine" biasprm="0 0 -0.037"/>',
    "velocity": '<velocity name="motor" joint="hinge" kv="0.3" ctrlrange="-1 1"/>',
}


@pytest.mark.parametrize("kind", KINDS)
def test_it_accelerates_the_joint_as_before(kind: str) -> None:
    """At any position, velocity and control."""
    xml = ARM.replace(MOTOR, KINDS[kind]).encode()
    before = mujoco.MjModel.from_xml_string(xml.decode())
    after = mujoco.MjModel.from_xml_string(with_windings(xml, before, ["motor"]).decode())
    random = np.random.default_rng(0)
    for q, v, u in random.uniform(-3, 3, (20, 3)):
        accelerations = []
        for model in (before, after):
            data = mujoco.MjData(model)
            data.qpos[0], data.qvel[0], data.ctrl[0] = q, v, u
            mujoco.mj_forward(model, data)
            accelerations.append(float(data.qacc[0]))
        assert accelerations[1] == pytest.approx(accelerations[0], rel=1e-9)


def test_what_is_no_winding_stays_as_it_is() -> None:
    """A spring in it, a constant, or another drive: the same bytes."""
    for other in ('biasprm="0 -1 -0.037"', 'biasprm="0.1 0 -0.037"', 'biasprm="0 0 0"'):
        xml = ARM.replace(MOTOR, KINDS["general"].replace('biasprm="0 0 -0.037"', other)).encode()
        assert with_windings(xml, mujoco.MjModel.from_xml_string(xml.decode()), ["motor"]) is xml


@pytest.mark.parametrize(("signal", "kind"), [("ctrl", "voltage"), ("force", "velocity")])
def test_only_one_that_is_told_by_its_control_is_a_supply(tmp_path: Path, signal: str, kind: str) -> None:
    t = np.arange(0, 4, 0.004)
    arm, head = ARM.replace(MOTOR, KINDS["velocity"]), HEAD.replace("motor:force", f"motor:{signal}")
    rig = load_rig(read_session(written(tmp_path / "s", arm, head, "torque", [np.stack([t, np.sin(t), np.cos(t)], 1)])))
    assert rig.drives[0].kind == kind and (b"dcmotor" in rig.xml) is (signal == "ctrl")
    assert ("hinge" in rig.trials[0].voltage) is (signal == "ctrl")
