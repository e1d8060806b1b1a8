"""Rigs diagnosed: known truths planted into recordings made here, and the published machines where they are at hand."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rig_bench import HEAD
from rig_pendulum import PENDULUM, planted

from hand_model.errors import DescriptionError, SessionError
from hand_model.rig import diagnose_rig, load_rig, replay_rig
from hand_model.rig.mjcf import read_effects
from hand_model.rig.states import local_states
from hand_model.rig.swing.simulation import Lane, Swing, simulate, vector
from hand_model.session import read_session

REAL = Path(__file__).resolve().parents[2] / "shared" / "real"


@pytest.fixture(scope="module")
def planted_load(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with load-dependent friction in it."""
    return planted(tmp_path_factory.mktemp("load") / "session", "load")


@pytest.mark.parametrize(
    ("effect", "name"),
    [
        ("drag", "quadratic_damping"),
        pytest.param("offset", "asymmetric_friction", marks=pytest.mark.slow),
        ("stribeck", "stribeck_friction"),
    ],
)
def test_planted_effects_are_named_first(tmp_path: Path, effect: str, name: str) -> None:
    """What was planted leads the list, or is in its class, and the held-out error falls by a fifth or more."""
    findings = diagnose_rig(read_session(planted(tmp_path / "s", effect)))
    assert findings.verdict == "mismatch"
    assert name in findings.findings[0].members
    assert findings.lack_of_fit["after"] < 0.8 < findings.lack_of_fit["before"] and findings.lack_of_fit["limit"] < 0.8


def test_load_dependent_friction_is_named_and_measured(planted_load: Path, tmp_path: Path) -> None:
    """The coefficient lies near the planted 0.25, the files are written, and read back."""
    findings = diagnose_rig(read_session(planted_load), tmp_path / "out")
    first = findings.findings[0]
    assert first.effect == "load_dependent_friction"
    value = next(v["value"] for k, v in first.parameters.items() if k.startswith("per_"))
    assert value == pytest.approx(0.25, rel=0.2)
    assert first.fit["held_out"] == ["log/run_3.csv"]
    assert first.fit["after"] < 0.75 * first.fit["before"]
    kept = [r["effect"] for r in read_effects((tmp_path / "out" / "rig.xml").read_bytes()) if "effect" in r]
    assert kept[0] == "load_dependent_friction"
    for key, name in (("before", "rig_declared.xml"), ("after", "rig.xml")):  # the files alone reproduce the figures
        replayed = replay_rig(read_session(planted_load), (tmp_path / "out" / name).read_bytes(), simulate=False)
        assert replayed.figure("effort_rmse", True) == pytest.approx(
            findings.lack_of_fit["joints"]["hinge"][key], rel=1e-9
        )
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["findings.json", "rig.xml", "rig_declared.xml"]


def test_nothing_is_named_where_nothing_is_missing(tmp_path: Path) -> None:
    """The declared physics alone, with another mass than declared: no effect."""
    findings = diagnose_rig(read_session(planted(tmp_path / "s")))
    assert [f.effect for f in findings.findings] == []
    assert findings.verdict != "mismatch"


@pytest.mark.parametrize("effect", ["command", "dead"])
def test_channels_that_are_no_measurement_are_refused(tmp_path: Path, effect: str) -> None:
    """A sinusoid of time and a constant are named, and nothing else is claimed from them."""
    findings = diagnose_rig(read_session(planted(tmp_path / "s", effect)))
    assert {f.effect for f in findings.findings} == {"command_as_measurement"}
    assert findings.findings[0].correction == "channel refused"


def test_unsigned_torque_is_refused(tmp_path: Path) -> None:
    """The magnitude of a torque is no torque."""
    findings = diagnose_rig(read_session(planted(tmp_path / "s", "unsigned")))
    assert findings.findings[0].effect == "command_as_measurement"
    assert "no sign" in findings.findings[0].statement


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"joint:hinge:position"', '"joint:hing:position"', 'did you mean "hinge"'),
        ('"joint:hinge:position"', '"joint:hinge:posture"', "position"),
        ('"actuator:motor:force"', '"motor.force"', "valid"),
        ('position = "joint', 'angle = "joint', 'no column "angle"'),
    ],
)
def test_wrong_signals_are_refused_with_a_hint(tmp_path: Path, old: str, new: str, says: str) -> None:
    """Each breach names what is wrong and what would be valid."""
    folder = planted(tmp_path / "s", trials=2, seconds=2.0)
    manifest = folder / "session.toml"
    manifest.write_text(manifest.read_text().replace(old, new))
    with pytest.raises(SessionError, match=says):
        load_rig(read_session(folder))


def test_a_model_that_mujoco_cannot_read_is_refused(tmp_path: Path) -> None:
    """One of our errors, not a traceback of MuJoCo's."""
    folder = planted(tmp_path / "s", trials=2, seconds=2.0)
    (folder / "rig.xml").write_text("<mujoco><body/></mujoco>")
    with pytest.raises((DescriptionError, SessionError)):
        load_rig(read_session(folder))


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not here")
def test_commands_said_to_be_torques_are_refused_in_a_real_recording() -> None:
    """The first day's torque columns are sinusoids of time; nothing is fitted to them."""
    findings = diagnose_rig(read_session(REAL / "double-pendulum-ak80-first-day"))
    assert {f.effect for f in findings.findings} == {"command_as_measurement"}
    assert {f.where["joint"] for f in findings.findings} == {"shoulder", "elbow"}


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not here")
def test_screw_drive_differs_by_direction() -> None:
    """EMPS: friction of the screw differs between its directions, and that holds on the cycle held out."""
    findings = diagnose_rig(read_session(REAL / "emps-screw-drive"))
    assert findings.findings[0].effect in ("asymmetric_viscous_friction", "asymmetric_friction")
    assert findings.lack_of_fit["after"] < 0.85


@pytest.mark.slow
@pytest.mark.parametrize("zero", [0.0, 0.006])
def test_a_passive_session_without_validation_is_diagnosed(tmp_path: Path, zero: float) -> None:
    """Air drag of a free swing is named from encoder alone; two recordings, none held out. So it is with an encoder
    whose zero is off, and that is named besides."""
    text = PENDULUM.replace('<actuator><motor name="motor" joint="hinge"/></actuator>', "").replace(
        'damping="0.02"', 'damping="0.004"'
    )
    text = text.replace('frictionloss="0.05"', 'frictionloss="0.004"')
    (tmp_path / "log").mkdir()
    (tmp_path / "rig.xml").write_text(text)
    manifest, n = HEAD.replace('torque = "actuator:motor:force"\n', ""), 1500
    truth = vector({"inertia": 0.0225, "damping": 0.001, "coulomb": 0.004, "drag": 0.004})
    for k, start in enumerate((1.4, 0.8)):
        lane = Lane("x", False, np.zeros(n), 1.0, np.zeros(n), (start, 0.0), np.zeros(n), np.ones(n))
        swing = Swing((lane,), 0.981, 0.0, {"inertia": 0.022, "damping": 0.004, "coulomb": 0.004}, False)
        q = np.round((zero + simulate(swing, truth[None], np.array([0]))[:, 0]) / 2e-4) * 2e-4
        np.savetxt(
            tmp_path / f"log/{k}.csv",
            np.stack([np.arange(n) * 2e-3, q], 1),
            delimiter=",",
            header="time,position",
            comments="",
            fmt="%.9g",
        )
        manifest += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n'
    (tmp_path / "session.toml").write_text(manifest)
    findings = diagnose_rig(read_session(tmp_path))
    assert "quadratic_damping" in findings.findings[0].members
    assert findings.lack_of_fit["after"] < (0.5 if not zero else 0.2) * findings.lack_of_fit["before"]
    assert {f.effect for f in findings.findings} == (
        {"quadratic_damping", "gravity_load"} if zero else {"quadratic_damping"}
    )


def mirrored(table: np.ndarray) -> np.ndarray:
    """Position and torque with the other sign: the same machine seen from behind."""
    return table * [1, -1, -1]


@pytest.mark.parametrize(
    "change", [lambda x: x[::2], mirrored, lambda x: x[: len(x) // 2]], ids=["rate", "mirror", "half"]
)
def test_first_effect_stays_when_the_recording_changes(planted_load: Path, tmp_path: Path, change: Any) -> None:
    """Half the rate, mirrored signs, half the time: the same effect leads, with a coefficient near the planted one."""
    folder = tmp_path / "s"
    shutil.copytree(planted_load, folder)
    for log in sorted((folder / "log").iterdir()):
        table = change(np.loadtxt(log, delimiter=",", skiprows=1))
        np.savetxt(log, table, delimiter=",", header="time,position,torque", comments="", fmt="%.9g")
    first = diagnose_rig(read_session(folder)).findings[0]
    assert first.effect == "load_dependent_friction"
    assert next(v["value"] for k, v in first.parameters.items() if k.startswith("per_")) == pytest.approx(0.25, rel=0.3)


def test_the_start_of_a_recording_is_read_without_bias() -> None:
    """Position and velocity at the ends of a swing let go from rest: zero there, within what the encoder can tell."""
    t = np.arange(0, 10, 0.002)
    values = np.round(np.cos(8 * t) / 1.6e-4) * 1.6e-4
    position, velocity = local_states(values, 500.0)
    assert abs(velocity[0]) < 0.02
    assert abs(position[0] - 1.0) < 1e-4
    assert np.abs(velocity + 8 * np.sin(8 * t))[5:-5].max() < 0.1


def test_noise_floor_of_a_balance_is_that_of_its_sensors(tmp_path: Path) -> None:
    """Where nothing is missing, what is left is noise: the floor says so within a third, and the verdict is
    "consistent"."""
    findings = diagnose_rig(read_session(planted(tmp_path / "s")))
    left = findings.lack_of_fit["joints"]["hinge"]
    assert findings.verdict == "consistent"
    assert left["noise_floor"] == pytest.approx(left["after"], rel=0.35)
    assert findings.lack_of_fit["after"] < findings.lack_of_fit["limit"]


@pytest.mark.slow
def test_shapes_lie_between_those_that_were_tried(tmp_path: Path) -> None:
    """A channel read 13 ms apart: the delay is none of the grid's, and is found to a millisecond."""
    folder = planted(tmp_path / "s")
    for log in (folder / "log").iterdir():
        t, q, torque = np.loadtxt(log, delimiter=",", skiprows=1).T
        late = np.stack([t, q, np.interp(t + 0.013, t, torque)], 1)
        np.savetxt(log, late, delimiter=",", header="time,position,torque", comments="", fmt="%.9g")
    found = diagnose_rig(read_session(folder)).findings[0]
    assert found.effect == "current_channel_delay"
    assert abs(found.parameters["delay"]["value"]) == pytest.approx(0.013, abs=0.001)
