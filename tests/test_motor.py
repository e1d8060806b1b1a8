"""The motor's identification on simulated drives with known truth, made by a recorder that shares no code with it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hand_model.errors import IdentificationError
from hand_model.identify.motor import identify_motor, identify_motors
from hand_model.identify.motor.balance import NAMES, friction_state
from hand_model.identify.motor.batch import Moves
from hand_model.identify.motor.channel import channel_delay
from hand_model.identify.motor.drive import run, simulate
from hand_model.identify.motor.fit import fit_motor
from hand_model.identify.motor.moves import levelled, moves_from_rest, speed_levels
from hand_model.identify.motor.noise import reading_noise, white_noise
from hand_model.identify.motor.parameters import BOUNDS
from hand_model.identify.motor.predict import predict, reference, replay_table
from hand_model.identify.motor.profile import profile
from hand_model.identify.motor.published import MODELS, fit_published, smear_share
from hand_model.identify.motor.recording import MotorTrial, actuator_trials, check_trials, motor_trial, trial_scale
from hand_model.identify.motor.weak_form import fit_regressions
from hand_model.session import Log, read_session

SHARED = Path(__file__).resolve().parents[2] / "shared" / "sessions"
TRUTH = {"inertia": 0.0125, "viscous": 0.145, "coulomb": 34.0, "stiffness": 0.23, "preload": 9.0}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory):
    from hand_model.twin import bebionic, record

    folder = tmp_path_factory.mktemp("motor") / "session"
    record(bebionic("left", None, ["index"]), folder, seed=5)
    return read_session(folder)


@pytest.fixture(scope="module")
def fit(session):
    return identify_motor(session, "index")


@pytest.fixture(scope="module")
def trials(session):
    found = actuator_trials(session, "index")
    logs = [(t.name, t.log()) for t in found]
    scale = trial_scale(logs)
    return [motor_trial(n, log, scale) for n, log in logs]


def test_plant_is_found(fit) -> None:
    for name, wanted in TRUTH.items():
        estimate = fit.motor.parameters[name]
        assert estimate.value == pytest.approx(wanted, rel=0.08), name
        assert estimate.ci95[0] < estimate.value < estimate.ci95[1]
    assert not fit.stribeck  # the drive has none
    assert fit.motor.current_noise_raw == pytest.approx(5.0, rel=0.1)


@pytest.mark.parametrize("delay_s", [0.012, -0.02, 0.0])
def test_a_current_logged_late_is_told_to_a_fraction_of_a_sample(trials, fit, delay_s: float) -> None:
    late = [dataclasses.replace(t, current=np.interp(t.time_s - delay_s, t.time_s, t.current)) for t in trials]
    found = (fit if delay_s == 0 else fit_motor(late, fit.scale)).output_error
    value, doubt = channel_delay(found, BOUNDS)
    assert abs(value - delay_s) < 3 * doubt and doubt < 0.003


def test_regression_without_controller(trials) -> None:
    """A regression that knows nothing of setpoints agrees within its own interval, and the inertia is told to a
    quarter."""
    blind = [dataclasses.replace(t, setpoint=None, speed=None, limit=None) for t in trials]
    plain, curved = fit_regressions(blind, 3.5 / 58, 5.0)
    sd = np.sqrt(np.diag(plain.covariance))
    assert np.all(np.abs(plain.values - [TRUTH[n] for n in NAMES]) < 3.5 * sd)
    assert sd[0] < 0.25 * TRUTH["inertia"] and plain.misfit < 1.5
    assert curved.excess_z < 4  # no Stribeck friction where there is none


def test_regression_is_exact_without_noise() -> None:
    """Strokes of a simulated drive, densely sampled: parameters come back, whatever made it move."""
    q = {k: np.array([v]) for k, v in {**PARAMETERS, "presliding": 0.005}.items()}
    trials = []
    for i in range(10):
        far = 40.0 + 6 * (i // 2)
        there, back, friction = (0.0, far, -0.5) if i % 2 == 0 else (far, 0.0, 0.5)
        held = TRUTH["stiffness"] * there + TRUTH["preload"] + friction * TRUTH["coulomb"]
        moves = _moves(
            origin=there + held / 22.0,
            target=back,
            position=there,
            hold=held,
            speed=0.3 + 0.07 * i,
            duration_s=4.0,
            start_s=0.5,
        )
        t, p, u = (x[:8000:4] for x in simulate(moves, q, 5e-4))
        trials.append(MotorTrial(f"move {i}", t, p[:, 0], u[:, 0], None, None, None))
    found, _ = fit_regressions(trials, 0.02, 0.5)
    assert np.allclose(found.values, [TRUTH[n] for n in NAMES], rtol=0.05)


def test_prediction_of_held_out_trials(session, fit) -> None:
    for trial in actuator_trials(session, "index", validate=True):
        table = replay_table(predict(fit, trial.log(), trial.name), fit.sigma_current)
        assert table["all"][0] < 1.0 and table["all"][2] < 1.15


def test_reciprocal_term_is_smear(trials) -> None:
    """On a drive without Stribeck friction the reciprocal term still lowers the published error, and both sides alike
    undo that."""
    fits = fit_published(trials)
    published = {f.model: f.rmse_raw for f in fits}
    assert [published[m] for m in MODELS] == sorted(published.values(), reverse=True)
    assert published["SMD+Frec+Fc"] < 0.99 * published["SMD+Fc"]
    assert smear_share(fits, fit_published(trials, both_sides=True)) > 0.7


def _moves(**more: float) -> Moves:
    one = np.ones(1)
    values = {
        "start_s": 0.05,
        "origin": 0.0,
        "target": 80.0,
        "speed": 1.0,
        "limit": 255.0,
        "position": 0.0,
        "hold": 0.0,
        "duration_s": 1.5,
    }
    return Moves(**{k: v * one for k, v in {**values, **more}.items()})


PARAMETERS = {
    **TRUTH,
    "presliding": 0.5,
    "bristle": 0.0,
    "speed_full": 115.0,
    "rise": 0.1,
    "fall": 0.1,
    "gain": 22.0,
    "damping": 3.0,
    "delay": 0.0,
    "lag": 0.0,
    "edge": 0.1,
    "static_ratio": 1.0,
    "stribeck_speed": 20.0,
    "stribeck_exponent": 1.0,
}
CASCADE = {
    "presliding": 0.0,
    "gain": 12.0,
    "damping": 2.0,
    "position_gain": 14.0,
    "deadband": 1.0,
    "rise": 0.07,
    "edge": 0.02,
}


def test_profile_is_its_velocitys_integral() -> None:
    q = {k: np.array([v]) for k, v in PARAMETERS.items()}
    t = np.linspace(0, 1.5, 30001)
    r, w = profile(t, _moves(), q)
    assert r[0, 0] == 0.0 and r[-1, 0] == pytest.approx(80.0)
    assert np.allclose(np.gradient(r[:, 0], t), w[:, 0], atol=0.3)
    assert w.max() == pytest.approx(115.0)


def test_simulation_obeys_the_plant() -> None:
    """Inverse dynamics of the simulated motion give back its current, friction by the friction state along the path."""
    q = {k: np.array([v]) for k, v in PARAMETERS.items()}
    t, p, u = simulate(_moves(), q, 2e-4)
    n = int(1.4 / 2e-4)
    t, p, u = t[:n], p[:n, 0], u[:n, 0]
    v = np.gradient(p, t)
    a = np.gradient(v, t)
    z0 = (u[0] - TRUTH["preload"]) / TRUTH["coulomb"]
    z = friction_state(np.r_[p], 0.5)
    sliding = (p > 8) & (p < 70)
    balance = (
        TRUTH["inertia"] * a + TRUTH["viscous"] * v + TRUTH["coulomb"] * z + TRUTH["stiffness"] * p + TRUTH["preload"]
    )
    assert abs(z0) <= 1
    assert np.max(np.abs((balance - u)[sliding])) < 0.2


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_friction_that_sticks_is_the_limit_of_stiff_bristles(speed: float) -> None:
    """Bristles come to hard friction as the square root of their distance; a drive that sticks stays where it is."""
    q = {k: np.array([v]) for k, v in {**PARAMETERS, "rise": 1e-4, "fall": 1e-4, "damping": 0.6}.items()}
    moves = _moves(speed=speed, duration_s=1.2)
    hard = simulate(moves, q | {"presliding": np.zeros(1)}, 2e-4)[1][:6000, 0]
    off = [
        np.abs(simulate(moves, q | {"presliding": np.full(1, d)}, 2e-4)[1][:6000, 0] - hard).max() for d in (0.04, 0.01)
    ]
    assert off[1] < 0.75 * off[0] and off[1] < 0.1
    assert np.ptp(hard[:240]) == 0.0


def test_a_velocity_that_lags_passes_for_less_inertia_while_speed_rises() -> None:
    """During the rise a reference velocity `lag` behind acts as damping lag less of accelerating current."""
    q = {k: np.array([v]) for k, v in PARAMETERS.items()}
    current = [simulate(_moves(), q | {"lag": np.full(1, lag)}, 5e-4) for lag in (0.0, 1e-3)]
    late, heavy = (
        current[1],
        simulate(_moves(), q | {"inertia": q["inertia"] + q["damping"] * 1e-3, "lag": np.zeros(1)}, 5e-4),
    )
    rising = slice(180, 280)
    assert np.allclose((late[1] - current[0][1])[rising], (heavy[1] - current[0][1])[rising], atol=0.02)


def test_jump_within_a_step_counts() -> None:
    """The command's instant shifts the motion by itself, however coarse the step."""
    q = {
        k: np.array([v])
        for k, v in {**PARAMETERS, "presliding": 0.0, "rise": 1e-4, "fall": 1e-4, "damping": 0.6}.items()
    }
    t, early, _ = simulate(_moves(start_s=0.0500), q, 2e-3)
    _, later, _ = simulate(_moves(start_s=0.0507), q, 2e-3)
    k = (t > 0.3) & (t < 0.6)
    assert np.allclose((early - later)[k, 0], 115 * 0.0007, atol=0.01)


def test_jump_of_the_current_is_where_the_reference_jumps() -> None:
    """Between two steps, however coarse: just before the command the current is what held the drive, a tick later it
    has jumped, half of it between."""
    jump = {"presliding": 0.0, "rise": 1e-4, "fall": 1e-4, "damping": 0.6, "lead": 0.0}
    q = {k: np.array([v]) for k, v in {**PARAMETERS, **jump}.items()}
    _, u = run(_moves(start_s=0.0513), q, 5e-3).sample([np.array([0.0507, 0.0513, 0.0519])])
    assert abs(u[0, 0]) < 1.0 and u[2, 0] == pytest.approx(0.6 * 115.0, rel=0.05)
    assert u[1, 0] == pytest.approx(0.5 * u[2, 0], rel=0.15)


def test_cascade_does_not_depend_on_the_step() -> None:
    """Deadband and slew set in within a step, and where the integral holds decides how the drive creeps on."""
    q = {k: np.array([v]) for k, v in {**PARAMETERS, **CASCADE}.items()}
    fine, coarse = (simulate(_moves(duration_s=2.0), q, s, "cascade")[1][:: round(4e-3 / s), 0] for s in (2.5e-4, 2e-3))
    assert abs(fine[-60] - 80.0) < 1.0
    assert np.allclose(fine[:499], coarse[:499], atol=0.02)


def test_a_logged_speed_stands_for_one_speed(trials) -> None:
    """Moves of one logged speed tell it together: each one's own scatter averages out, a move that is alone keeps what
    the log says of it."""
    moves = [m for t in trials for m in moves_from_rest(t, (0.06, 5.0), 255.0)]
    rng, alone = np.random.default_rng(0), min(range(len(moves)), key=lambda i: moves[i].logged)
    moves[alone] = dataclasses.replace(moves[alone], logged=-1.0)
    own = np.array([[0.0, 0.0, m.logged * 1.002 + 3e-4 * rng.normal(), 0.0] for m in moves])
    levels = speed_levels(moves, own)
    for logged, (speed, sd) in levels.items():
        if logged > 0 and sum(m.logged == logged for m in moves) > 3:
            assert abs(speed - 1.002 * logged) < 4e-4 and sd < 3e-4
    assert levels[-1.0] == (own[alone, 2], moves[alone].own_sd[2])
    assert [m.own[2] for m in levelled(moves, levels)] == [levels[m.logged][0] for m in moves]


def test_current_of_the_last_sample_before_a_command_belongs_to_no_move(trials) -> None:
    """Channels of a row are read one after the other: its current may be the next command's already."""
    touched = dataclasses.replace(trials[0], current=trials[0].current.copy())
    moves = moves_from_rest(trials[0], (0.06, 5.0), 255.0)
    for m in moves:
        touched.current[m.index] += 500.0
    for a, b in zip(moves, moves_from_rest(touched, (0.06, 5.0), 255.0), strict=True):
        assert np.array_equal(a.current, b.current) and np.array_equal(a.own, b.own)


def test_a_command_among_rows_that_were_lost_begins_no_move(trials) -> None:
    t, moves = trials[0], moves_from_rest(trials[0], (0.06, 5.0), 255.0)
    begun = moves[1].index
    kept = np.r_[0 : begun + 1, begun + 60 : len(t.time_s)]
    names = ("time_s", "position", "current", "setpoint", "speed", "limit")
    lost = dataclasses.replace(t, **{n: None if getattr(t, n) is None else getattr(t, n)[kept] for n in names})
    left = moves_from_rest(lost, (0.06, 5.0), 255.0)
    assert [m.own.tolist() for m in left] == [m.own.tolist() for i, m in enumerate(moves) if i != 1]


def test_friction_state_sticks() -> None:
    z = friction_state(np.r_[0.0, 10.0, 10.0, 10.0, 9.99], 0.5)
    assert z[1] == pytest.approx(1.0, abs=1e-6) and z[1] == z[2] == z[3] and 0.9 < z[4] < 1.0


def test_the_noise_of_a_reading_does_not_depend_on_its_unit() -> None:
    """Whole counts leave a third of one, decimals of a degree a third of their last digit."""
    rng = np.random.default_rng(0)
    t = np.arange(0, 20, 0.01)
    at_rest = np.where(np.sin(t) > 0.5, 200 * np.sin(t), 100.0)
    for noise in (0.02, 2.0):
        counts = np.round(at_rest + rng.normal(0, noise, len(t)))
        found = reading_noise([(counts, t)])
        assert found == pytest.approx(max(noise, 0.3), rel=0.1)
        assert reading_noise([(0.0137 * (counts - 3000), t)]) == pytest.approx(0.0137 * found)
    assert reading_noise([(at_rest, t)]) > 0  # a reading that stands still in most samples is no exact one


def test_white_noise_estimate() -> None:
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.012, 0.024, 4000))
    assert white_noise(50 * np.sin(t) + rng.normal(0, 5, 4000), t) == pytest.approx(5.0, rel=0.06)


def test_reference_drives_the_compiled_actuator(fit, trials) -> None:
    t = np.arange(0, 5, 0.001)
    control = reference(fit, trials[0], t)
    assert control.min() > -5 and control.max() < 105 and np.ptp(control) > 50


# --- bad input: one sentence each


def _log(**columns: np.ndarray) -> Log:
    t = np.arange(600) * 0.018
    position = 12000 + 2900 * (1 - np.cos(t))
    current = 40 * np.sign(np.sin(t)) + 0.2 * position / 60 + np.random.default_rng(1).normal(0, 5, 600)
    base = {"position": position, "current": current}
    return Log(t, {**base, **columns}, Path("x.csv"))


def _clipped(noise: float) -> np.ndarray:
    """A drive's current that clips at 30 raw, the noise of a converter added after it."""
    return np.clip(_log().columns["current"], -30, 30) + np.random.default_rng(3).normal(0, noise, 600)


def _check(log: Log) -> None:
    scale = trial_scale([("log/x.csv", log)])
    check_trials([motor_trial("log/x.csv", log, scale)])


def test_good_log_passes() -> None:
    _check(_log())


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"current": np.full(600, 7.0)}, "constant"),
        ({"position": np.full(600, 12000.0)}, "does not move"),
        ({"position": np.linspace(12000, 18000, 600)}, "no extension"),
        ({"current": np.clip(60 * np.sin(np.arange(600) * 0.018), -40, 40)}, "saturated"),
        ({"current": _clipped(0.4)}, "saturated near"),
        ({"current": 20 + 29 * (1 - np.cos(np.arange(600) * 0.018))}, "command"),
        # a reference that the position follows
        ({"current": 20 + 29 * (1 - np.cos(np.arange(600) * 0.018 + 0.05))}, "command"),
        ({"current": np.random.default_rng(2).normal(0, 5, 600)}, "no higher in flexion"),
        ({"current": 80 * np.sign(np.sin(np.arange(600) * 0.018))}, "holds its value"),
        (
            {"setpoint": np.repeat([12000.0, 18000.0, 12000.0], 200), "current": np.repeat([5.0, 80.0, 5.0], 200)},
            "command",
        ),
    ],
)
def test_bad_current_or_motion(columns: dict[str, np.ndarray], words: str) -> None:
    with pytest.raises(IdentificationError, match=words) as info:
        _check(_log(**columns))
    assert "\n" not in str(info.value) and "log/x.csv" in str(info.value)


def test_missing_column_and_actuator(session) -> None:
    log = _log()
    without = Log(log.time_s, {"position": log.columns["position"], "curent": log.columns["current"]}, log.path)
    with pytest.raises(IdentificationError, match='no column "current"; did you mean "curent"'):
        trial_scale([("log/x.csv", without)])
    with pytest.raises(IdentificationError, match="did you mean"):
        identify_motor(session, "indx")
    empty = dataclasses.replace(session, trials=())
    with pytest.raises(IdentificationError, match="no excitation or flexion trial"):
        identify_motor(empty, "index")
    motors, notes = identify_motors(empty)
    assert not motors and len(notes) == 1


@pytest.mark.skipif(not SHARED.is_dir(), reason="shown sessions are not here")
@pytest.mark.parametrize(("name", "stribeck"), [("shown_00", False), ("shown_01", True)])
def test_shown_sessions(name: str, stribeck: bool) -> None:
    import json

    answer = json.loads((SHARED / name / "answer.json").read_text())["motor"]["index"]
    fit = identify_motor(read_session(SHARED / name), "index")
    sd = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
    for key, wanted in zip(NAMES, (answer[k] for k in ("m", "b", "Fc", "k", "tau0")), strict=True):
        assert abs(fit.values[key] - wanted) < 3.3 * sd[key], key
    assert fit.stribeck is stribeck


def test_current_of_another_drive_is_not_explained(trials, fit) -> None:
    """A model that does not fit gives no intervals, and says why."""
    rng = np.random.default_rng(2)
    slow = np.cumsum(rng.normal(0, 8, 20000))
    wrong = [dataclasses.replace(t, setpoint=None, current=t.current + slow[: len(t.current)]) for t in trials]
    motor = fit_motor(wrong, fit.scale).motor
    assert all(e.ci95 is None for e in motor.parameters.values())
    assert any("without intervals" in note for note in motor.notes)


def test_cascade_controller_is_found_and_replayed(tmp_path: Path) -> None:
    """A loop with integral action and a dead zone, in which the drive creeps between moves."""
    from hand_model.twin import Plan, bebionic, record
    from hand_model.twin.truth import Controller

    truth = bebionic("right", None, ["index"])
    cascade = Controller("cascade", 2.2, 0.6, 12.0, 110.0, 255.0)
    truth = dataclasses.replace(truth, motors={"index": dataclasses.replace(truth.motors["index"], controller=cascade)})
    record(truth, tmp_path / "session", 3, plan=Plan(joint_sides=("medial",), still_s=0.3))
    session = read_session(tmp_path / "session")
    fit = identify_motor(session, "index")
    assert fit.output_error.controller == "cascade"
    for name, wanted in TRUTH.items():
        assert fit.motor.parameters[name].value == pytest.approx(wanted, rel=0.12), name
    for trial in actuator_trials(session, "index", validate=True):
        table = replay_table(predict(fit, trial.log(), trial.name), fit.sigma_current)
        assert table["all"][0] < 1.0 and table["all"][2] < 1.15


def test_current_is_predicted_from_the_motion_without_setpoints(session, fit) -> None:
    trial = actuator_trials(session, "index", validate=True)[0]
    log = trial.log()
    blind = Log(log.time_s, {k: v for k, v in log.columns.items() if k in ("position", "current")}, log.path)
    found = predict(fit, blind, trial.name)
    assert np.array_equal(found.position, found.recorded_position)
    assert found.rmse("cruise")[1] < 3 * fit.sigma_current  # starts and stops included, which the filter smears
