"""The file of a fitted swing is the fit: its inertia about the joint, its weight, and the motion in MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from rig_bench import RIG as HEAD

from hand_model.rig.declared import fit_declared
from hand_model.rig.model import RigModel, load_rig
from hand_model.rig.replay import replay_rig
from hand_model.rig.swing.build import build_swing
from hand_model.rig.swing.patch import write_swing
from hand_model.rig.swing.simulation import Swing, simulate, vector
from hand_model.session import read_session

RIG = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<worldbody>{bodies}</worldbody></mujoco>"""
PLAIN = """<body name="arm"><joint name="axis" axis="0 -1 0" damping="3e-4" frictionloss="3e-4" armature="1e-4"/>
<inertial pos="0 0 -0.2" mass="0.2" diaginertia="3e-4 3e-4 1e-5"/></body>"""
BUILT_UP = """<body name="arm" pos="0.1 0 0.3" euler="0.1 0 0"><joint name="axis" pos="0 0.02 0.05" axis="0 -1 0" damping="3e-4" frictionloss="3e-4"/>
<inertial pos="0.01 0 -0.1" quat="0.9 0.1 0.3 0" mass="0.2" diaginertia="3e-4 2e-4 2e-4"/>
<body name="weight" pos="0 0 -0.2" euler="0 0.4 0"><inertial pos="0.02 0 0.01" mass="0.15" fullinertia="2e-5 3e-5 2.5e-5 1e-6 0 2e-6"/></body></body>"""
SLIDE = """<body name="arm"><joint name="axis" type="slide" axis="1 0 0" damping="3e-4" frictionloss="3e-4"/>
<inertial pos="0 0 -0.1" mass="0.2" diaginertia="3e-4 3e-4 3e-4"/></body>"""


def recorded(
    folder: Path, bodies: str, angles: np.ndarray | None = None, seconds: float = 6.0
) -> tuple[RigModel, Swing]:
    """A session of two free swings at 200 Hz, of which the second validates."""
    t = np.arange(0, seconds, 0.005)
    angles = np.stack([1.2 * np.cos(7 * t), 0.9 * np.cos(7 * t)], 1) if angles is None else angles
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(RIG.format(bodies=bodies))
    text = HEAD + 'position = "joint:axis:position"\n'
    for k, q in enumerate(angles.T):
        np.savetxt(
            folder / f"log/{k}.csv", np.stack([t[: len(q)], q], 1), delimiter=",", header="time,position", comments=""
        )
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n' + ('purpose = "validate"\n' if k else "")
    (folder / "session.toml").write_text(text)
    rig = load_rig(read_session(folder))
    return rig, build_swing(rig, fit_declared(rig), 0.005)


def acts(xml: bytes) -> tuple[float, np.ndarray]:
    """Inertia about the joint of a file's model, and what holds it at three places."""
    model = mujoco.MjModel.from_xml_string(xml.decode())
    data, holds, mass = mujoco.MjData(model), [], np.zeros(1)
    for q in (0.0, 0.7, 2.0):
        data.qpos[0] = q
        mujoco.mj_forward(model, data)
        holds.append(data.qfrc_bias[0])
    mujoco.mj_mulM(model, data, mass, np.ones(1))
    return float(mass[0]), np.array(holds)


@pytest.mark.parametrize("share", [0.4, 0.95, 1.6])
@pytest.mark.parametrize("bodies", [PLAIN, BUILT_UP, SLIDE])
def test_a_file_has_the_fitted_inertia_and_the_declared_weight(tmp_path: Path, bodies: str, share: float) -> None:
    """More inertia than the bodies' or less, wherever these lie and however they are turned."""
    rig, swing = recorded(tmp_path / "s", bodies)
    inertia, holds = acts(rig.xml)
    theta = vector({**swing.initial, "inertia": share * swing.bodies})
    fitted, held = acts(write_swing(rig, swing, theta))
    assert inertia > 0.9 * swing.bodies
    assert fitted == pytest.approx(share * swing.bodies, rel=1e-9)
    assert held == pytest.approx(holds, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("effects", [{}, {"stiffness": 0.08, "offset": 0.01}, {"lateral": 0.01, "drag": 2e-4}])
def test_a_file_with_less_inertia_than_declared_replays_the_fitted_motion(
    tmp_path: Path, effects: dict[str, float]
) -> None:
    """A swing whose declared bodies have a quarter too much: what was simulated, MuJoCo has again from the file."""
    rig, swing = recorded(tmp_path / "blank", PLAIN)
    theta = vector({**swing.initial, "inertia": 0.8 * swing.bodies, **effects})
    q = simulate(swing, np.repeat(theta[None], 2, 0), np.arange(2))
    rig, swing = recorded(tmp_path / "s", PLAIN, q)
    left = replay_rig(read_session(tmp_path / "s"), write_swing(rig, swing, theta), efforts=False)
    assert left.figure("position_rmse", True) < 0.01 * np.std(q[:, 1])
