"""The twin's truth is in its files: rigid markers, exact frame, angles, couplings, balance of the drive, same bytes."""

from __future__ import annotations

import hashlib
import itertools
import tomllib
from dataclasses import replace
from pathlib import Path

import ezc3d
import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval
from scipy.spatial.transform import Rotation

from hand_model.errors import HandModelError
from hand_model.session import read_session
from hand_model.twin import Hidden, Plan, bebionic, record
from hand_model.twin.geometry import compose, conjugate, landmark_frame, rotate, turn
from hand_model.twin.kinematics import sweep
from hand_model.twin.motor import simulate
from hand_model.twin.program import commands, excitation, flexion

SHORT = Plan(flexion=("full", "half"), validation=("full",), excitations=1, still_s=0.3)


def markers(path: Path) -> dict[str, np.ndarray]:
    """Label -> (n, 3) [mm], nan in gaps."""
    file = ezc3d.c3d(str(path))
    points = file["data"]["points"][:3].transpose(1, 2, 0)
    gap = file["data"]["meta_points"]["residuals"][0] < 0
    return dict(
        zip(file["parameters"]["POINT"]["LABELS"]["value"], np.where(gap[..., None], np.nan, points), strict=True)
    )


def log(path: Path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)


def pose(shape: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and translations (n, 3) that take a shape (k, 3) to frames (n, k, 3), by scipy."""
    turns = [Rotation.align_vectors(x - x.mean(0), shape - shape.mean(0))[0].as_matrix() for x in seen]
    return np.array(turns), np.array([x.mean(0) - r @ shape.mean(0) for x, r in zip(seen, turns, strict=True)])


def digest(folder: Path) -> dict[str, str]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    truth = bebionic("right", 3, ["index", "thumb_0"]).quiet()
    folder = tmp_path_factory.mktemp("twin") / "quiet"
    return truth, record(truth, folder, 3, plan=SHORT)


def test_quaternions_agree_with_scipy():
    rng = np.random.default_rng(0)
    axis, angle, points = rng.normal(size=3), rng.uniform(-3, 3, 20), rng.normal(size=(20, 3))
    want = Rotation.from_rotvec(angle[:, None] * axis / np.linalg.norm(axis))
    q = turn(axis, angle)
    assert np.allclose(rotate(q, points), want.apply(points), atol=1e-14)
    assert np.allclose(rotate(compose(q, conjugate(q)), points), points, atol=1e-14)
    assert np.allclose(rotate(compose(q, q[::-1]), points), (want * want[::-1]).apply(points), atol=1e-14)


@pytest.mark.parametrize("side", ["left", "right"])
def test_truth_is_expressed_in_its_own_landmark_frame(side):
    truth = bebionic(side, 7)
    marks = truth.landmarks_palm
    assert np.allclose(landmark_frame(marks["origin"], marks["medial"], marks["lateral"], side), np.eye(3), atol=1e-14)
    assert np.array_equal(marks["origin"], np.zeros(3))


def test_markers_are_rigid_without_noise(quiet):
    truth, answer = quiet
    for finger in truth.fingers:
        seen = markers(answer.path / "mocap" / f"flexion_{finger.name}.c3d")
        groups = [list(j.markers_palm) for j in finger.joints] + [list(truth.palm_markers_palm)]
        for group in groups:
            for a, b in itertools.pairwise(group):
                assert np.ptp(np.linalg.norm(seen[a] - seen[b], axis=1)) < 2e-3  # [mm]: float32 of the file


def test_angles_and_coupling_are_in_the_marker_file(quiet):
    """Joint angles computed from the file by an independent method are the truth's polynomials of the drive's
    position.
    """
    truth, answer = quiet
    for finger in truth.fingers:
        trial = answer.trials[f"flexion_{finger.name}"]
        seen = markers(answer.path / "mocap" / f"flexion_{finger.name}.c3d")
        steps = slice(None, None, 37)
        rotations = []
        for shape in (truth.palm_markers_palm, *(j.markers_palm for j in finger.joints)):
            frames = np.stack([seen[label][steps] for label in shape], axis=1) / 1e3
            rotations.append(pose(np.stack(list(shape.values())), frames))
        for i, joint in enumerate(finger.joints):
            (outer, t_outer), (inner, t_inner) = rotations[i], rotations[i + 1]
            vector = Rotation.from_matrix(np.swapaxes(outer, 1, 2) @ inner).as_rotvec()
            angle = vector @ joint.axis_palm
            assert np.abs(angle - trial.angle_rad[steps, i]).max() < 3e-4
            assert np.abs(vector - angle[:, None] * joint.axis_palm).max() < 3e-4
            # the centre stays where it is, seen from both segments
            still = np.einsum("nij,j->ni", inner, joint.centre_palm) + t_inner
            assert np.abs(still - np.einsum("nij,j->ni", outer, joint.centre_palm) - t_outer).max() < 2e-5
        percent = np.interp(trial.mocap_time_s, trial.motion.time_s, trial.motion.position)
        assert np.allclose(trial.angle_rad[:, 0], polyval(percent / 100, finger.proximal_rad), atol=1e-5)
        assert np.allclose(trial.angle_rad[:, 1], polyval(trial.angle_rad[:, 0], finger.distal_rad), atol=1e-5)
        assert np.abs(trial.angle_rad[:100]).max() < 1e-12  # the first second: open, at rest
        assert trial.angle_rad[:, 0].max() > 0.9 * finger.proximal_rad.sum()


def test_probe_points_at_landmarks_and_screws(quiet):
    truth, answer = quiet
    for trial in answer.trials.values():
        if trial.plan.kind not in ("landmark", "joint_probe"):
            continue
        seen = markers(answer.path / "mocap" / f"{trial.plan.name}.c3d")
        frames = np.stack([seen[label][:2] for label in truth.probe], axis=1) / 1e3
        _, tip = pose(np.stack(list(truth.probe.values())), frames)
        palm = np.stack([seen[label][:2] for label in truth.palm_markers_palm], axis=1) / 1e3
        rotation, origin = pose(np.stack(list(truth.palm_markers_palm.values())), palm)
        local = rotation[0].T @ (tip[0] - origin[0])
        if trial.plan.kind == "landmark":
            assert np.allclose(local, truth.landmarks_palm[trial.plan.landmark], atol=2e-5)
        else:
            joint = next(j for j in truth.finger(trial.plan.finger).joints if j.name == trial.plan.joint)
            away = local - joint.centre_palm
            assert np.linalg.norm(np.cross(away, joint.axis_palm)) < 2e-5
            assert 5e-3 < np.linalg.norm(away) < 12e-3


def test_log_holds_the_motion_on_its_own_clock(quiet):
    truth, answer = quiet
    trial = answer.trials["flexion_index"]
    motor = truth.motors["index"]
    columns = log(answer.path / "log" / "flexion_index.csv")
    time_s = columns["time"] - truth.log.clock_offset_s - trial.plan.start_s
    assert np.abs(time_s - trial.log_time_s).max() < 1e-5
    percent = np.interp(time_s, trial.motion.time_s, trial.motion.position)
    assert np.abs(columns["position"] - motor.counts(percent)).max() < 0.1
    assert np.abs(columns["current"] - np.interp(time_s, trial.motion.time_s, trial.motion.current)).max() < 0.5
    setpoint, speed, limit = commands(trial.plan.program, trial.log_time_s)
    assert np.array_equal(columns["speed"], speed)
    assert np.allclose(columns["setpoint"], motor.counts(setpoint))
    assert np.array_equal(columns["current_limit"], limit)


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_balance_holds_along_the_motion(seed):
    """inertia a + viscous v + friction + spring = current at every step that is no stop; sticking stays within its
    bounds.
    """
    motor = bebionic("left", seed, ["ring"]).motors["ring"]
    motion = simulate(motor, excitation(motor.controller))
    v, new = motion.velocity[:-1], motion.velocity[1:]
    force = motor.inertia * motion.acceleration[:-1] + motor.viscous * new + motion.friction[:-1] + motion.load[:-1]
    slides = (new != 0) | ((v == 0) & (new == 0))
    assert np.abs(force - motion.current[:-1])[slides].max() < 1e-9
    assert (~slides).sum() < 60  # stops are events, one step each
    spring = motor.stiffness * motion.position + motor.preload
    assert np.allclose(motion.load, spring)
    stuck = motion.velocity == 0
    assert np.abs(motion.friction[stuck]).max() <= motor.coulomb + 1e-9
    assert np.allclose(np.abs(motion.friction[~stuck]), motor.coulomb)
    assert (motion.friction * motion.velocity >= 0).all()  # friction never drives
    assert stuck.mean() > 0.05


def test_energy_of_the_drive_is_accounted_for():
    """Work of the current = kinetic energy + spring energy + dissipation, over a whole trial."""
    motor = bebionic("left", None, ["ring"]).motors["ring"]
    motion = simulate(motor, flexion(motor.controller, ("full", "slow")))
    p, v = motion.position, motion.velocity
    dp, middle = np.diff(p), 0.5 * (v[1:] + v[:-1])
    work = (motion.current[:-1] * dp).sum()
    lost = (motor.coulomb * np.abs(dp)).sum() + (motor.viscous * middle * dp).sum()
    stored = 0.5 * motor.inertia * v[-1] ** 2 + 0.5 * motor.stiffness * p[-1] ** 2 + motor.preload * p[-1]
    assert abs(work - lost - stored) < 0.005 * work


def test_integration_converges():
    motor = bebionic("left", 1, ["ring"]).motors["ring"]
    program = excitation(motor.controller)
    coarse, fine = simulate(motor, program), simulate(motor, program, step_s=5e-4)
    assert np.abs(coarse.position - np.interp(coarse.time_s, fine.time_s, fine.position)).max() < 0.25  # [%]


def test_replicates_and_programs(quiet):
    _, answer = quiet
    motor = bebionic("right", 3, ["index"]).motors["index"]
    program = flexion(motor.controller)
    closing = [m.speed_raw for m in program.moves if m.setpoint_percent == 100]
    assert max(closing.count(s) for s in closing) >= 2
    assert len(excitation(motor.controller).moves) == 12
    kinds = [t.plan.kind for t in answer.trials.values()]
    assert {"flexion", "excitation", "landmark", "joint_probe"} == set(kinds)


def test_left_and_right_are_mirror_images():
    """The published hands are mirrored within the published repeatability; the twin's own parts exactly."""
    left, right = bebionic("left"), bebionic("right")
    flip = np.array([1.0, -1.0, 1.0])
    for name, point in left.landmarks_palm.items():
        assert np.allclose(point * flip, right.landmarks_palm[name])
    for a, b in zip(left.fingers, right.fingers, strict=True):
        for i in range(2):
            axis = -flip * a.joints[i].axis_palm  # an axial vector
            assert np.degrees(np.arccos(axis @ b.joints[i].axis_palm)) < 10.0
            assert np.linalg.norm(flip * a.joints[i].centre_palm - b.joints[i].centre_palm) < 0.012
            # flexion bends towards the palm side (-z) on both hands, for the four fingers
            if not a.name.startswith("thumb"):
                for hand in (a, b):
                    along = hand.joints[1].centre_palm - hand.joints[0].centre_palm
                    assert np.cross(hand.joints[0].axis_palm, along)[2] < 0
        assert np.array_equal(a.proximal_rad, b.proximal_rad)


def test_perturbed_hands_stay_near_the_published_one():
    nominal, other = bebionic("left"), bebionic("left", 5)
    for a, b in zip(nominal.fingers, other.fingers, strict=True):
        for i in range(2):
            assert 0 < np.degrees(np.arccos(a.joints[i].axis_palm @ b.joints[i].axis_palm)) < 3.1
            assert 0 < np.linalg.norm(a.joints[i].centre_palm - b.joints[i].centre_palm) < 0.005
        for finger in (a, b):  # couplings rise over the whole range
            u = np.linspace(0, 1, 200)
            proximal = polyval(u, finger.proximal_rad)
            assert (np.diff(proximal) > 0).all() and (np.diff(polyval(proximal, finger.distal_rad)) > 0).all()


def test_same_seed_same_bytes_and_other_seed_other_bytes(tmp_path):
    truth = bebionic("left", 2, ["little"])
    record(truth, tmp_path / "a", 4, ["marker_slip"], SHORT)
    record(truth, tmp_path / "b", 4, ["marker_slip"], SHORT)
    record(truth, tmp_path / "c", 5, ["marker_slip"], SHORT)
    first, second, third = digest(tmp_path / "a"), digest(tmp_path / "b"), digest(tmp_path / "c")
    assert first == second
    assert first["log/flexion_little.csv"] != third["log/flexion_little.csv"]
    assert not any("answer" in name for name in first)


def test_marker_noise_gaps_and_ghosts_are_those_asked_for(tmp_path):
    truth = bebionic("left", None, ["index"]).quiet()
    dirty = replace(truth.mocap, noise_m=3e-4, gaps_per_minute=20.0, ghosts_per_minute=20.0)
    record(truth, tmp_path / "quiet", 1, plan=SHORT)
    record(replace(truth, mocap=dirty), tmp_path / "dirty", 1, plan=SHORT)
    clean, seen = (markers(tmp_path / name / "mocap/flexion_index.c3d") for name in ("quiet", "dirty"))
    error = np.stack([seen[k] - clean[k] for k in clean])
    assert abs(np.nanstd(error) - 0.3) < 0.02
    assert 0.001 < np.isnan(error).mean() < 0.2
    assert not np.isnan(error[:, :100]).any()
    assert len(set(seen) - set(clean)) >= 1


def test_lost_samples_jitter_and_quantisation(tmp_path):
    truth = bebionic("left", None, ["index"])
    noisy = replace(truth, log=replace(truth.log, lost_share=0.05, empty_share=0.02, current_memory_s=0.05))
    record(noisy, tmp_path / "s", 1, plan=SHORT)
    text = (tmp_path / "s/log/flexion_index.csv").read_text()
    assert ",," in text
    columns = log(tmp_path / "s/log/flexion_index.csv")
    steps = np.diff(columns["time"])
    assert steps.min() > 0.01 and np.std(steps) > 2e-3 and steps.max() > 0.03
    position = columns["position"][np.isfinite(columns["position"])]
    assert np.array_equal(position, np.round(position))


@pytest.mark.parametrize("ending", ["c3d", "tsv", "trc", "csv"])
def test_every_marker_format_is_written(tmp_path, ending):
    truth = bebionic("left", None, ["index"])
    answer = record(truth, tmp_path / "s", 1, plan=replace(SHORT, excitations=0, validation=()), mocap_format=ending)
    files = sorted(p.name for p in (answer.path / "mocap").iterdir())
    assert len(files) == 8 and all(name.endswith(ending) for name in files)
    session = read_session(answer.path)
    trial = session.select("flexion")[0].mocap()
    reference = record(truth, tmp_path / "r", 1, plan=replace(SHORT, excitations=0, validation=()))
    want = read_session(reference.path).select("flexion")[0].mocap()
    assert trial.labels == want.labels
    assert np.nanmax(np.abs(trial.position_world - want.position_world)) < 2e-6
    assert np.array_equal(np.isnan(trial.position_world), np.isnan(want.position_world))


def test_session_with_everything_is_declared(tmp_path):
    truth = bebionic("right", 9, ["index"])
    plan = replace(SHORT, grasps=(("steel", 30.0), ("foam", 3.0)), surfaces=("all",), pivot=True)
    answer = record(truth, tmp_path / "s", 2, plan=plan)
    table = tomllib.loads((answer.path / "session.toml").read_text())
    kinds = {t["kind"] for t in table["trial"]}
    assert kinds == {"pivot", "landmark", "joint_probe", "surface", "flexion", "excitation", "grasp"}
    for trial in table["trial"]:
        for key in ("mocap", "log"):
            assert key not in trial or (answer.path / trial[key]).is_file()
    stiff = answer.trials["grasp_index_steel_1"].motion
    soft = answer.trials["grasp_index_foam_1"].motion
    assert stiff.position.max() < soft.position.max()
    assert stiff.current.max() <= 160.0
    told = answer.table["grasps"]["grasp_index_foam_1"]
    assert told["stiffness"] == 3.0
    spring = truth.motors["index"].stiffness * soft.position + truth.motors["index"].preload
    touching = soft.load > spring + 1e-9
    assert soft.time_s[touching][0] == pytest.approx(told["contact_s"], abs=2e-3)
    assert soft.position[touching].min() > told["at_percent"] - 1e-9
    assert (soft.position[~touching] < soft.position.max()).all()


def test_sweeps_lie_on_the_true_surface():
    for surface in bebionic("left", 4, ["index"]).surfaces:
        point, normal = sweep(surface, np.linspace(0, 1, 500))
        local = (point - surface.centre_palm) @ surface.axes_palm.T / surface.radii_m
        assert np.allclose((local**2).sum(1), 1.0, atol=1e-12)
        gradient = local / surface.radii_m @ surface.axes_palm
        assert np.allclose(np.cross(normal, gradient), 0.0, atol=1e-9 * np.abs(gradient).max())


def test_refusals_name_what_would_be_right(tmp_path):
    with pytest.raises(HandModelError, match="index"):
        bebionic("left", None, ["indexx"])
    with pytest.raises(HandModelError, match="left, right"):
        bebionic("up", None, ["index"])
    truth = bebionic("left", None, ["index"])
    with pytest.raises(HandModelError, match="stribeck_friction"):
        record(truth, tmp_path / "a", 1, ["stribeck"], SHORT)
    with pytest.raises(HandModelError, match="form"):
        record(truth, tmp_path / "a", 1, [Hidden("torque_ripple", form="square")], SHORT)
    assert not (tmp_path / "a").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "note.txt").write_text("mine")
    with pytest.raises(HandModelError, match="empty folder"):
        record(truth, tmp_path / "full", 1, plan=SHORT)
    assert (tmp_path / "full" / "note.txt").read_text() == "mine"


def test_unrest_makes_repeated_cycles_differ(tmp_path):
    calm = bebionic("left", None, ["index"]).quiet()
    motor = replace(calm.motors["index"], unrest=1.0)
    restless = replace(calm, motors={"index": motor})
    a, b = (record(hand, tmp_path / name, 1, plan=SHORT) for name, hand in (("a", calm), ("b", restless)))
    first, second = (x.trials["flexion_index"].motion for x in (a, b))
    extra = second.load - motor.stiffness * second.position - motor.preload
    assert abs(extra.std() - 1.0) < 0.3
    assert np.abs(first.load - motor.stiffness * first.position - motor.preload).max() < 1e-9
    lag = np.corrcoef(extra[:-150], extra[150:])[0, 1]
    assert 0.15 < lag < 0.6
