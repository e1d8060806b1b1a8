"""Rigs whose trials differ: own weights and lengths, supplies; what resampled recordings say; intervals of simulated
fits."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_model.effects import DriveState, effect
from hand_model.errors import SessionError
from hand_model.rig import diagnose_rig, fit_declared, load_rig, replay_rig
from hand_model.rig.evidence import multiplicities, weigh
from hand_model.rig.horizon import open_loop
from hand_model.rig.laws import Now, law
from hand_model.rig.mjcf import read_effects, write_effects
from hand_model.rig.name.problem import pose, solution
from hand_model.rig.overrides import apply_overrides, compile_model
from hand_model.rig.proof import Bench
from hand_model.rig.replay import can_simulate
from hand_model.rig.supply import supply_channel, supply_deviation
from hand_model.rig.swing.build import build_swing, can_swing
from hand_model.rig.swing.compete import all_free, compete_swing, fit_stages
from hand_model.rig.swing.fit import Task, fit_together
from hand_model.rig.swing.interval import intervals
from hand_model.rig.swing.patch import write_swing
from hand_model.rig.swing.simulation import INDEX, simulate, vector
from hand_model.session import read_session

BENCH = """<mujoco model="bench"><compiler angle="radian"/><option timestep="0.001" gravity="0 0 -9.81"/>
<worldbody><body name="arm"><joint name="hinge" axis="0 -1 0" armature="0.002" damping="0.01" frictionloss="0.02"/>
<inertial pos="0 0 -0.1" mass="0.5" diaginertia="1e-5 1e-5 1e-5"/></body></worldbody>
<actuator>{drive}</actuator></mujoco>
"""
VOLTAGE = '<dcmotor name="motor" joint="hinge" motorconst="0.35 0.35" resistance="3.4"/>'
TORQUE = '<motor name="motor" joint="hinge"/>'
OWN = 'set = { "body:arm:mass" = 0.9, "body:arm:ipos" = [0, 0, -0.15] }\n'
WEIGHTS = ((0.5, 0.1), (0.9, 0.15), (0.5, 0.1), (0.9, 0.15))


def session(folder: Path, drive: str, column: str, logs: list[np.ndarray], header: str) -> Path:
    """A bench with two weights on two lengths, by turns; the last trial validates."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(BENCH.format(drive=drive))
    quantity = "ctrl" if drive == VOLTAGE else "force"
    text = (
        'format = "hand-session/1"\n[hand]\nname = "bench"\n[rig]\nmodel = "rig.xml"\n[signals]\n'
        f'position = "joint:hinge:position"\n{column} = "actuator:motor:{quantity}"\n'
    )
    for k, table in enumerate(logs):
        np.savetxt(folder / f"log/{k}.csv", table, delimiter=",", header=header, comments="", fmt="%.10g")
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n' + (OWN if k % 2 else "")
        text += 'purpose = "validate"\n' if k == len(logs) - 1 else ""
    (folder / "session.toml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def torque_bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Torque by the true balance; the arm itself weighs 0.05 kg more than declared, at its end, in every trial."""
    logs, t = [], np.arange(0, 8, 0.005)
    for k, (mass, length) in enumerate(WEIGHTS):
        w = 2 * np.pi * (0.5 + 0.1 * k)
        q, v, a = (0.9 * x for x in (np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)))
        moment, inertia = mass * length + 0.05 * 0.1, mass * length**2 + 0.05 * 0.01 + 1e-5 + 0.002
        torque = inertia * a + 9.81 * moment * np.sin(q) + 0.02 * v + 0.03 * np.sign(v)
        logs.append(np.stack([t, q, torque], 1))
    return session(tmp_path_factory.mktemp("weights") / "s", TORQUE, "torque", logs, "time,position,torque")


def test_own_weights_of_trials_are_known_and_the_rest_is_fitted(torque_bench: Path) -> None:
    """One fit to recordings with two weights: the arm's excess moment comes out, and no trial is left unexplained."""
    fit = fit_declared(load_rig(read_session(torque_bench)))
    value = {c.label: t for c, t in zip(fit.columns, fit.theta, strict=True)}
    assert value["inertial:arm:hz"] == pytest.approx(-(0.05 + 0.05 * 0.1), rel=0.01)
    assert max(fit.quality.values()) < 0.03


def test_a_fitted_file_keeps_the_trials_own_weights(torque_bench: Path) -> None:
    """The written file replays trials of both weights as well as the fit does: what was fitted is added to what is
    set."""
    rig = load_rig(read_session(torque_bench))
    fit = fit_declared(rig)
    xml = Bench(rig).file(fit, (), solution(pose(fit), ()))
    replayed = replay_rig(read_session(torque_bench), xml, simulate=False)
    size = {r.trial: np.sqrt(np.mean(r.effort**2)) for r in fit.rows}
    assert all(r.effort_rmse < 0.03 * size[r.trial] for r in replayed.joints)
    moment = [m.body_mass[1] * m.body_ipos[1, 2] for m in (compile_model(replace(rig, xml=xml), t) for t in rig.trials)]
    assert moment == pytest.approx([-(m * x + 0.005) for m, x in WEIGHTS], rel=0.01)


def test_simulated_fit_uses_each_trials_weight_and_covers_the_truth(tmp_path: Path) -> None:
    """Voltage-driven, two weights: inertia, gain and friction return, the truth lies within their intervals, and MuJoCo
    on the written file moves as recorded."""
    truth = vector(
        {"inertia": 0.0085, "gain": 0.13, "back_emf": 0.05, "damping": 0.012, "coulomb": 0.03, "load_gear": 0.1}
    )
    t, random = np.arange(0, 5, 0.002), np.random.default_rng(0)
    volts = [2.5 * np.sin(2.2 * t + k) + 1.5 * np.sin(5.1 * t + 2 * k) for k in range(4)]
    table = [np.stack([t, 0 * t, u], 1) for u in volts]
    blank = session(tmp_path / "blank", VOLTAGE, "voltage", table, "time,position,voltage")
    rig = load_rig(read_session(blank))
    q = simulate(swing := build_swing(rig, fit_declared(rig)), np.repeat(truth[None], 4, 0), np.arange(4))
    assert [lane.more_inertia for lane in swing.lanes[:2]] == pytest.approx([0.0, 0.9 * 0.15**2 - 0.5 * 0.01])
    n = len(q)
    table = [np.stack([t[:n], q[:, k] + 5e-4 * random.standard_normal(n), volts[k][:n]], 1) for k in range(4)]
    folder = session(tmp_path / "s", VOLTAGE, "voltage", table, "time,position,voltage")
    rig = load_rig(read_session(folder))
    swing = build_swing(rig, fit_declared(rig), 2e-3, 1.0)
    free = ("inertia", "gain", "back_emf", "damping", "coulomb", "load_gear")
    fit = fit_together(swing, [Task(free, vector(swing.initial), tuple(swing.train()))], 20)[0]
    assert [fit.theta[INDEX[n]] for n in free] == pytest.approx([truth[INDEX[n]] for n in free], rel=0.1)
    ends = intervals(swing, free, fit.theta)
    assert sum(low <= truth[INDEX[n]] <= high for n, (low, high) in ends.items()) >= len(free) - 1
    replayed = replay_rig(read_session(folder), write_swing(rig, swing, truth), efforts=False)
    assert replayed.figure("position_rmse", True) < 0.05 * np.std(q[:, 3])


def test_a_file_with_friction_by_the_carried_load_moves_as_simulated(tmp_path: Path) -> None:
    """What a joint carries has the inertia of its bodies in it, in MuJoCo on the written file as in our simulation; by
    gravity alone the motion is another."""
    t = np.arange(0, 4, 0.002)
    volts = [2.5 * np.sin(4.2 * t + k) + 1.5 * np.sin(9.1 * t + 2 * k) for k in range(4)]

    def recorded(folder: Path, q: np.ndarray | None = None) -> Path:
        table = [np.stack([t, 0 * t if q is None else q[: len(t), k], u], 1) for k, u in enumerate(volts)]
        return session(folder, VOLTAGE, "voltage", table, "time,position,voltage")

    rig = load_rig(read_session(recorded(tmp_path / "blank")))
    swing = build_swing(rig, fit_declared(rig))
    line = {"inertia": 0.0085, "gain": 0.13, "back_emf": 0.05, "damping": 0.012, "coulomb": 0.02}
    carried, gravity = (vector({**line, name: 0.4}) for name in ("load_carried", "load_external"))
    q = simulate(swing, np.repeat(carried[None], 4, 0), np.arange(4))
    held = read_session(recorded(tmp_path / "s", np.pad(q, ((0, len(t) - len(q)), (0, 0)), "edge")))
    left = [
        replay_rig(held, write_swing(rig, swing, theta), efforts=False).figure("position_rmse", True)
        for theta in (carried, gravity)
    ]
    assert left[0] < 0.03 * np.std(q[:, 3]) < 0.5 * left[1]


def test_overrides_reach_what_mjcf_names() -> None:
    """Scalars of option, servo gains, references; what the model lacks, or cannot take, is refused by name."""
    import mujoco

    servo = BENCH.format(drive='<position name="motor" joint="hinge" kp="10"/>')
    model = mujoco.MjModel.from_xml_string(servo)
    apply_overrides(
        model,
        {"option:timestep": 0.002, "actuator:motor:kp": 7.0, "joint:hinge:damping": 0.5, "option:gravity": [0, 0, 0]},
    )
    assert model.opt.timestep == 0.002 and model.actuator_gainprm[0, 0] == 7.0 and model.actuator_biasprm[0, 1] == -7.0
    assert model.dof_damping[0] == 0.5 and not model.opt.gravity.any()
    for key, value in (("body:leg:mass", 1.0), ("joint:hinge:mass", 1.0), ("option:gravity", [0, 0])):
        with pytest.raises(SessionError, match=key):
            apply_overrides(model, {key: value})


def test_supply_is_relative_to_the_session(torque_bench: Path) -> None:
    """Two recordings at 7 V and 8 V deviate to either side of their mean; a session without a supply has none."""
    rig = load_rig(read_session(torque_bench))
    assert supply_channel(rig) is None and not supply_deviation(rig, rig.trials[0]).any()
    own = [
        replace(t, extra={"input_volts": np.full(len(t.time_s), v)})
        for t, v in zip(rig.trials[:2], (7.0, 8.0), strict=True)
    ]
    rig = replace(rig, trials=tuple(own))
    assert [supply_deviation(rig, t)[0] for t in rig.trials] == pytest.approx([-1 / 15, 1 / 15])


def test_whole_recordings_are_drawn_where_there_are_enough() -> None:
    """All blocks of a recording come together, and every draw has as many recordings as there are."""
    group = np.repeat(np.arange(8), 3)
    draws = multiplicities(group)
    assert (draws.reshape(len(draws), 8, 3).std(2) == 0).all() and (draws.sum(1) == len(group)).all()
    assert multiplicities(np.repeat([0, 1], 5)).reshape(-1, 2, 5).std(2).any()


def test_evidence_takes_the_simplest_of_equals_and_nothing_from_noise() -> None:
    """A rival that helps one recording alone is no evidence; of two as good as each other the smaller is chosen."""
    group, none = np.repeat(np.arange(8), 4), np.ones(32)
    lucky = np.where(group == 0, 0.1, 1.0 + 0.01 * (-1.0) ** np.arange(32))
    assert weigh(none, np.array([lucky]), [1], group) is None
    noise = 0.05 * np.array([np.tile([1, -1, -1, 1], 8), np.tile([-1, 1, 1, -1], 8)])
    said = weigh(none, np.array([0.5, 0.5])[:, None] + noise, [3, 1], group)
    assert said.chosen == 1 and said.probability == 1.0 and set(said.close) == {0, 1}


SIZE = {
    "asymmetric_friction": 0.3,
    "asymmetric_viscous_friction": -0.2,
    "quadratic_damping": 0.1,
    "stribeck_friction": 0.4,
    "elastoplastic_hysteresis": 0.7,
    "nonlinear_spring": 0.5,
    "end_stop_contact": 2.0,
    "torque_ripple": 0.3,
    "detent_load": 0.6,
}


@pytest.mark.parametrize("name", SIZE)
def test_law_in_open_loop_is_the_column_along_the_path(name: str) -> None:
    """Step by step along a recorded path, an effect's effort (friction by the motion's direction) is that of its
    columns."""
    t = np.arange(0, 6, 0.002)
    q, v = np.sin(1.7 * t) + 0.4 * np.sin(4.1 * t), 1.7 * np.cos(1.7 * t) + 1.64 * np.cos(4.1 * t)
    state = DriveState("", "", t, q, v, 0 * t, 0 * t, np.sign(v)[:, None], "rad", "N m", {}, ("coulomb",))
    if name == "asymmetric_friction":
        columns, names, shape = np.ones((len(t), 1)), ["offset"], {}
    else:
        shape = effect(name).grid((state,))[-1]
        columns, names = effect(name).columns(state, shape), [a[0] for a in effect(name).amplitudes()]
    act = law(
        {
            "effect": name,
            "variant": "",
            "shape": shape,
            "amplitude": {n: SIZE[name] * (k + 1) for k, n in enumerate(names)},
        }
    )
    done = [act(Now(a, b, 0.0, 0.0)) for a, b in zip(q, v, strict=True)]
    effort = np.array([e + f * np.sign(b) for (e, f), b in zip(done, v, strict=True)])
    wanted = columns @ (SIZE[name] * (1 + np.arange(len(names))))
    assert np.abs(effort - wanted).max() < 0.02 * np.abs(wanted).max()


def test_law_by_load_and_what_has_none() -> None:
    """Friction by load is a bound that never turns over; an effect that needs its past in another form is not
    simulated."""
    now = Now(0.1, -2.0, -3.0, 4.0)
    record = {"effect": "load_dependent_friction", "amplitude": {"per": 0.5}, "shape": {"stribeck_speed": 2.0}}
    known = {"": (0.0, 1.5), "motor side": (0.0, 2.0), "low speed": (0.0, 1.5 / np.e), "with speed": (-3.0, 0.0)}
    for variant, expected in known.items():
        assert law({**record, "variant": variant})(now) == pytest.approx(expected)
    assert law({"effect": "viscoelastic_spring"}) is None


def test_motion_in_open_loop_falls_with_what_was_found(torque_bench: Path) -> None:
    """The same recordings with an offset of the drive: the file that has it predicts whole trials, the declared one
    worse; a trial whose torque is refused takes no part."""
    rig = load_rig(read_session(torque_bench))
    rig = replace(rig, trials=tuple(replace(t, effort={"hinge": t.effort["hinge"] + 0.05}) for t in rig.trials))
    fit = fit_declared(rig)
    theta = solution(pose(fit), ())
    before = Bench(rig).file(fit, (), theta)
    after = write_effects(
        before,
        [
            *read_effects(before),
            {
                "effect": "asymmetric_friction",
                "variant": "",
                "joint": "hinge",
                "shape": {},
                "amplitude": {"offset": 0.05},
            },
        ],
    )
    told = open_loop(rig, before, after)
    assert told["held_out"] == ["log/3.csv"] and told["ratio"] < 0.6
    assert "not_run" in open_loop(rig, before, after, {("log/3.csv", "hinge")})


def test_effort_recorded_of_a_voltage_drive_is_the_effort(tmp_path: Path, torque_bench: Path) -> None:
    """A current, scaled to torque, beside a motor that the file drives by voltage: balance and replay use it as it is,
    and no back-EMF is fitted; a trial without any drive channel is not simulated."""
    folder = tmp_path / "s"
    shutil.copytree(torque_bench, folder)
    (folder / "rig.xml").write_text(BENCH.format(drive=VOLTAGE))
    log = folder / "log/0.csv"
    log.write_text(log.read_text().replace("torque", "unnamed", 1))
    rig = load_rig(read_session(folder))
    fit, plain = fit_declared(rig), fit_declared(load_rig(read_session(torque_bench)))
    assert not can_swing(rig) and "back_emf:motor" not in [c.label for c in fit.columns]
    assert [can_simulate(rig, t) for t in rig.trials] == [False, True, True, True]
    xml = [
        Bench(load_rig(read_session(f))).file(x, (), solution(pose(x), ()))
        for f, x in ((folder, fit), (torque_bench, plain))
    ]
    told = [
        replay_rig(read_session(f), x, validate=True).joints[0]
        for f, x in zip((folder, torque_bench), xml, strict=True)
    ]
    assert told[0].effort_rmse == pytest.approx(told[1].effort_rmse, rel=0.5) and told[0].position_rmse < 0.1
    assert np.isnan(replay_rig(read_session(folder), efforts=False, validate=False).joints[0].position_rmse)


@pytest.mark.slow
def test_the_form_of_a_friction_by_load_is_the_one_that_was_planted(tmp_path: Path) -> None:
    """Friction by the gear's load, by what the joint carries with its inertia, or by the square of the load that the motor
    drives at low speed: the first effect is it, in that form, and explains the recordings down to their noise."""
    t = np.arange(0, 5, 0.002)
    volts = [2.5 * np.sin(2.2 * t + k) + 1.5 * np.sin(5.1 * t + 2 * k) for k in range(4)]
    folder = session(
        tmp_path / "s", VOLTAGE, "voltage", [np.stack([t, 0 * t, u], 1) for u in volts], "time,position,voltage"
    )
    blank = build_swing(rig := load_rig(read_session(folder)), fit_declared(rig), 4e-3, 1.0)
    line = {"inertia": 0.0085, "gain": 0.13, "back_emf": 0.05, "damping": 0.012, "coulomb": 0.02}
    noise = 1e-3 * np.random.default_rng(0).standard_normal((3, len(blank.lanes), len(t)))
    forms = ({"load_gear": 0.1}, {"external_squared": 0.6, "stribeck_speed": 1.5}, {"load_carried": 0.2})
    for planted, form, e in zip(forms, ("gear", "squared", "carried"), noise, strict=True):
        q = simulate(
            blank, np.repeat(vector({**line, **planted})[None], len(blank.lanes), 0), np.arange(len(blank.lanes))
        )
        lanes = tuple(
            replace(lane, position=q[: len(lane.position), k] + e[k, : len(lane.position)])
            for k, lane in enumerate(blank.lanes)
        )
        swing = replace(blank, lanes=lanes)
        declared = fit_stages([swing], [Task(all_free(swing, []), vector(line), ())], 12)[0]
        first, round_ = compete_swing([swing], declared, 2e-3)[0]
        assert first.effect == "load_dependent_friction" and form in first.name
        assert round_.fit.cost < 1.1e-6


COUPLED = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/><worldbody>
  <body name="a"><joint name="a" axis="0 0 1" damping="0.01" frictionloss="0.03"/>
   <inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/></body>
  <body name="b" pos="0 0 0.2"><joint name="b" axis="0 0 1"/>
   <inertial pos="0 0 0" mass="0.01" diaginertia="1e-5 1e-5 1e-5"/></body></worldbody>
  <equality><joint name="cable" joint1="b" joint2="a" polycoef="0 0.9 0 0 0"/></equality>
  <actuator><motor name="m" joint="a"/><motor name="l" joint="b"/></actuator></mujoco>"""
BOTH_ENDS = """format = "hand-session/1"
[hand]
name = "cable"
[rig]
model = "rig.xml"
[signals]
near = "joint:a:position"
far = "joint:b:position"
drive = "actuator:m:force"
load = "actuator:l:force"
"""


@pytest.mark.slow
def test_lost_motion_between_encoders_makes_no_load(tmp_path: Path) -> None:
    """Play of 0.03 rad between two encoders is found with its size, and nothing is named of the efforts, which are
    healthy: the polynomial that projects them has not bent to the play."""
    (tmp_path / "log").mkdir()
    (tmp_path / "rig.xml").write_text(COUPLED)
    text, random = BOTH_ENDS, np.random.default_rng(1)
    for k in range(5):
        t = np.arange(0, 15, 0.005)
        w, size, phase = (
            2 * np.pi * random.uniform([0.15, 0.4], [0.35, 0.9]),
            random.uniform([0.4, 0.1], [0.7, 0.2]),
            random.uniform(0, 6, 2),
        )
        near, speed, acceleration = (
            sum(s * w_**d * np.sin(w_ * t + p + d * np.pi / 2) for s, w_, p in zip(size, w, phase, strict=True))
            for d in range(3)
        )
        far, slack = np.empty(len(t)), near[0]
        for i, q in enumerate(near):
            slack = min(max(slack, q - 0.015), q + 0.015)
            far[i] = 0.9 * slack
        load = -(0.1 + 0.05 * k + 0.15 * np.sin(2 * np.pi * 0.23 * (1 + 0.2 * k) * t + k))
        drive = 1e-3 * acceleration + 0.015 * speed + 0.04 * np.sign(speed) - 0.9 * load
        noise = 2e-3 * random.standard_normal((2, len(t)))
        table = np.stack([t, *(np.round(x / 2e-4) * 2e-4 for x in (near, far)), drive + noise[0], load + noise[1]], 1)
        np.savetxt(
            tmp_path / f"log/{k}.csv", table, delimiter=",", header="time,near,far,drive,load", comments="", fmt="%.8g"
        )
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n' + ('purpose = "validate"\n' if k == 4 else "")
    (tmp_path / "session.toml").write_text(text)
    found = diagnose_rig(read_session(tmp_path)).findings
    assert [(f.effect, f.where["joint"]) for f in found] == [("drive_backlash", "b")]
    assert abs(found[0].parameters["half_gap"]["value"]) == pytest.approx(0.9 * 0.015, rel=0.05)
