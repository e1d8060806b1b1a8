"""Recordings of rigs that lack something: a sign, a drive that is plugged in, any drive at all; files that diverge."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, HEAD, Motion, balance, recorded, written
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt

from hand_model.effects.path import jenkins
from hand_model.errors import SessionError
from hand_model.rig import diagnose_rig, fit_declared, load_rig, replay_rig
from hand_model.rig.channels import check_channels
from hand_model.rig.commanded import sinusoids_left
from hand_model.rig.diagnose import trusted_fit
from hand_model.rig.model import RigTrial
from hand_model.rig.name.candidates import candidates
from hand_model.rig.replay import LOST
from hand_model.rig.states import later, low_pass, noise_std
from hand_model.session import read_session

VOLTAGE = ARM.replace(
    '<motor name="motor" joint="hinge"/>',
    '<dcmotor name="motor" joint="hinge" motorconst="0.35 0.35" resistance="3.4"/>',
)
OPEN = 'set = { "actuator:motor:gear" = [0, 0, 0, 0, 0, 0] }\n'


def voltage_bench(folder: Path, size: bool) -> Path:
    """The arm behind a motor whose voltage [V] is recorded, or only its size."""
    gain = 0.35 / 3.4

    def told(motion: tuple[np.ndarray, ...]) -> np.ndarray:
        out = (balance(motion) + gain * 0.35 * motion[2]) / gain
        return np.abs(out) if size else out

    recorded(folder, VOLTAGE, 5, told, 0.0)
    text = (folder / "session.toml").read_text().replace("motor:force", "motor:ctrl")
    (folder / "session.toml").write_text(text)
    return folder


@pytest.mark.parametrize("size", [True, False])
def test_a_voltage_without_sign_is_refused(tmp_path: Path, size: bool) -> None:
    """A column that holds the size of a voltage is one issue in all recordings; one with its sign is none."""
    _, issues = trusted_fit(load_rig(read_session(voltage_bench(tmp_path / "s", size))))
    if size:
        assert [i.refuse for i in issues] == [True] and "no sign" in issues[0].reason and len(issues[0].trials) == 5
    else:
        assert issues == ()


@pytest.mark.parametrize("size", [True, False])
def test_a_friction_without_sign_is_refused(tmp_path: Path, size: bool) -> None:
    """Friction that outweighs all else and turns round over a distance: its size touches zero at every reversal and is
    refused; beside an offset that keeps it on one side it has its sign."""
    heavy = ARM.replace('frictionloss="0.05"', 'frictionloss="4"')

    def told(motion: Motion) -> np.ndarray:
        out = balance(motion) + 4.0 * jenkins(motion[1], 0.1)
        return np.abs(out) if size else out + 6.0

    _, issues = trusted_fit(load_rig(read_session(recorded(tmp_path / "s", heavy, 5, told, 0.02))))
    if size:
        assert [i.refuse for i in issues] == [True] and "no sign" in issues[0].reason and len(issues[0].trials) == 5
    else:
        assert issues == ()


def test_a_drive_that_is_unplugged_has_no_effects(tmp_path: Path) -> None:
    """Nothing of the drive (a delay, friction by its effort) is a candidate where its leads are open in every
    recording."""
    recorded(tmp_path / "s", ARM, 2, balance, 0.0)
    rig = load_rig(read_session(tmp_path / "s"))
    names = {c.key for c in candidates(rig, fit_declared(rig), "hinge")}
    assert {"current_channel_delay@hinge", "load_dependent_friction/motor side@hinge"} <= names
    path = tmp_path / "s" / "session.toml"
    path.write_text(path.read_text().replace('.csv"\n', '.csv"\n' + OPEN))
    rig = load_rig(read_session(tmp_path / "s"))
    names = {c.key for c in candidates(rig, fit_declared(rig), "hinge")}
    assert not names & {"current_channel_delay@hinge", "load_dependent_friction/motor side@hinge"}
    assert "load_dependent_friction@hinge" in names


def test_inertia_is_fitted_where_nothing_is_driven(tmp_path: Path) -> None:
    """A free swing: the weight is the scale and stays as declared; its period tells the inertia, a fifth more than
    declared."""
    folder, inertia = tmp_path / "s", 1.2 * (0.002 + 0.5 * 0.2**2)
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(ARM.replace('<motor name="motor" joint="hinge"/>', "").replace("0.05", "1e-5"))
    t = np.arange(0, 12, 0.004)
    q = 0.02 * np.exp(-0.1 * t) * np.cos(np.sqrt(0.5 * 0.2 * 9.81 / inertia) * t)
    np.savetxt(
        folder / "log/0.csv", np.stack([t, q], 1), delimiter=",", header="time,position", comments="", fmt="%.10g"
    )
    (folder / "session.toml").write_text(
        HEAD.replace('torque = "actuator:motor:force"\n', "") + '[[trial]]\nkind = "motion"\nlog = "log/0.csv"\n'
    )
    fit = fit_declared(load_rig(read_session(folder)))
    found = {c.label: v for c, v in zip(fit.columns, fit.theta, strict=True)}
    assert found["inertial:arm:hz"] == pytest.approx(-0.1, rel=1e-4)
    assert found["inertial:arm:Iyy"] == pytest.approx(inertia, rel=0.01)


def test_a_file_that_diverges_is_said_to_and_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond what a simulation can step it is lost, as far off as counts, and MuJoCo writes no log into the user's
    folder."""
    stiff = (
        ARM.replace('damping="0.02"', 'damping="0.02" stiffness="1e9"')
        .replace('timestep="0.001"', 'timestep="0.01"')
        .replace("implicitfast", "Euler")
    )
    session = read_session(recorded(tmp_path / "s", stiff, 1, balance, 0.0))
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    told = replay_rig(session, efforts=False).joints[0]
    assert (
        told.diverged and 0.0 < told.position_rmse <= LOST * np.ptp(session.trials[0].log().column("position")) + 1e-9
    )
    assert list((tmp_path / "empty").iterdir()) == []


def test_a_ramp_is_no_sinusoid_and_an_unplugged_drive_no_command(tmp_path: Path) -> None:
    """A slow lift's torque is a piece of many a sinusoid, and a torque of zero beside open leads is true: neither is
    refused. A sinusoid that comes several times is one."""
    t = np.arange(0, 2, 0.005)
    assert sinusoids_left(t, np.sin(0.5 * np.pi * t / 2 - 0.1)) == 1.0
    assert sinusoids_left(t, np.sin(2 * np.pi * 2.3 * t)) < 1e-3
    recorded(tmp_path / "s", ARM, 5, balance, 0.0)
    head, *trials = (path := tmp_path / "s" / "session.toml").read_text().split("[[trial]]\n")
    trials[0] += OPEN
    path.write_text("[[trial]]\n".join([head, *trials]))
    log = tmp_path / "s" / "log" / "0.csv"
    table = np.genfromtxt(log, delimiter=",", skip_header=1)
    table[:, 2] = 0.0
    np.savetxt(log, table, delimiter=",", header="time,position,torque", comments="", fmt="%.8g")
    assert trusted_fit(load_rig(read_session(tmp_path / "s")))[1] == ()


def test_one_sinusoid_among_other_torques_is_no_command(tmp_path: Path) -> None:
    """Where the others are none, it is what a joint that swings so takes; in most of them, the column is a command."""
    recorded(tmp_path / "s", ARM, 5, balance, 0.0)
    for count, refused in ((1, False), (3, True)):
        for k in range(count):
            log = tmp_path / "s" / "log" / f"{k}.csv"
            table = np.genfromtxt(log, delimiter=",", skip_header=1)
            table[:, 2] = 0.4 * np.sin(2 * np.pi * 0.7 * table[:, 0])
            np.savetxt(log, table, delimiter=",", header="time,position,torque", comments="", fmt="%.8g")
        assert any("sinusoid" in i.reason for i in check_channels(load_rig(read_session(tmp_path / "s")))) is refused


def test_a_torque_by_position_alone_is_a_command_after_its_controller_has_begun(tmp_path: Path) -> None:
    """Pushed by hand, mostly to one side, against a controller that holds the weight and begins after a while; one with
    friction in it is measured."""
    t = np.arange(0, 12, 0.004)
    q = 2.0 - 0.25 * t + 0.25 * np.sin(2 * np.pi * 0.4 * t)
    v = -0.25 + 0.2 * np.pi * np.cos(2 * np.pi * 0.4 * t)
    for name, friction, refused in (("command", 0.0, True), ("measured", 0.05, False)):
        torque = np.where(t > 0.2, 0.981 * np.sin(q) + friction * np.sign(v), 0.0)
        folder = written(tmp_path / name, ARM, HEAD, "torque", [np.stack([t, q, torque], 1)])
        reasons = [i.reason for i in check_channels(load_rig(read_session(folder)))]
        assert any("static function of the position" in r for r in reasons) is refused


def test_a_torque_that_never_changes_is_dead_and_a_short_recording_shows_no_drive_warm_up(tmp_path: Path) -> None:
    """Said so without a percentage; warming takes longer than a few seconds."""
    t = np.arange(0, 6, 0.004)
    table = np.stack([t, 0.5 * np.sin(3 * t), np.zeros_like(t)], 1)
    rig = load_rig(read_session(written(tmp_path / "dead", ARM, HEAD, "torque", [table])))
    assert [i.reason for i in check_channels(rig)] == ["torque never changes: dead"]
    for seconds, offered in ((6.0, False), (12.0, True)):
        rig = load_rig(read_session(recorded(tmp_path / f"{seconds}", ARM, 1, balance, 0.01)))
        short = replace(rig, trials=tuple(cut(trial, seconds) for trial in rig.trials))
        known = {c.effect for c in candidates(short, fit_declared(short), "hinge")}
        assert ("thermal_friction_drift" in known) is offered


def cut(trial: RigTrial, seconds: float) -> RigTrial:
    """The first seconds of a trial."""
    keep = trial.time_s <= seconds
    return replace(
        trial,
        time_s=trial.time_s[keep],
        position={j: q[keep] for j, q in trial.position.items()},
        effort={j: e[keep] for j, e in trial.effort.items()},
    )


def test_without_recordings_held_out_errors_are_said_to_be_of_those_fitted(tmp_path: Path) -> None:
    """No trial validates: the proof names none, the sentence and a note say so."""

    def dragged(motion: Motion) -> np.ndarray:
        return balance(motion) + 0.05 * motion[2] * np.abs(motion[2])

    found = diagnose_rig(read_session(recorded(tmp_path / "s", ARM, 4, dragged, 0.005)))
    assert [f.effect for f in found.findings] == ["quadratic_damping"]
    assert found.findings[0].fit["held_out"] == [] and len(found.findings[0].where["trials"]) == 4
    assert "on what was fitted falls from" in found.findings[0].statement
    assert any("no trial has purpose" in note for note in found.notes)


def test_uneven_stamps_are_no_noise() -> None:
    """What moves smoothly has none, however its samples lie; what noise there is comes out, and with even stamps as
    without any."""
    random = np.random.default_rng(0)
    even = np.arange(4000) * 1e-3
    t = even + 0.4e-3 * random.uniform(-1, 1, len(even))
    assert noise_std(np.sin(9 * t), t) < 1e-6
    noisy = np.sin(9 * t) + 1e-4 * random.standard_normal(len(t))
    assert noise_std(noisy, t) == pytest.approx(1e-4, rel=0.1)
    assert noise_std(noisy, even) == pytest.approx(noise_std(noisy), rel=1e-6)


@pytest.mark.parametrize("delay_s", [0.0237, -0.0037, 0.02, 5.0])
@pytest.mark.parametrize("shape", [(), (2,)])
def test_what_comes_later_is_the_cubic_spline_of_scipy(shape: tuple[int, ...], delay_s: float) -> None:
    time_s = 3.0 + 0.01 * np.arange(300)
    x = np.random.default_rng(0).normal(size=(300, *shape))
    at = np.clip(time_s - delay_s, time_s[0], time_s[-1])
    inner = slice(40, -40)
    assert later(time_s, x, delay_s)[inner] == pytest.approx(CubicSpline(time_s, x)(at)[inner], abs=1e-9)
    smooth = np.sin(2 * time_s)
    assert later(time_s, smooth, delay_s) == pytest.approx(np.sin(2 * at), abs=1e-5)
    assert np.array_equal(later(time_s[:1], x[:1], delay_s), x[:1])


@pytest.mark.parametrize("shape", [(400,), (400, 3), (35,)])
def test_the_low_pass_is_that_of_scipy(shape: tuple[int, ...]) -> None:
    """Both ways, ends reflected, started as if settled."""
    x = np.cumsum(np.random.default_rng(1).standard_normal(shape), 0)
    pad = min(len(x) - 2, int(3 * 100 / 4.0))
    assert low_pass(x, 100.0, 4.0) == pytest.approx(filtfilt(*butter(2, 4.0 / 50.0), x, axis=0, padlen=pad), abs=1e-9)


def test_a_joint_that_no_training_recording_moves_is_left_alone(tmp_path: Path) -> None:
    """What stands in all recordings but the one that is held out has nothing fitted to it, and a session that holds out
    all says so."""
    folder = recorded(tmp_path / "s", ARM, 3, balance, 0.0)
    text = (folder / "session.toml").read_text()
    table = np.loadtxt(folder / "log/0.csv", delimiter=",", skiprows=1)
    for k in (0, 1):
        np.savetxt(
            folder / f"log/{k}.csv", table * [1, 0, 1], delimiter=",", header="time,position,torque", comments=""
        )
    (folder / "session.toml").write_text(text + 'purpose = "validate"\n')
    assert diagnose_rig(read_session(folder)).verdict in ("consistent", "unexplained")
    (folder / "session.toml").write_text(text.replace('kind = "motion"', 'kind = "motion"\npurpose = "validate"'))
    with pytest.raises(SessionError, match="at least one must be left to fit to"):
        diagnose_rig(read_session(folder))
