"""A chain of joints: weights off their axes are shared by joints, an offset is one joint's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_model.rig import diagnose_rig, fit_declared, load_rig
from hand_model.rig.balance import declared_columns
from hand_model.rig.diagnose import _freed, _off_axis, _without_stand_ins, trusted_fit
from hand_model.rig.dynamics import inertial_columns, inertial_parameters
from hand_model.rig.inverse import effort_residuals, with_bodies
from hand_model.rig.name.beside import score
from hand_model.rig.name.candidates import candidates
from hand_model.rig.name.problem import Term, normal, pose
from hand_model.rig.proof import Bench
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


def test_balances_made_before_say_the_loads_of_a_file_with_weights_off_their_axes(tmp_path: Path) -> None:
    """Products of inertia that only the file has come into the load as they do where the balances are made anew."""
    rig = load_rig(read_session(arm(tmp_path / "s")))
    fit = trusted_fit(rig)[0]
    freed = fit_declared(rig, cutoff_hz=fit.cutoff_hz, off_axis=True)
    by_load = candidates(rig, freed, "shoulder", only={"load_dependent_friction"})[0]
    terms = [Term(by_load, by_load.grid[0])]
    theta = np.append(freed.theta, 0.2)
    file = replace(rig, xml=Bench(rig).file(freed, terms, theta))
    lacks = {c.label for c in declared_columns(file)} - {c.label for c in fit.columns}
    assert any(label.endswith(("xy", "xz")) for label in lacks)
    sides = effort_residuals(file), effort_residuals(file, with_bodies(rig, fit.rows))
    for anew, before in zip(*sides, strict=True):
        np.testing.assert_allclose(before.error, anew.error, atol=1e-9 * np.abs(anew.expected).max())
    lame = effort_residuals(file, fit.rows)
    assert max(np.abs(a.error - b.error).max() for a, b in zip(sides[0], lame, strict=True)) > 1e-3


def test_weights_off_their_axes_take_the_place_of_loads_by_place(tmp_path: Path) -> None:
    """A detent that stands at the elbow for the weight off its axis goes, an offset that is there is asked beside it; with
    every weight declared there is nothing to ask."""
    rig = load_rig(read_session(arm(tmp_path / "s")))
    fit = trusted_fit(rig)[0]
    every = {j: {c.key: c for c in candidates(rig, fit, j)} for j in rig.joints}
    detent, drag = every["elbow"]["detent_load@elbow"], every["elbow"]["quadratic_damping@elbow"]
    parts = normal(pose(fit), [])
    stands = [score(pose(fit), [], c, parts).term for c in (detent, drag)]
    offset = Term(every["shoulder"]["asymmetric_friction@shoulder"], {})
    assert _without_stand_ins([offset]) == [[offset]]
    assert _without_stand_ins([*stands, offset]) == [stands[1:], stands[1:]]
    freed, finding = _off_axis(Bench(rig), fit, _freed(rig, fit), [stands[0]])
    assert len(freed.columns) > len(fit.columns) and finding.effect == "gravity_load"
    assert finding.parameters["inertial:lower:hx"]["value"] == pytest.approx(1.5 * 0.06, rel=0.25)
