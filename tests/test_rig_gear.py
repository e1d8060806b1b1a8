"""A geared joint with an encoder on either side: the gear is reckoned from its drive on, and gives under what it
carries."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rig_bench import RIG, two_sines, written

from hand_model.cli import main
from hand_model.errors import DescriptionError
from hand_model.rig import diagnose_rig, load_rig
from hand_model.rig.coupling_angles import coupling_angles
from hand_model.rig.couplings import coupling_terms
from hand_model.rig.mjcf import keep_couplings, read_couplings, read_effects
from hand_model.session import read_session

mujoco = pytest.importorskip("mujoco")

RATIO, STIFFNESS, ARM = 50.0, 900.0, 4.0 * 0.3
MODEL = f"""<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="rotor" axis="0 -1 0" frictionloss="0.02"/>
<inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/></body>
<body><joint name="link" axis="0 -1 0" damping="0.5"/>
<inertial pos="0 0 -0.3" mass="4" diaginertia="0.02 0.02 0.01"/></body></worldbody>
<equality><joint name="gear" joint1="rotor" joint2="link" polycoef="0.5 {RATIO} 0 0 0"/></equality>
<actuator><motor name="rotor" joint="rotor"/></actuator></mujoco>
"""
HEAD = (
    RIG
    + """position = "joint:rotor:position"
link = "joint:link:position"
torque = "actuator:rotor:force"
"""
)


def geared(folder: Path) -> Path:
    """Five recordings of a gear that gives; the fifth validates."""
    random, tables = np.random.default_rng(7), []
    t = np.arange(0, 16, 0.004)
    for _ in range(5):
        _, q, v, a = two_sines(random, t)
        load = (0.02 + 4.0 * 0.09) * a + ARM * 9.81 * np.sin(q)
        rotor = 0.5 + RATIO * (q + load / STIFFNESS)
        torque = load / RATIO + 1e-4 * RATIO * a + 0.01 * v + 0.03 * np.sign(v) + 0.002 * random.standard_normal(len(t))
        tables.append(np.c_[t, np.round(rotor / 1e-3) * 1e-3, np.round(q / 1e-5) * 1e-5, torque])
    return written(folder, MODEL, HEAD, "link,torque", tables)


def test_a_gear_is_reckoned_from_its_drive_on(tmp_path: Path) -> None:
    """The file says rotor = 0.5 + 50 link; link = (rotor - 0.5) / 50 is the same, and the rotor has the drive."""
    rig = load_rig(read_session(geared(tmp_path / "s")))
    (coupling,) = rig.couplings
    assert (coupling.dependent, coupling.independent) == ("link", "rotor")
    np.testing.assert_allclose(coupling.polycoef, [-0.5 / RATIO, 1 / RATIO, 0, 0, 0], rtol=1e-14)
    assert rig.independent == ("rotor",)
    model = mujoco.MjModel.from_xml_string(rig.xml.decode())
    assert (model.eq_obj1id[0], model.eq_obj2id[0]) == (1, 0)


def test_a_bent_coupling_and_one_of_a_passive_joint_stay_as_they_are(tmp_path: Path) -> None:
    session = read_session(geared(tmp_path / "s"))
    for said in (f"0.5 {RATIO} 0.1 0 0", f"0.5 {RATIO} 0 0 0"):
        xml = MODEL.replace(f"0.5 {RATIO} 0 0 0", said)
        both = xml.replace("</actuator>", '<motor name="load" joint="link"/></actuator>')
        for text in (both, *([xml] if "0.1" in said else [])):
            (coupling,) = load_rig(session, text.encode()).couplings
            assert coupling.dependent == "rotor"


def test_what_goes_through_a_gear_without_a_sensor_is_what_its_bodies_ask_for(tmp_path: Path) -> None:
    """The link lags behind its motor by load over stiffness; the motor's own torque holds friction and rotor, too."""
    rig = load_rig(read_session(geared(tmp_path / "s")))
    fit, terms, *_ = coupling_terms(rig, rig.couplings[0])
    first = terms[0].candidate
    assert first.effect == "series_elasticity" and first.variant.endswith("load at link")
    row = next(r for r in fit.rows)
    column = first.columns(row, {})[:, 0]
    q = row.position / RATIO
    assert np.corrcoef(column, np.sin(q))[0, 1] > 0.9  # mostly weight
    assert np.max(np.abs(column)) < 2 * ARM * 9.81


def test_the_file_keeps_what_a_coupling_lacks(tmp_path: Path) -> None:
    """Angle by the file's polynomial and its records: what is left of the recording held out is what is told; and effects
    at joints are read without it."""
    folder = geared(tmp_path / "s")
    found = diagnose_rig(read_session(folder), tmp_path / "out")
    told = found.lack_of_fit["couplings"]["gear"]
    assert told["after"] < 0.5 * told["before"]
    xml = (tmp_path / "out" / "rig.xml").read_bytes()
    records = read_couplings(xml)
    assert [r["effect"] for r in records] == [f.effect for f in found.findings if f.where.get("coupling") == "gear"]
    assert not {r["effect"] for r in records} & {r.get("effect") for r in read_effects(xml)}
    angles = coupling_angles(load_rig(read_session(folder), xml))
    held = [(a.angle_rmse, a.samples) for a in angles if a.validate]
    assert held
    assert {a.coupling for a in angles} == {"gear"}
    left = np.sqrt(np.average([e**2 for e, _ in held], weights=[n for _, n in held]))
    assert left == pytest.approx(told["after"], rel=0.06)  # its zero was taken out before the last fit
    assert all(a.angle_rmse < 0.6 * a.plain_rmse for a in angles)


def test_a_record_that_names_no_effect_of_its_coupling_is_refused(tmp_path: Path) -> None:
    folder = geared(tmp_path / "s")
    record = {"coupling": "gear", "effect": "drive_backlash", "variant": "of jelly", "joint": "link", "shape": {}}
    xml = keep_couplings((folder / "rig.xml").read_bytes(), [{**record, "amplitude": {}}])
    with pytest.raises(DescriptionError, match=r'"drive_backlash" \(of jelly\) at coupling "gear"'):
        coupling_angles(load_rig(read_session(folder), xml))


def test_replay_shows_what_a_coupling_leaves(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = geared(tmp_path / "s")
    assert main(["replay", str(folder), "--output", str(tmp_path / "out")]) == 0
    assert "polynomial alone" in capsys.readouterr().out
    told = json.loads((tmp_path / "out" / "figures.json").read_text())["couplings"]
    assert {row["coupling"] for row in told} == {"gear"}
    assert all(row["angle_rmse"] == row["angle_rmse_polynomial"] > 0 for row in told)
