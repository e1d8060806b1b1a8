"""Friction that thins as a joint warms, over recordings of one clock; delays within a sample; late copies of commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, HEAD, balance, recorded, two_sines, written

from hand_model.rig import diagnose_rig, load_rig
from hand_model.rig.channels import check_channels
from hand_model.rig.declared import fit_declared
from hand_model.rig.laws import Now, law
from hand_model.rig.name.candidates import candidates
from hand_model.rig.warming import still_to_come
from hand_model.session import read_session

pytest.importorskip("mujoco")

WARM_UP_S, BETWEEN_S, DRAG = 150.0, 60.0, 0.25


def warming(folder: Path, temperature: bool = False, apart: bool = True) -> Path:
    """Six recordings of an arm whose drag falls as it warms, on one clock or on a clock each."""
    random, tables = np.random.default_rng(5), []
    t = np.arange(0, 12, 0.004)
    for k in range(6):
        motion = two_sines(random, t)
        _, q, v, _ = motion
        cold = np.exp(-(k * BETWEEN_S + t) / WARM_UP_S)
        torque = balance(motion) + DRAG * cold * v + 0.01 * random.standard_normal(len(t))
        clock = t + (k * BETWEEN_S if apart else 0.0)
        more = [np.round((40 - 18 * cold) / 0.25) * 0.25] if temperature else []
        tables.append(np.column_stack([clock, np.round(q / 4e-4) * 4e-4, torque, *more]))
    return written(folder, ARM, HEAD, "torque" + (",hinge_temperature" if temperature else ""), tables)


@pytest.mark.parametrize("temperature", [False, True])
def test_drag_that_falls_as_a_joint_warms_is_named(tmp_path: Path, temperature: bool) -> None:
    found = diagnose_rig(read_session(warming(tmp_path / "s", temperature)))
    first = found.findings[0]
    assert first.effect == "thermal_friction_drift"
    assert found.lack_of_fit["after"] < 0.3
    assert found.lack_of_fit["open_loop"]["ratio"] < 0.7  # MuJoCo on the file, as warm as the joint was
    size = first.parameters["cold_viscous"]
    assert size["unit"] == "N m s/rad"
    told = set(first.parameters)
    assert ("warm_up_time" in told) != ("coldest" in told)  # by time or by temperature, not both
    if "warm_up_time" in told:
        assert size["value"] == pytest.approx(DRAG, rel=0.15)
        assert first.parameters["warm_up_time"]["value"] == pytest.approx(WARM_UP_S, rel=0.3)


def test_clocks_that_run_on_tell_when_a_recording_began(tmp_path: Path) -> None:
    on = load_rig(read_session(warming(tmp_path / "on")))
    assert list(on.begun_s.values()) == pytest.approx([k * BETWEEN_S for k in range(6)])
    assert load_rig(read_session(warming(tmp_path / "each", apart=False))).begun_s == {}
    warms = [c for c in candidates(on, fit_declared(on), "hinge", only={"thermal_friction_drift"})]
    assert {c.variant for c in warms} == {"", "viscous", "dry and viscous"}


def test_a_delay_within_half_a_sample_is_no_effect(tmp_path: Path) -> None:
    """A torque averaged over each sample: it is told in a note; one of two samples is named."""
    for name, delay_s, named in (("within", 0.0015, False), ("beyond", 0.008, True)):

        def late(motion, delay_s=delay_s):
            t = motion[0]
            return np.interp(t - delay_s, t, balance(motion))

        found = diagnose_rig(read_session(recorded(tmp_path / name, ARM, 6, late, 0.004)))
        assert ("current_channel_delay" in [f.effect for f in found.findings]) is named
        assert any("less than half a sample" in note for note in found.notes) is not named


def test_a_torque_that_repeats_its_command_a_sample_late_is_refused(tmp_path: Path) -> None:
    random, t = np.random.default_rng(0), np.arange(0, 12, 0.004)
    for name, noise, refused in (("copy", 0.0, True), ("measured", 0.05, False)):
        q = 0.6 * np.sin(2.1 * t) + 0.2 * np.sin(5.3 * t + 1)
        command = (
            0.9 * np.sin(2.1 * t + 0.3) + 0.6 * np.sin(5.3 * t) + 0.4 * np.sin(9.7 * t) + 0.3 * np.sign(np.cos(2 * t))
        )
        torque = np.r_[command[:1], command[:-1]] + noise * random.standard_normal(len(t))
        folder = written(tmp_path / name, ARM, HEAD, "torque,wanted", [np.c_[t, q, torque, command]])
        reasons = [i.reason for i in check_channels(load_rig(read_session(folder))) if i.refuse]
        assert any('repeats the channel "wanted", 1 sample late' in r for r in reasons) is refused


def test_what_is_still_to_come_of_warming(tmp_path: Path) -> None:
    """By the clock of the session, by that of each recording, by temperature; all of it where that is not logged."""
    warm = load_rig(read_session(warming(tmp_path / "s", temperature=True)))
    third = warm.trials[2]
    elapsed = still_to_come(warm, third, "hinge", {"form": 0.0, "warm_up_time": WARM_UP_S})
    np.testing.assert_allclose(elapsed, np.exp(-(2 * BETWEEN_S + third.time_s) / WARM_UP_S))
    each = still_to_come(warm, third, "hinge", {"form": 3.0, "warm_up_time": WARM_UP_S})
    np.testing.assert_allclose(each, np.exp(-third.time_s / WARM_UP_S))
    logged = {"form": 2.0, "coldest": 22.0, "warmest": 40.0}
    np.testing.assert_allclose(still_to_come(warm, third, "hinge", logged), elapsed, atol=0.01)
    oil = still_to_come(warm, third, "hinge", {**logged, "thinning": 1.5})
    np.testing.assert_allclose(oil, np.expm1(1.5 * elapsed) / np.expm1(1.5), atol=0.01)
    silent = load_rig(read_session(warming(tmp_path / "t")))
    assert np.all(still_to_come(silent, silent.trials[2], "hinge", logged) == 1)


@pytest.mark.parametrize("thinning", [0.0, 2.0])
def test_how_a_lubricant_thins_is_read_of_the_temperature(tmp_path: Path, thinning: float) -> None:
    """Evenly, or exponentially, as its viscosity falls (Reynolds 1886)."""
    random, tables = np.random.default_rng(8), []
    t = np.arange(0, 12, 0.004)
    for k in range(5):
        motion = two_sines(random, t)
        degrees = 20 + 4 * k + t / 3
        left = (36 - degrees) / 16  # of what the first four recordings see
        cold = 0.3 * (np.expm1(thinning * left) / np.expm1(thinning) if thinning else left)
        torque = balance(motion) + np.sign(motion[2]) * cold + 0.01 * random.standard_normal(len(t))
        tables.append(np.stack([t, np.round(motion[1] / 4e-4) * 4e-4, torque, degrees], 1))
    findings = diagnose_rig(read_session(written(tmp_path / "s", ARM, HEAD, "torque,hinge_temperature", tables)))
    assert [f.effect for f in findings.findings] == ["thermal_friction_drift"]
    told = {k: v["value"] for k, v in findings.findings[0].parameters.items()}
    assert told["thinning"] == pytest.approx(thinning, abs=0.25)
    assert told["cold_excess"] == pytest.approx(0.3, rel=0.15)


def test_a_law_that_follows_its_warming() -> None:
    act = law({"effect": "thermal_friction_drift", "shape": {}, "amplitude": {"cold_excess": 0.2, "cold_viscous": 0.5}})
    assert act(Now(0.0, 2.0, 0.0, 0.0, 0.0, 3.0)) == pytest.approx((1.0, 0.2))
    act.follow(np.array([0.0, 10.0]), np.array([1.0, 0.0]))
    assert act(Now(0.0, -2.0, 0.0, 0.0, 0.0, 5.0)) == pytest.approx((-0.5, 0.1))
