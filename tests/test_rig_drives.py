"""Drives as each recording sets them, and efforts that stand on a limit of their reading."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, Motion, balance, recorded

from hand_model.rig import diagnose_rig, fit_declared, load_rig
from hand_model.rig.channels import check_channels
from hand_model.rig.clipping import limits, unclipped
from hand_model.rig.diagnose import trusted_fit
from hand_model.rig.glitches import glitches
from hand_model.rig.model import RigTrial
from hand_model.session import read_session

pytest.importorskip("mujoco")

MOTOR = '<motor name="motor" joint="hinge"/>'


def heavier(motion: Motion) -> np.ndarray:
    """Torque [N m] of the arm with another mass than declared."""
    return balance(motion, 0.6)


def set_in(folder: Path, values: list[str]) -> Path:
    """The session with an override of each of its recordings."""
    head, *trials = (folder / "session.toml").read_text().split("[[trial]]")
    trials = [f"{text}set = {{ {value} }}\n" for text, value in zip(trials, values, strict=True)]
    (folder / "session.toml").write_text("[[trial]]".join([head, *trials]))
    return folder


def mass_of(folder: Path) -> float:
    """First moment that the balance finds over the lever [kg]."""
    fit = fit_declared(load_rig(read_session(folder)))
    return next(
        -float(t) / 0.2 for c, t in zip(fit.columns, fit.theta, strict=True) if (c.kind, c.part) == ("inertial", "hz")
    )


@pytest.mark.parametrize("quantity", ["setpoint", "ctrl"])
def test_a_servo_on_position_has_the_gain_that_each_recording_sets(tmp_path: Path, quantity: str) -> None:
    gains, number = [2.0, 4.0, 2.0, 4.0, 3.0], iter(range(5))
    servo = ARM.replace(MOTOR, '<position name="motor" joint="hinge" kp="1.5" kv="0.1" gear="2"/>')

    def target(motion: Motion) -> np.ndarray:
        # gear (kp (target - gear q) - kv gear v) is what the arm takes
        kp = gains[next(number)]
        return 2 * motion[1] + (heavier(motion) / 2 + 0.1 * 2 * motion[2]) / kp

    folder = recorded(tmp_path / "s", servo, 5, target, 1e-4)
    text = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(text.replace("actuator:motor:force", f"actuator:motor:{quantity}"))
    set_in(folder, [f'"actuator:motor:kp" = {kp}' for kp in gains])
    assert mass_of(folder) == pytest.approx(0.6, rel=0.01)


def test_a_force_acts_through_the_gear_that_its_recording_sets(tmp_path: Path) -> None:
    gears, number = [1.0, 2.0, 1.0, 2.0, 1.5], iter(range(5))
    folder = recorded(tmp_path / "s", ARM, 5, lambda m: heavier(m) / gears[next(number)], 1e-3)
    set_in(folder, [f'"actuator:motor:gear" = {gear}' for gear in gears])
    assert mass_of(folder) == pytest.approx(0.6, rel=0.01)


@pytest.mark.parametrize(("low", "high", "said"), [(-np.inf, 0.5, "one way alone"), (-0.6, 0.6, "the same both ways")])
def test_what_stands_on_a_limit_is_in_no_fit(tmp_path: Path, low: float, high: float, said: str) -> None:
    def clipped(motion: Motion) -> np.ndarray:
        noise = 0.01 * np.random.default_rng(1).standard_normal(len(motion[0]))
        return np.clip(heavier(motion) + noise, low, high)

    folder = recorded(tmp_path / "s", ARM, 5, clipped, 0.0)
    findings = diagnose_rig(read_session(folder))
    assert [f.effect for f in findings.findings] == ["current_saturation"] and findings.verdict == "mismatch"
    assert said in findings.findings[0].statement
    assert findings.findings[0].where["share_of_mismatch"] > 0.45  # of what the motion asked for beyond the limits
    assert -findings.declared["inertial:arm:hz"] / 0.2 == pytest.approx(0.6, rel=0.01)
    assert findings.declared["frictionloss:hinge"] == pytest.approx(0.05, rel=0.1)


def test_an_effort_that_reaches_its_extreme_as_any_other_value_is_not_clipped(tmp_path: Path) -> None:
    def coarse(motion: Motion) -> np.ndarray:
        return 0.05 * np.round((heavier(motion) + 0.01 * np.sin(50 * motion[0])) / 0.05)

    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 5, coarse, 0.0)))
    assert check_channels(rig) == () and not np.isfinite([limits(t, "hinge") for t in rig.trials]).any()
    assert not any(t.clipped for t in unclipped(rig).trials)


def test_a_limit_of_one_recording_is_one_in_all(tmp_path: Path) -> None:
    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 5, lambda m: np.minimum(heavier(m), 0.5), 0.0)))
    first, last = rig.trials[0], rig.trials[-1]
    moment = np.where(np.arange(len(last.time_s)) < 40, 0.5, np.minimum(last.effort["hinge"], 0.45))
    brief = replace(last, effort={"hinge": moment})
    left = unclipped(replace(rig, trials=(first, brief)))
    assert np.flatnonzero(left.trials[1].clipped["hinge"]).tolist() == list(range(40))


def test_a_reading_that_clips_at_its_peaks_alone_stands_on_its_limits(tmp_path: Path) -> None:
    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 5, heavier, 0.003)))
    most = [float(np.quantile(np.abs(t.effort["hinge"]), 0.98)) for t in rig.trials]
    limit = max(most)  # in most recordings nothing comes near
    trials = tuple(replace(t, effort={"hinge": np.clip(t.effort["hinge"], -limit, limit)}) for t in rig.trials)
    cut = unclipped(replace(rig, trials=trials))
    assert 0 < sum(np.sum(t.clipped["hinge"]) for t in cut.trials) < 0.02 * sum(len(t.time_s) for t in rig.trials)
    assert [i.kind for i in check_channels(replace(rig, trials=trials))] == ["current_saturation"]
    assert not any(t.clipped for t in unclipped(rig).trials)


def test_a_copy_of_its_command_is_refused_for_that_alone(tmp_path: Path) -> None:
    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 5, lambda m: np.clip(heavier(m), -0.5, 0.5), 0.0)))
    trials = tuple(replace(t, extra={"asked": t.effort["hinge"]}) for t in rig.trials)
    assert [i.kind for i in check_channels(rig)] == ["current_saturation"]
    assert {i.kind for i in check_channels(replace(rig, trials=trials))} == {"command_as_measurement"}


@pytest.mark.parametrize(("late_s", "kinds"), [(0.3, ["command_as_measurement"]), (0.0, [])])
def test_what_a_controller_asks_for_is_refused_where_the_drive_does_not_give_it(
    tmp_path: Path, late_s: float, kinds: list[str]
) -> None:
    """A torque that target and position tell to the digit is as good as measured where the motion takes it, and is no
    measurement where the drive gives it late."""

    def torque(motion: Motion) -> np.ndarray:
        return np.interp(motion[0] + late_s, motion[0], heavier(motion))

    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 5, torque, 0.0)))

    def asked(q: np.ndarray, effort: np.ndarray) -> np.ndarray:
        return q + (effort - 0.3) / 6

    trials = tuple(replace(t, setpoint={"hinge": asked(t.position["hinge"], t.effort["hinge"])}) for t in rig.trials)
    issues = trusted_fit(replace(rig, trials=trials))[1]
    assert [i.kind for i in issues] == kinds


@pytest.mark.parametrize("measured", [True, False])
def test_what_the_planned_motion_would_take_is_refused(tmp_path: Path, measured: bool) -> None:
    """The arm lags behind its target, and somebody leans on it: a true torque knows, one that is computed does not."""
    lag_s, random = 0.08, np.random.default_rng(7)
    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 5, heavier, 0.003)))

    def along(trial: RigTrial) -> RigTrial:
        asked = trial.position["hinge"]
        went = np.interp(trial.time_s - lag_s, trial.time_s, asked)
        if measured:  # the torque belongs to where it went, and the target is a little ahead
            ahead = np.interp(trial.time_s + lag_s, trial.time_s, asked)
            return replace(trial, setpoint={"hinge": ahead})
        leant = 0.05 * np.sin(2 * np.pi * random.uniform(0.05, 0.2) * trial.time_s)
        return replace(trial, position={"hinge": went + leant}, setpoint={"hinge": asked})

    issues = trusted_fit(replace(rig, trials=tuple(along(t) for t in rig.trials)))[1]
    assert [i.refuse for i in issues] == ([] if measured else [True])
    assert measured or ("planned motion" in issues[0].reason and len(issues[0].trials) == 5)


@pytest.mark.parametrize("told", [True, False])
def test_an_effort_that_does_not_carry_the_loads_it_is_told_of_is_refused(tmp_path: Path, told: bool) -> None:
    """Friction may be any; what hangs on the arm has to be carried."""
    hung_kg = [0.2, 0.5, 0.8, 0.3, 0.6]
    hung = iter(hung_kg)
    weight = '<body name="weight" pos="0 0 -0.3"><inertial pos="0 0 0" mass="0.4" diaginertia="1e-9 1e-9 1e-9"/></body>'
    arm = ARM.replace("</body></worldbody>", f"{weight}</body></worldbody>")

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        mass = told * next(hung)
        return balance(motion) + mass * (0.3**2 * a + 0.3 * 9.81 * np.sin(q)) + 0.3 * v

    folder = recorded(tmp_path / "s", arm, 5, torque, 0.01)
    set_in(folder, [f'"body:weight:mass" = {mass}' for mass in hung_kg])
    issues = trusted_fit(load_rig(read_session(folder)))[1]
    assert [i.refuse for i in issues] == ([] if told else [True])
    assert told or "carry the loads" in issues[0].reason


@pytest.mark.parametrize("told", [np.zeros_like, lambda t: np.sign(np.sin(t)), lambda t: 0.1 * t, "noise"])
def test_targets_that_do_not_move_as_the_arm_does_tell_of_no_plan(tmp_path: Path, told) -> None:
    """However little there is left to explain along them."""
    rig = load_rig(
        read_session(recorded(tmp_path / "s", ARM, 5, lambda m: heavier(m) * (1 + 0.3 * np.sin(7 * m[0])), 0.05))
    )
    random = np.random.default_rng(0)
    target = (lambda t: random.standard_normal(len(t))) if told == "noise" else told
    trials = tuple(replace(t, setpoint={"hinge": target(t.time_s)}) for t in rig.trials)
    assert trusted_fit(replace(rig, trials=trials))[1] == trusted_fit(rig)[1]


def test_a_target_that_comes_late_to_a_servo_is_told_from_a_late_servo(tmp_path: Path) -> None:
    servo = ARM.replace(MOTOR, '<position name="motor" joint="hinge" kp="6" kv="0.1"/>')

    def target(motion: Motion) -> np.ndarray:
        t, q, v, _ = motion
        asked = q + (balance(motion) + 0.1 * v) / 6
        return np.interp(t + 0.04, t, asked)  # sent 40 ms before it acts

    folder = recorded(tmp_path / "s", servo, 5, target, 1e-4)
    text = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(text.replace("actuator:motor:force", "actuator:motor:setpoint"))
    findings = diagnose_rig(read_session(folder))
    assert [f.effect for f in findings.findings] == ["command_delay"]
    assert findings.findings[0].parameters.keys() == {"delay"}
    assert findings.findings[0].parameters["delay"]["value"] == pytest.approx(0.04, rel=0.1)


def test_single_readings_far_outside_all_others_are_left_out(tmp_path: Path) -> None:
    wild = {3: 888.0, 700: -650.0, 701: -650.0}

    def told(motion: Motion) -> np.ndarray:
        torque = heavier(motion)
        torque[list(wild)] = list(wild.values())
        return torque

    findings = diagnose_rig(read_session(recorded(tmp_path / "s", ARM, 5, told, 0.01)))
    assert findings.verdict == "consistent" and '"torque": 15 single readings' in findings.notes[0]
    assert -findings.declared["inertial:arm:hz"] / 0.2 == pytest.approx(0.6, rel=0.01)


def test_bursts_and_what_comes_often_are_no_glitches() -> None:
    random = np.random.default_rng(0)
    burst = random.standard_normal(2000)
    burst[500:520] += 60.0
    often = random.standard_normal(2000)
    often[::50] += 60.0
    assert not glitches(burst).any() and not glitches(often).any() and not glitches(np.zeros(50)).any()
    gap = np.where(np.arange(2000) == 7, np.nan, random.standard_normal(2000))
    gap[900] = 99.0
    assert np.flatnonzero(glitches(gap)).tolist() == [900]


def test_a_position_that_jumps_by_a_turn_and_back_is_a_glitch_and_one_that_stays_is_none() -> None:
    t = np.arange(0, 20, 0.01)
    swing = 2.0 * np.sin(3 * t)
    jumps = swing.copy()
    jumps[[100, 400, 401]] += 2 * np.pi * np.array([1, -1, -1])
    assert np.flatnonzero(glitches(jumps, smooth=True)).tolist() == [100, 400, 401]
    assert not glitches(np.where(t > 10, swing + 2 * np.pi, swing), smooth=True).any()
    rests = np.where((t > 10) & (t < 10.5), 0.3 * (t - 10), np.where(t <= 10, 0.0, 0.15))
    assert not glitches(np.round(rests, 3), smooth=True).any()
