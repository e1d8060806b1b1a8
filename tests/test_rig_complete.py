"""Rig sessions as laboratories have them: masses by geoms, parts without names or in other files, lost rows, recordings
too short to tell anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_pendulum import MASS, PENDULUM, planted

from hand_model.errors import DescriptionError, SessionError
from hand_model.rig import diagnose_rig, fit_declared, load_rig
from hand_model.rig.channels import check_channels
from hand_model.rig.complete import completed
from hand_model.rig.patch import write_declared
from hand_model.session import read_session

mujoco = pytest.importorskip("mujoco")

INERTIAL = '<inertial pos="0 0 -0.2" mass="0.5" diaginertia="0.002 0.002 0.0001"/>'
GEOM = '<geom type="box" size="0.02 0.03 0.1" pos="0 0.01 -0.2" euler="0.1 0 0.3" mass="0.5"/>'


def compiled(xml: bytes):
    return mujoco.MjModel.from_xml_string(xml.decode())


def test_a_whole_file_stays_as_it_is(tmp_path: Path) -> None:
    assert completed(PENDULUM.encode(), tmp_path) == PENDULUM.encode()


@pytest.mark.parametrize("compiler", ["", '<compiler inertiafromgeom="true"/>', '<compiler settotalmass="0.7"/>'])
def test_masses_of_geoms_are_written_as_they_are(tmp_path: Path, compiler: str) -> None:
    bare = PENDULUM.replace(INERTIAL, GEOM).replace("<worldbody>", compiler + "<worldbody>").encode()
    whole = completed(bare, tmp_path)
    before, after = compiled(bare), compiled(whole)
    for what in ("body_mass", "body_ipos", "body_inertia", "body_iquat"):
        np.testing.assert_allclose(getattr(after, what), getattr(before, what), atol=1e-12)
    heavier = whole.replace(b'mass="0.5"', b'mass="0.9"', 1).replace(b'mass="0.7"', b'mass="0.9"', 1)
    assert compiled(heavier).body_mass[1] == pytest.approx(0.9)  # and can be changed
    assert completed(whole, tmp_path) == whole


def test_what_has_no_name_gets_one(tmp_path: Path) -> None:
    bare = """<mujoco><worldbody><frame><body><joint axis="0 1 0"/><geom size="0.1"/></body></frame>
    <body name="body_0"><joint name="a"/><geom size="0.1"/><body><joint/><geom size="0.1"/></body></body></worldbody>
    <tendon><fixed><joint joint="a" coef="1"/></fixed></tendon><equality><joint joint1="a"/></equality>
    <actuator><motor joint="a"/></actuator></mujoco>"""
    model = compiled(completed(bare.encode(), tmp_path))
    assert [model.body(k).name for k in range(4)] == ["world", "body_0_", "body_0", "body_2"]
    assert [model.joint(k).name for k in range(3)] == ["joint_0", "a", "joint_2"]
    assert model.actuator(0).name == "actuator_0" and model.tendon(0).name and model.equality(0).name


def test_parts_in_other_files_are_found(tmp_path: Path) -> None:
    corner = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "m.obj").write_text(corner)
    (tmp_path / "part.xml").write_text(PENDULUM.replace(INERTIAL, '<geom type="mesh" mesh="m" mass="0.5"/>'))
    asset = '<compiler meshdir="parts"/><asset><mesh name="m" file="m.obj" scale="0.1 0.1 0.1"/></asset>'
    whole = completed(f'<mujoco>{asset}<include file="part.xml"/></mujoco>'.encode(), tmp_path)
    assert compiled(whole).body_mass[1] == pytest.approx(0.5)
    with pytest.raises(DescriptionError, match="other.xml"):
        completed(b'<mujoco><include file="other.xml"/></mujoco>', tmp_path)


def test_a_fitted_mass_of_geoms_reaches_the_file(tmp_path: Path) -> None:
    folder = planted(tmp_path / "s")
    (folder / "rig.xml").write_text(
        PENDULUM.replace(INERTIAL, GEOM.replace('euler="0.1 0 0.3" ', "").replace("0.01 -", "0 -"))
    )
    rig = load_rig(read_session(folder))
    fit = fit_declared(rig)
    model = compiled(write_declared(rig, fit.columns, fit.theta))
    lever = model.body_mass[1] * -model.body_ipos[1, 2]
    assert lever == pytest.approx(MASS * 0.2, rel=0.01)


def rows(folder: Path, name: str, kept) -> None:
    file = folder / "log" / name
    head, *lines = file.read_text().splitlines()
    file.write_text("\n".join([head, *(line for k, line in enumerate(lines) if kept(k))]) + "\n")


def test_lost_rows_are_not_bridged(tmp_path: Path) -> None:
    """Two seconds lost in every recording: a line through them is a motion that never was."""
    whole, torn = planted(tmp_path / "whole"), planted(tmp_path / "torn")
    for k in range(4):
        rows(torn, f"run_{k}.csv", lambda i: not 900 < i < 1300)
    left = {}
    for folder in (whole, torn):
        fit = fit_declared(load_rig(read_session(folder)))
        left[folder] = max(float(np.sqrt(np.mean(fit.residual(r)[r.moving] ** 2))) for r in fit.rows)
    assert left[torn] < 1.2 * left[whole]


def test_a_short_recording_is_left_out_and_said(tmp_path: Path) -> None:
    folder = planted(tmp_path / "s")
    rows(folder, "run_0.csv", lambda i: i < 4)
    rig = load_rig(read_session(folder))
    assert [t.name for t in rig.trials] == [f"log/run_{k}.csv" for k in (1, 2, 3)]
    assert len(rig.notes) == 1 and "run_0.csv: 4 samples" in rig.notes[0]
    for k in range(1, 4):
        rows(folder, f"run_{k}.csv", lambda i: i < 5)
    with pytest.raises(SessionError, match="30 or more are needed"):
        load_rig(read_session(folder))


def test_milliseconds_and_two_drives_of_a_joint_are_refused(tmp_path: Path) -> None:
    slow = planted(tmp_path / "slow")
    for k in range(4):
        file = slow / f"log/run_{k}.csv"
        table = np.loadtxt(file, delimiter=",", skiprows=1)
        table[:, 0] *= 1e3
        np.savetxt(file, table, delimiter=",", header="time,position,torque", comments="")
    with pytest.raises(SessionError, match="in seconds is needed"):
        load_rig(read_session(slow))
    two = planted(tmp_path / "two")
    (two / "rig.xml").write_text(PENDULUM.replace("</actuator>", '<motor name="b" joint="hinge"/></actuator>'))
    with pytest.raises(DescriptionError, match='2 actuators drive the joint "hinge"'):
        load_rig(read_session(two))


def test_a_linear_machine_that_is_moved_in_a_sine_takes_one(tmp_path: Path) -> None:
    """Viscous friction alone: what the drive gives is a sinusoid as the motion is, and no command for that."""
    folder = planted(tmp_path / "s")
    slide = PENDULUM.replace(
        'axis="0 -1 0" damping="0.02" frictionloss="0.05"', 'type="slide" axis="1 0 0" damping="2"'
    )
    (folder / "rig.xml").write_text(slide)
    random = np.random.default_rng(0)
    for k in range(4):
        t, w = np.arange(0, 12, 0.005), 2 * np.pi * (0.5 + 0.2 * k)
        q, torque = 0.1 * np.sin(w * t), 0.3 * w * np.cos(w * t) - 0.05 * w**2 * np.sin(w * t)
        table = np.stack([t, q, torque + 0.002 * random.standard_normal(len(t))], 1)
        np.savetxt(folder / f"log/run_{k}.csv", table, delimiter=",", header="time,position,torque", comments="")
    assert check_channels(load_rig(read_session(folder))) == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("</body></worldbody>", '<body><joint name="wrist"/><geom size="0.01"/></body></body></worldbody>'),
            '"wrist"',
        ),
        (('<motor name="motor" joint="hinge"/>', '<velocity name="motor" joint="hinge" kv="2"/>'), '"motor" gives'),
    ],
)
def test_why_nothing_can_be_analysed_is_said(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    folder = planted(tmp_path / "s")
    (folder / "rig.xml").write_text(PENDULUM.replace(*change))
    manifest = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(manifest.replace("actuator:motor:force", "actuator:motor:setpoint"))
    findings = diagnose_rig(read_session(folder), tmp_path / "out")
    assert findings.verdict == "unexplained" and said in findings.notes[0]


def test_a_velocity_servo_of_which_the_force_is_recorded_is_fitted(tmp_path: Path) -> None:
    folder = planted(tmp_path / "s")
    (folder / "rig.xml").write_text(
        PENDULUM.replace('<motor name="motor" joint="hinge"/>', '<velocity name="motor" joint="hinge" kv="2"/>')
    )
    rig = load_rig(read_session(folder))
    fit = fit_declared(rig)
    assert not any(c.kind == "offset" for c in fit.columns)
    model = compiled(write_declared(rig, fit.columns, fit.theta))
    assert model.body_mass[1] * -model.body_ipos[1, 2] == pytest.approx(MASS * 0.2, rel=0.01)
