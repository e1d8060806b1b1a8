"""Rigs: known truths planted into recordings made here, and the published machines where they are at hand."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rig_bench import HEAD

from hand_model.errors import DescriptionError, SessionError
from hand_model.report.rig_findings import write_rig_findings
from hand_model.rig import diagnose_rig, fit_declared, load_rig, replay_rig
from hand_model.rig.balance import Column
from hand_model.rig.consistent import BASIS, consistent, is_physical, pseudo_inertia
from hand_model.rig.dynamics import INERTIAL, inertial_columns, inertial_parameters
from hand_model.rig.findings import NOT_BORNE_OUT, NOT_TAKEN
from hand_model.rig.mjcf import read_effects, write_effects
from hand_model.rig.name.candidates import Candidate
from hand_model.rig.physical import physical
from hand_model.rig.solve import solve_bounded
from hand_model.rig.standing import _joint_finding
from hand_model.rig.states import local_states
from hand_model.rig.swing.fit import Task, fit_together
from hand_model.rig.swing.simulation import Lane, Swing, errors, simulate, vector
from hand_model.rig.words import alternatives, joint_unit, rejection, shape_unit, statement
from hand_model.session import read_session

REAL = Path(__file__).resolve().parents[2] / "shared" / "real"

PENDULUM = """<mujoco model="rig">
  <compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
  <worldbody><body name="arm">
    <joint name="hinge" axis="0 -1 0" damping="0.02" frictionloss="0.05"/>
    <inertial pos="0 0 -0.2" mass="0.5" diaginertia="0.002 0.002 0.0001"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""
MASS, LEVER, INERTIA = 0.6, 0.2, 0.6 * 0.04 + 0.002


def planted(folder: Path, effect: str = "none", trials: int = 4, seconds: float = 12.0) -> Path:
    """A pendulum moved along sums of sinusoids; its torque by the true balance (mass 0.6, not 0.5), with an effect or
    none."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(PENDULUM)
    text, random = HEAD, np.random.default_rng(3)
    for k in range(trials):
        t = np.arange(0, seconds, 0.005)
        w = 2 * np.pi * np.array([0.31, 0.83]) * (1 + 0.13 * k)
        size, phase = np.array([0.7, 0.35]) * random.uniform(0.7, 1.3, 2), random.uniform(0, 6, 2)
        q, v, a = (sum(f(s, w_, t, p) for s, w_, p in zip(size, w, phase, strict=True)) for f in (
            lambda s, w_, t, p: s * np.sin(w_ * t + p), lambda s, w_, t, p: s * w_ * np.cos(w_ * t + p),
            lambda s, w_, t, p: -s * w_**2 * np.sin(w_ * t + p)))  # fmt: skip
        load = INERTIA * a + MASS * LEVER * 9.81 * np.sin(q)
        torque = load + 0.03 * v + 0.08 * np.sign(v)
        torque += {"stribeck": 0.06 * np.exp(-((v / 0.4) ** 2)) * np.sign(v), "none": 0 * t, "load": 0.25 * np.abs(load) * np.sign(v), "drag": 0.02 * v * np.abs(v), "offset": 0 * t + 0.15,
                   "command": 0 * t, "dead": 0 * t, "unsigned": 0 * t}[effect]  # fmt: skip
        torque = {"command": 0.5 * np.sin(2.1 * t), "dead": 0 * t + 0.3, "unsigned": np.abs(torque)}.get(effect, torque)
        noise = 0 if effect in ("command", "dead") else 0.01
        table = np.stack([t, np.round(q / 4e-4) * 4e-4, torque + noise * random.standard_normal(len(t))], 1)
        name = f"log/run_{k}.csv"
        np.savetxt(folder / name, table, delimiter=",", header="time,position,torque", comments="", fmt="%.9g")
        text += f'[[trial]]\nkind = "motion"\nlog = "{name}"\n' + ('purpose = "validate"\n' if k == trials - 1 else "")
    (folder / "session.toml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def planted_load(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with load-dependent friction in it."""
    return planted(tmp_path_factory.mktemp("load") / "session", "load")


TREE = """<mujoco><compiler angle="radian"/><option gravity="0.3 -1 -9.81"/><worldbody>
  <body name="a" pos="0.1 0 0.2" quat="0.9 0.1 0.3 0.2"><joint name="a" axis="0.3 1 0.2" pos="0.02 0.01 -0.03"/>
   <inertial pos="0.1 0.05 -0.2" mass="1.3" fullinertia="0.02 0.03 0.025 0.001 0.002 -0.003"/>
   <body name="b" pos="0 0.1 -0.3"><joint name="b" type="slide" axis="1 0.2 0"/>
    <inertial pos="0.02 0 0.1" mass="0.7" diaginertia="0.01 0.012 0.008"/>
    <body name="c" pos="0.1 0 0"><joint name="c" axis="0 0 1" pos="0 0.05 0"/>
     <inertial pos="0 0.1 0" mass="0.4" diaginertia="0.002 0.001 0.002"/></body></body></body></worldbody></mujoco>"""


def test_regressor_is_mujocos_inverse_dynamics() -> None:
    """Hinges with offset anchors, a slide, turned frames, tilted gravity: columns x parameters = mj_inverse."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(TREE)
    data = mujoco.MjData(model)
    q, v, a = np.random.default_rng(1).normal(size=(3, 6, model.nv))
    effort = np.einsum(
        "njbp,bp->nj", inertial_columns(model, q, v, a, np.array(model.opt.gravity)), inertial_parameters(model)
    )
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[i], v[i], a[i]
        mujoco.mj_inverse(model, data)
        assert np.allclose(effort[i], data.qfrc_inverse, atol=1e-12)


def test_bounded_solution_meets_the_optimality_conditions() -> None:
    """Inside the box the gradient vanishes; on a bound it points outwards."""
    random = np.random.default_rng(0)
    for _ in range(20):
        x, y = random.normal(size=(40, 6)), random.normal(size=40) * 3
        low, high = np.array([0, 0, -np.inf, 0, -1, 0.0]), np.full(6, np.inf)
        theta = solve_bounded(x.T @ x, x.T @ y, low, high, np.zeros(6), np.zeros(6))
        slope = x.T @ (x @ theta - y)
        assert np.all(theta >= low - 1e-12)
        free = theta > low + 1e-9
        assert np.all(np.abs(slope[free]) < 1e-6 * np.abs(x.T @ y).max())
        assert np.all(slope[~free] > -1e-6)


def test_physical_keeps_what_is_physical_and_mends_what_is_not() -> None:
    """A true body comes back as it is; an impossible inertia becomes one with positive, triangular principal
    moments."""
    mass, centre, inertia = 2.0, np.array([0.1, -0.2, 0.3]), np.diag([0.3, 0.4, 0.5])
    about = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    p = np.array([mass, *(mass * centre), about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2]])
    back = physical(p)
    assert back[0] == mass and np.allclose(back[1], centre) and np.allclose(back[2], inertia)
    p[4] -= 1.0
    level = np.linalg.eigvalsh(physical(p)[2])
    assert level[0] > 0 and level[2] <= level[0] + level[1] + 1e-9


def test_declared_fit_finds_the_true_weight_and_friction(tmp_path: Path) -> None:
    """Mass moment, damping and Coulomb friction of a planted pendulum within two per cent."""
    fit = fit_declared(load_rig(read_session(planted(tmp_path / "s"))))
    value = {c.label: t for c, t in zip(fit.columns, fit.theta, strict=True)}
    assert value["inertial:arm:hz"] == pytest.approx(-MASS * LEVER, rel=0.02)
    assert value["frictionloss:hinge"] == pytest.approx(0.08, rel=0.05)
    assert value["damping:hinge"] == pytest.approx(0.03, rel=0.1)


@pytest.mark.parametrize(("effect", "name"), [("drag", "quadratic_damping"), ("offset", "asymmetric_friction"),
                                              ("stribeck", "stribeck_friction")])  # fmt: skip
def test_planted_effects_are_named_first(tmp_path: Path, effect: str, name: str) -> None:
    """What was planted leads the list, or is in its class, and the held-out error falls by a fifth or more."""
    findings = diagnose_rig(read_session(planted(tmp_path / "s", effect)))
    assert findings.verdict == "mismatch"
    assert name in findings.findings[0].members
    assert findings.lack_of_fit["after"] < 0.8


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


def test_simulation_agrees_with_mujoco(tmp_path: Path) -> None:
    """A free pendulum with friction: the batch simulator and MuJoCo's replay of the written file are the same
    motion."""
    text = (PENDULUM.replace('<actuator><motor name="motor" joint="hinge"/></actuator>', "")
            .replace('frictionloss="0.05"', 'frictionloss="0.02"'))  # fmt: skip
    (tmp_path / "log").mkdir()
    (tmp_path / "rig.xml").write_text(text)
    inertia, weight = 0.022, 0.5 * 0.2 * 9.81
    n = 2500
    lane = Lane("x", False, np.zeros(n), 1.0, np.zeros(n), (1.0, 0.0), np.zeros(n), np.ones(n))
    swing = Swing((lane,), weight, 0.0, {"inertia": inertia, "damping": 0.02, "coulomb": 0.02}, False)
    theta = vector(swing.initial)
    q = simulate(swing, theta[None], np.array([0]))[:, 0]
    table = np.stack([np.arange(n) * 2e-3, q], 1)
    np.savetxt(tmp_path / "log/a.csv", table, delimiter=",", header="time,position", comments="", fmt="%.12g")
    (tmp_path / "session.toml").write_text(
        HEAD.replace('torque = "actuator:motor:force"\n', "") + '[[trial]]\nkind = "motion"\nlog = "log/a.csv"\n'
    )
    residuals = replay_rig(read_session(tmp_path))
    assert residuals.figure("position_rmse", False) < 0.02 * np.std(q)


def test_output_error_fit_returns_to_the_truth() -> None:
    """Inertia, damping, friction and drag of a simulated swing, from a wrong start."""
    n = 2000
    lane = Lane("x", False, np.zeros(n), 1.0, np.zeros(n), (1.2, 0.0), np.zeros(n), np.ones(n))
    swing = Swing((lane,), 1.0, 0.0, {"inertia": 0.02, "damping": 0.01, "coulomb": 0.01}, False)
    truth = vector({"inertia": 0.022, "damping": 0.004, "coulomb": 0.006, "drag": 0.001})
    recorded = simulate(swing, truth[None], np.array([0]))[:, 0]
    swing = Swing(
        (Lane("x", False, lane.drive, 1.0, recorded, lane.start, lane.supply, lane.used),),
        1.0,
        0.0,
        swing.initial,
        False,
    )
    fit = fit_together(swing, [Task(("inertia", "damping", "coulomb", "drag"), vector(swing.initial), (0,))], 40)[0]
    assert np.abs(errors(swing, fit.theta[None], np.array([0]))).max() < 5e-3
    assert fit.theta[0] == pytest.approx(0.022, rel=1e-3)


def test_effects_in_the_file_are_replaced_not_piled_up() -> None:
    """Writing effects twice keeps one entry; writing none removes it."""
    once = write_effects(PENDULUM.encode(), [{"joint": "hinge", "swing": {"sag": 0.1}}])
    twice = write_effects(once, [{"joint": "hinge", "swing": {"sag": 0.2}}])
    assert read_effects(twice) == [{"joint": "hinge", "swing": {"sag": 0.2}}]
    assert read_effects(write_effects(twice, [])) == []


@pytest.mark.parametrize(("old", "new", "says"), [
    ('"joint:hinge:position"', '"joint:hing:position"', 'did you mean "hinge"'),
    ('"joint:hinge:position"', '"joint:hinge:posture"', "position"),
    ('"actuator:motor:force"', '"motor.force"', "valid"),
    ('position = "joint', 'angle = "joint', 'no column "angle"'),
])  # fmt: skip
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
    manifest, n = HEAD.replace('torque = "actuator:motor:force"\n', ""), 2500
    truth = vector({"inertia": 0.0225, "damping": 0.001, "coulomb": 0.004, "drag": 0.004})
    for k, start in enumerate((1.4, 0.8)):
        lane = Lane("x", False, np.zeros(n), 1.0, np.zeros(n), (start, 0.0), np.zeros(n), np.ones(n))
        swing = Swing((lane,), 0.981, 0.0, {"inertia": 0.022, "damping": 0.004, "coulomb": 0.004}, False)
        q = np.round((zero + simulate(swing, truth[None], np.array([0]))[:, 0]) / 2e-4) * 2e-4
        np.savetxt(tmp_path / f"log/{k}.csv", np.stack([np.arange(n) * 2e-3, q], 1), delimiter=",", header="time,position",
                   comments="", fmt="%.9g")  # fmt: skip
        manifest += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n'
    (tmp_path / "session.toml").write_text(manifest)
    findings = diagnose_rig(read_session(tmp_path))
    assert "quadratic_damping" in findings.findings[0].members
    assert findings.lack_of_fit["after"] < (0.5 if not zero else 0.2) * findings.lack_of_fit["before"]
    assert {f.effect for f in findings.findings} == (
        {"quadratic_damping", "gravity_load"} if zero else {"quadratic_damping"}
    )


def test_bodies_of_a_solution_can_exist() -> None:
    """Where least squares asks for a negative moment of inertia, the constrained solution has none, and fits no worse
    than any physical body drawn at random; a solution that is physical already comes back untouched."""
    declared = np.array([1.0, 0, 0, -0.3, 0.15, 0.15, 0.02, 0, 0, 0])
    free = [i for i, v in enumerate(declared) if v]
    columns = tuple(Column("inertial", "arm", INERTIAL[i], declared[i]) for i in free)
    random = np.random.default_rng(4)
    x = random.normal(size=(60, len(free)))
    box = np.full(len(free), -np.inf), np.full(len(free), np.inf), np.zeros(len(free)), np.full(len(free), 1e-9)
    for wrong, physical_ in ((0.0, True), (0.3, False)):
        wanted = declared[free] - wrong * np.eye(len(free))[2]
        theta = consistent(columns, declared[None], wanted, x.T @ x, x.T @ (x @ wanted), *box)
        full = declared.copy()
        full[free] = theta
        assert is_physical(full)
        if physical_:
            assert np.array_equal(theta, wanted)
            continue
        cost = np.sum((x @ (theta - wanted)) ** 2)
        for _ in range(200):
            other = full.copy()
            other[free] = theta * (1 + 0.05 * random.normal(size=len(free)))
            if is_physical(other):
                assert np.sum((x @ (other[free] - wanted)) ** 2) >= cost * (1 - 1e-6)


def test_pseudo_inertia_is_linear_in_the_parameters() -> None:
    """The sum of its basis, and symmetric."""
    p = np.random.default_rng(0).normal(size=10)
    assert np.allclose(np.einsum("k,kij->ij", p, BASIS), pseudo_inertia(p))
    assert np.allclose(pseudo_inertia(p), pseudo_inertia(p).T)


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


def test_a_rigs_findings_say_names_and_units_as_the_format_has_them() -> None:
    """Names of the table of effects, units of the joint, variants beside them."""
    assert joint_unit("effort s/position", "rad", "N m") == "N m s/rad"
    assert joint_unit("rad/effort^2", "rad", "N m") == "rad/(N m)^2"
    assert joint_unit("effort", "m", "N") == "N"
    assert [shape_unit(n, "m") for n in ("reach", "stribeck_speed", "delay", "form")] == ["m", "m/s", "s", "1"]
    rivals = [
        ("detent_load/a@hinge", 0.3),
        ("detent_load@hinge", 0.5),
        ("torque_ripple@hinge", 0.1),
        ("stribeck_friction/b@hinge", 0.1),
    ]
    assert alternatives(rivals, "stribeck_friction") == (("detent_load", 0.5), ("torque_ripple", 0.1))
    assert rejection("load_dependent_friction/low speed@hinge", NOT_TAKEN) == {
        "effect": "load_dependent_friction", "variant": "low speed", "where": "hinge", "reason": NOT_TAKEN}  # fmt: skip
    values = {
        "drag": {"value": 0.5, "unit": "N s^2/m^2"},
        "form": {"value": 0.0, "unit": "1"},
        "ratio": {"value": 2.0, "unit": "1"},
    }
    said = statement(
        "quadratic_damping", "", "slide", values, {"metric": "effort_rmse", "before": 2.0, "after": 1.0, "unit": "N"}
    )
    assert said == "slide: quadratic damping: drag 0.5 N s^2/m^2, ratio 2; held-out effort rmse falls from 2 to 1 N."


@pytest.mark.parametrize(("effect", "told"), [("command_delay", 0.02), ("current_channel_delay", -0.02)])
def test_a_late_drive_has_a_positive_delay(effect: str, told: float) -> None:
    """As in the findings of a hand: a drive acts later than told; a channel recorded ahead is early."""
    rig = SimpleNamespace(unit=lambda j: "rad", effort_unit=lambda j: "N m", drive=lambda j: None)
    candidate = Candidate(effect, "", "hinge", (), ({"delay": -0.02},), lambda r, s: np.zeros((0, 0)), True)
    proof = {"metric": "effort_rmse", "unit": "N m", "before": 2.0, "after": 1.0, "held_out": ["log/b.csv"]}
    step = SimpleNamespace(rivals=(), equals=(), probability=0.9)
    found = _joint_finding(
        rig, None, step, SimpleNamespace(candidate=candidate, shape={"delay": -0.02}), np.zeros(0), proof, None
    )
    assert found.parameters["delay"] == {"value": told, "unit": "s", "ci95": None}
    assert f"delay {told} s" in found.statement
    assert found.where["region"] is None and found.where["finger"] is None


def test_report_of_a_rig_shows_what_was_found(planted_load: Path, tmp_path: Path) -> None:
    """One page with the map, the effect through the data, before and after; without outside resources."""
    session = read_session(planted_load)
    rejected = (
        rejection("stribeck_friction@hinge", NOT_BORNE_OUT),
        rejection("detent_load/of a kind@hinge", NOT_TAKEN),
    )
    findings = replace(diagnose_rig(session), rejected=rejected)
    page = write_rig_findings(session, findings, tmp_path / "out").read_text()
    assert (
        "then withdrawn" in page
        and f"stribeck friction at hinge: {NOT_BORNE_OUT}" in page
        and "not taken: detent load (of a kind)." in page
    )
    for anchor in ('id="findings"', 'id="map"', 'id="effects"', 'id="validation"', "load dependent friction"):
        assert anchor in page
    assert "http://" not in page.replace("http://www.w3.org", "")


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
