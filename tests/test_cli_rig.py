"""The command line on rigs: replay and diagnosis, and what is meant for hands only."""

from __future__ import annotations

import json

import pytest
from cli_refusal import edit, refused

from hand_model.cli import main

PENDULUM = """<mujoco><option timestep="0.002" gravity="0 0 -9.81"/><worldbody><body name="mass">
<joint name="hinge" axis="0 1 0" damping="0.01"/><geom type="sphere" size="0.02" pos="0 0 -0.2" mass="0.3"/>
</body></worldbody></mujoco>"""


@pytest.fixture
def rig(tmp_path):
    """A pendulum let go by its own model: replayed, it must move as recorded."""
    import mujoco

    root = tmp_path / "pendulum"
    (root / "log").mkdir(parents=True)
    (root / "pendulum.xml").write_text(PENDULUM)
    trials = ""
    for name, start, extra in (("a", 0.8, ""), ("b", 0.5, 'purpose = "validate"\n')):
        model = mujoco.MjModel.from_xml_string(PENDULUM)
        data = mujoco.MjData(model)
        data.qpos[0] = start
        lines = ["time,position"]
        for i in range(3000):
            if i % 5 == 0:
                lines.append(f"{0.002 * i!r},{float(data.qpos[0])!r}")
            mujoco.mj_step(model, data)
        (root / "log" / f"{name}.csv").write_text("\n".join(lines) + "\n")
        trials += f'[[trial]]\nkind = "motion"\nlog = "log/{name}.csv"\n{extra}'
    (root / "session.toml").write_text(
        'format = "hand-session/1"\n[hand]\nname = "pendulum"\n[rig]\nmodel = "pendulum.xml"\n'
        f'[signals]\nposition = "joint:hinge:position"\n{trials}'
    )
    return root


def test_replay_of_a_rig_needs_no_description(rig, tmp_path, capsys):
    assert main(["replay", str(rig), "--output", str(tmp_path / "report")]) == 0
    assert "On 1 validation trial, the motion simulated in open loop" in capsys.readouterr().out
    rows = json.loads((tmp_path / "report" / "figures.json").read_text())["joints"]
    assert [r["trial"] for r in rows] == ["log/a.csv", "log/b.csv"] and [r["held_out"] for r in rows] == [False, True]
    assert all(r["position_rmse"] < 0.05 for r in rows)
    assert "<svg" in (tmp_path / "report" / "report.html").read_text()


def test_a_rig_without_a_position_is_refused(rig, tmp_path, capsys):
    out = tmp_path / "out"
    edit(rig / "session.toml", "joint:hinge:position", "joint:hinge:velocity")
    assert "joint:NAME:position" in refused(capsys, "diagnose", rig, "--output", out)
    edit(rig / "session.toml", "joint:hinge:velocity", "joint:hinge:position")
    (rig / "log" / "a.csv").write_text("time,position\n" + "".join(f"{0.01 * i},\n" for i in range(500)))
    message = refused(capsys, "diagnose", rig, "--output", out)
    assert "a.csv" in message and "position" in message
    assert not out.exists()


def test_what_is_not_meant_for_a_rig_or_a_folder_is_refused(rig, loop, tmp_path, capsys):
    """And at once, before minutes of work are lost."""
    (tmp_path / "file").write_text("x")
    assert "is a file" in refused(capsys, "diagnose", rig, "--output", tmp_path / "file")
    assert "session itself" in refused(capsys, "diagnose", rig, "--output", rig)
    assert "brings its own model" in refused(
        capsys, "diagnose", rig, "--output", tmp_path / "o", "--model", loop / "left.hand"
    )
    assert not (tmp_path / "o").exists() and (rig / "pendulum.xml").read_text() == PENDULUM
    assert "--fix" in refused(capsys, "check", loop / "compiled", "--fix", tmp_path / "fixed")
    assert "--json" in refused(capsys, "check", loop / "compiled", "--json")


def test_the_python_call_diagnoses_a_rig_as_the_command_does(rig):
    import hand_model
    from hand_model.rig.findings import RigFindings

    findings = hand_model.diagnose(rig)
    assert isinstance(findings, RigFindings)
    assert findings.protocol["held_out"] == ["log/b.csv"]


@pytest.mark.slow
def test_a_diagnosis_of_a_rig_without_a_model_leaves_none(rig, tmp_path):
    out = tmp_path / "out"
    assert main(["diagnose", str(rig), "--output", str(out)]) == 0
    assert sorted(f.name for f in out.iterdir()) == ["findings.json", "report.html", "rig.xml", "rig_declared.xml"]
    assert main(["diagnose", str(rig), "--output", str(out), "--no-model"]) == 0
    assert sorted(f.name for f in out.iterdir()) == ["findings.json", "report.html"]


def test_what_hands_and_rigs_need(rig, loop, recorded, tmp_path, capsys):
    assert "name its folder before the session" in refused(capsys, "replay", recorded, "--output", tmp_path / "r")
    assert "rig" in refused(capsys, "replay", loop / "compiled", rig, "--output", tmp_path / "r")
    assert "rig" in refused(capsys, "identify", rig, "--output", tmp_path / "x.hand")
    assert 'kind "grasp"' in refused(capsys, "touch", recorded)
    assert not (tmp_path / "r").exists()
