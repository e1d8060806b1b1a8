"""Every effect of the twin changes what it says it changes, and nothing upstream of it or beside it."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import ezc3d
import numpy as np
import pytest

from hand_model.errors import HandModelError
from hand_model.textbook import readings
from hand_model.twin import CATALOGUE, KINDS, Hidden, Plan, bebionic, draw_case, outside, record, vocabulary
from hand_model.twin.effects.shapes import play
from hand_model.twin.influence import activate, merge_terms
from hand_model.twin.motor import DriveNow, simulate
from hand_model.twin.program import flexion
from hand_model.twin.schedule import schedule

PLAN = Plan(flexion=("full", "half"), validation=("full",), excitations=0, still_s=0.2)
SEED = 3
# The vocabulary of hand-findings/1.
TABLE = [
    "stribeck_friction",
    "asymmetric_viscous_friction",
    "asymmetric_friction",
    "load_dependent_friction",
    "position_dependent_friction",
    "detent_load",
    "nonlinear_spring",
    "gravity_load",
    "torque_ripple",
    "quadratic_damping",
    "elastoplastic_hysteresis",
    "viscoelastic_spring",
    "presliding_friction",
    "end_stop_contact",
    "thermal_friction_drift",
    "drive_backlash",
    "series_elasticity",
    "linkage_backlash",
    "linkage_compliance",
    "coupling_deadband",
    "distal_stop",
    "spring_decoupling",
    "external_contact",
    "joint_wobble",
    "moving_centre",
    "encoder_periodic_error",
    "drive_sag",
    "command_delay",
    "current_saturation",
    "current_channel_delay",
    "command_as_measurement",
    "clock_drift",
    "marker_slip",
    "support_slip",
    "palm_marker_slip",
    "marker_swap",
]


@cache
def truth():
    return bebionic("left", None, ["index", "ring"])


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return record(truth(), tmp_path_factory.mktemp("effects") / "plain", SEED, plan=PLAN)


def changed(first: Path, second: Path) -> set[str]:
    def digest(folder: Path) -> dict[str, str]:
        return {
            str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
            for p in folder.rglob("*")
            if p.is_file()
        }

    a, b = digest(first), digest(second)
    assert a.keys() == b.keys()
    return {name for name in a if a[name] != b[name]}


def columns(folder: Path, name: str) -> np.ndarray:
    return np.genfromtxt(folder / "log" / f"{name}.csv", delimiter=",", names=True)


def points(path: Path) -> dict[str, np.ndarray]:
    file = ezc3d.c3d(str(path))
    labels = file["parameters"]["POINT"]["LABELS"]["value"]
    return dict(zip(labels, file["data"]["points"][:3].transpose(1, 2, 0), strict=True))


LOGS = {"log/flexion_index.csv", "log/flexion_index_b.csv"}
MOCAP = {"mocap/flexion_index.c3d", "mocap/flexion_index_b.c3d"}
OWN = LOGS | MOCAP


def test_the_catalogue_holds_the_vocabulary_and_more():
    assert set(vocabulary()) == set(TABLE)
    assert len(outside()) >= 5 and not set(outside()) & set(TABLE)
    assert sum(len(CATALOGUE[name].forms) for name in CATALOGUE) >= 60


@pytest.mark.parametrize("name", [n for n in CATALOGUE if n != "gravity_load"])
def test_an_effect_changes_its_own_files_only(name, plain, tmp_path):
    declared = CATALOGUE[name]
    answer = record(truth(), tmp_path / "s", SEED, [Hidden(name, "index")], PLAN)
    files = changed(plain.path, answer.path)
    told = answer.table["effects"][0]
    assert told["effect"] == name and told["finger"] == "index" and told["form"] in declared.forms
    assert files, "an effect that changes nothing is not hidden but absent"
    palm_or_clock = name in ("palm_marker_slip", "clock_drift")
    assert palm_or_clock or files <= OWN, "a healthy finger was touched"
    if declared.station in ("transmission", "kinematics", "recording") and name != "spring_decoupling":
        assert not any(file.startswith("log") for file in files), "the drive does not know of it"
    before, after = columns(plain.path, "flexion_index"), columns(answer.path, "flexion_index")
    if name in ("current_channel_delay", "rhythmic_disturbance") and told["form"] in (
        "delay",
        "lag",
        "early",
        "pickup",
    ):
        assert files == LOGS and np.array_equal(before["position"], after["position"])
    if name in ("clock_drift", "buffered_log"):
        assert all(file.startswith("log") for file in files)
        assert np.array_equal(before["current"], after["current"]) and not np.array_equal(before["time"], after["time"])
        assert (np.diff(after["time"]) > 0).all()
    if declared.station == "kinematics":
        trials = ("flexion_index", "flexion_index_b")
        assert all(np.array_equal(plain.trials[t].angle_rad, answer.trials[t].angle_rad) for t in trials)
    if "moment_s" in told["parameters"] and declared.station == "recording":
        trial = answer.trials["flexion_index"]
        frame = int((told["parameters"]["moment_s"] - trial.plan.start_s) * 100)
        a, b = points(plain.path / "mocap/flexion_index.c3d"), points(answer.path / "mocap/flexion_index.c3d")
        touched = {
            label for label in a if not np.array_equal(a[label][frame + 2 :], b[label][frame + 2 :], equal_nan=True)
        }
        assert all(np.array_equal(a[label][:frame], b[label][:frame], equal_nan=True) for label in a)
        assert touched == ({told["marker"]} if "marker" in told else set(told["markers"]))


@pytest.mark.parametrize("name", [n for n in CATALOGUE if CATALOGUE[n].station != "recording"])
def test_every_form_of_an_effect_acts(name, plain, tmp_path):
    """All forms by the drive's simulation or the channel's arrays alone, without writing files."""
    trials = schedule(truth(), PLAN)
    for form in CATALOGUE[name].forms:
        active = activate(Hidden(name, "index", 1.0, form), truth(), trials, SEED)
        influence = active.influence
        hooks = [
            getattr(influence, hook)
            for hook in ("drive", "proximal", "linkage", "distal", "pose", "encoder", "current", "log")
        ]
        acts = influence.terms is not None or any(hooks) or influence.world is not None or influence.clock_rate != 1.0
        assert acts, form
        assert all(np.isfinite(v) for v in active.answer["parameters"].values())


DRIVE = [n for n in CATALOGUE if CATALOGUE[n].station == "drive"]


@pytest.mark.parametrize("name", DRIVE)
def test_the_balance_still_holds_and_friction_never_drives(name):
    hand, trials = truth(), schedule(truth(), PLAN)
    motor = hand.motors["index"]
    trial = next(t for t in trials if t.name == "flexion_index")
    program = flexion(motor.controller, ("full",))
    gravity = np.tile([0.0, 0.0, -1.0], (round(program.duration_s * 1000) + 1, 1))
    plain = simulate(motor, program, start_s=trial.start_s, gravity_palm=gravity)
    for form in CATALOGUE[name].forms:
        influence = activate(Hidden(name, "index", 1.0, form), hand, trials, SEED).influence
        if influence.start:
            influence.start(trial)
        motion = simulate(motor, program, merge_terms([influence.terms]), trial.start_s, gravity)
        v, new = motion.velocity[:-1], motion.velocity[1:]
        force = motor.inertia * motion.acceleration[:-1] + motor.viscous * new + motion.friction[:-1] + motion.load[:-1]
        slides = (new != 0) | (v == 0)
        assert np.abs(force - motion.current[:-1])[slides].max() < 1e-8, form
        assert (motion.friction * motion.velocity >= 0).all(), form
        assert motion.position.max() > 80.0, form  # the finger still closes
        if name != "external_contact":  # that one waits for its moment
            assert np.abs(motion.current - plain.current).max() > 0.3, form


def friction_at(name: str, form: str, position: float, velocity: float, **parameters: float) -> float:
    """Extra friction and load, signed along the motion [raw], of an effect at a state."""
    hand = truth()
    influence = activate(Hidden(name, "index", 1.0, form, parameters), hand, schedule(hand, PLAN), SEED).influence
    now = DriveNow(position=position, velocity=velocity, direction=np.sign(velocity) or 1.0)
    motor = hand.motors["index"]
    now.spring = now.transmitted = motor.stiffness * position + motor.preload
    return sum(t(now) for t in influence.terms.friction) * now.direction + sum(t(now) for t in influence.terms.load)


def test_physics_of_the_forms():
    for form in CATALOGUE["stribeck_friction"].forms:  # falls with speed, both ways alike
        level = [
            friction_at("stribeck_friction", form, 50, v, static_excess_raw=20.0, stribeck_speed=20.0)
            for v in (0.01, 10, 40, 100)
        ]
        assert abs(level[0] - 20.0) < 0.05 and all(np.diff(level) < 0) and level[-1] < 1.5
        assert friction_at("stribeck_friction", form, 50, -40, static_excess_raw=20.0, stribeck_speed=20.0) == -level[2]
    for form in CATALOGUE["position_dependent_friction"].forms:  # odd in the direction
        up, down = (friction_at("position_dependent_friction", form, 40, v, centre_percent=40.0) for v in (30, -30))
        assert up > 0 and np.isclose(up, -down)
        assert abs(friction_at("position_dependent_friction", form, 90, 30, centre_percent=40.0)) < 1e-3
    for form in CATALOGUE["detent_load"].forms:  # even in the direction
        up, down = (friction_at("detent_load", form, 44, v, centre_percent=40.0, sign=1.0) for v in (30, -30))
        assert up > 0 and up == down
    for form in CATALOGUE["asymmetric_viscous_friction"].forms:
        for sign in (1.0, -1.0):
            flexing = friction_at("asymmetric_viscous_friction", form, 50, 80, sign=sign)
            extending = -friction_at(
                "asymmetric_viscous_friction", form, 50, -80, sign=sign
            )  # resistance while extending
            assert sign * (flexing - extending) > 0
    ripple = [friction_at("torque_ripple", "sine", p, 30, amplitude_raw=3.0, period_percent=8.0) for p in (20, 28, 24)]
    assert np.isclose(ripple[0], ripple[1]) and np.isclose(ripple[0], -ripple[2])
    assert np.isclose(friction_at("quadratic_damping", "square", 50, 100, drag_at_100_raw=16.0), 16.0)
    assert np.isclose(friction_at("quadratic_damping", "square", 50, -50, drag_at_100_raw=16.0), -4.0)
    assert (
        friction_at("load_dependent_friction", "transmitted", 90, 30)
        > friction_at("load_dependent_friction", "transmitted", 10, 30)
        > 0
    )


@pytest.mark.parametrize(("form", "inside"), [("linear", 95.0), ("open_side", 3.0)])
def test_a_stop_is_as_stiff_as_the_textbook_reads_it(form: str, inside: float) -> None:
    """By how much its load changes along a percent of the range inside it."""
    figures = {"at_percent": 88.0 if form == "linear" else 8.0, "stiffness_raw": 1.2}
    one, other = (friction_at("end_stop_contact", form, at, 1.0, **figures) for at in (inside, inside + 1.0))
    told = readings({"effect": "end_stop_contact", "form": form, "parameters": figures})
    assert told["stiffness"] == pytest.approx(other - one) and told["begin"] == figures["at_percent"]


def test_play_is_backlash():
    path = np.array([0.0, 1.0, 3.0, 2.5, 2.0, 1.0, 1.5, 4.0])
    assert np.array_equal(play(path, 1.0), [0.0, 0.0, 2.0, 2.0, 2.0, 1.0, 1.0, 3.0])
    assert np.array_equal(play(path, 0.0), path)


def test_backlash_and_couplings_in_the_true_angles(plain, tmp_path):
    """Lost motion lags by direction; what moves the distal segment leaves the proximal one alone."""
    for name, joint, form in (
        ("drive_backlash", 0, "play"),
        ("linkage_backlash", 1, "play"),
        ("distal_stop", 1, "hard"),
    ):
        answer = record(truth(), tmp_path / name, SEED, [Hidden(name, "index", form=form)], PLAN)
        angle, before = (x.trials["flexion_index"].angle_rad for x in (answer, plain))
        assert np.abs(angle[:, joint] - before[:, joint]).max() > 0.01
        if joint == 1:
            assert np.array_equal(angle[:, 0], before[:, 0])
        lag = before[:, joint] - angle[:, joint]
        assert lag.min() > -1e-9
        assert np.abs(lag[:100]).max() < 1e-9


# Strength zero is absence; but these have no size: they replace, turn the palm, or are there or not.
WITHOUT_ZERO = {"gravity_load", "presliding_friction", "command_as_measurement", "current_saturation", "buffered_log"}


def test_strength_zero_is_absence(plain, tmp_path):
    hidden = [Hidden(name, "index", 0.0) for name in CATALOGUE if name not in WITHOUT_ZERO]
    answer = record(truth(), tmp_path / "s", SEED, hidden, PLAN)
    assert len(answer.table["effects"]) == len(hidden)
    for name in ("flexion_index", "flexion_index_b"):
        before, after = columns(plain.path, name), columns(answer.path, name)
        assert all(np.array_equal(before[c], after[c], equal_nan=True) for c in before.dtype.names)
        a, b = points(plain.path / f"mocap/{name}.c3d"), points(answer.path / f"mocap/{name}.c3d")
        assert all(np.allclose(a[label], b[label], atol=1e-3, equal_nan=True) for label in a)


def test_gravity_turns_the_palm_and_records_it(tmp_path):
    plan = Plan(flexion=("full",), validation=(), excitations=1, still_s=0.2)
    answer = record(truth(), tmp_path / "s", SEED, [Hidden("gravity_load", "index")], plan)
    assert answer.trials["excitation_index_1"].palm_rotation is not None
    rotation = answer.trials["flexion_index"].palm_rotation
    turned = 2 * np.arccos(np.abs(rotation @ rotation[0]).clip(0, 1))
    assert np.degrees(turned.max()) > 20.0


@pytest.mark.parametrize("kind", KINDS)
def test_cases_are_drawn_by_seed(kind):
    first, again, other = draw_case(4, kind), draw_case(4, kind), draw_case(5, kind)
    assert first.hidden == again.hidden and first.plan == again.plan
    assert np.array_equal(first.truth.fingers[0].joints[0].axis_palm, again.truth.fingers[0].joints[0].axis_palm)
    assert first.truth.log != other.truth.log
    count = {"single": 1, "none": 0, "pair": 2, "outside": 1, "weak": 1}.get(kind)
    assert count is None or len(first.hidden) == count
    assert len(first.truth.fingers) == 2
    if kind == "messy":
        strengths = [h.strength for h in first.hidden]
        assert strengths[0] >= 1.0 and set(strengths[1:]) == {0.1} and len(strengths) > 25
    if kind == "weak":
        assert 0.4 <= first.hidden[0].strength <= 0.65
    if kind == "outside":
        assert first.hidden[0].effect in outside()


@pytest.mark.parametrize("kind", ["messy", "pair", "weak"])
def test_cases_record(kind, tmp_path):
    case = draw_case(8, kind)
    answer = replace(case, plan=replace(PLAN, flexion=("full",), excitations=1)).record(tmp_path / "s")
    assert answer.table["case"] == kind
    assert (tmp_path / "s" / "session.toml").is_file()
    motion = next(t.motion for t in answer.trials.values() if t.plan.kind == "flexion")
    assert np.isfinite(motion.position).all() and motion.position.max() > 60.0


def test_unknown_cases_are_refused():
    with pytest.raises(HandModelError, match="single"):
        draw_case(1, "singel")
    with pytest.raises(HandModelError, match="torque_ripple"):
        draw_case(1, "single", "torque_riple")
