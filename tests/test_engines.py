"""Engines against the project's own kinematics, and the linkages in simulation."""

import time

import numpy as np
import pytest
from synthetic_hand import synthetic_hand

from hand_model.compile import compile
from hand_model.engines import mujoco, ours, pinocchio, yourdfpy
from hand_model.errors import DescriptionError

POSES = 500


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("joints", [1, 2, 3])
def test_all_engines_agree_with_our_kinematics(tmp_path, side, joints):
    description = compile(synthetic_hand(joints, side, joints), tmp_path / "hand")
    assert len(description.models) == 2  # both positions of the thumb
    for model in description.models:
        own = ours.load(model.urdf)
        angles = {j: np.random.default_rng(0).uniform(-2, 2, POSES) for j in own.joints}
        points, links = ours.positions(own, angles), ours.poses(own, angles)
        pairs = (
            (mujoco, model.mjcf),
            (mujoco, model.scene),
            (mujoco, model.urdf),
            (pinocchio, model.urdf),
            (yourdfpy, model.urdf),
        )
        for engine, path in pairs:
            loaded = engine.load(path)
            frames, there = engine.kinematics(loaded, angles)
            for name, expected in points.items():
                assert np.abs(there[name] - expected).max() < 1e-9, (engine.__name__, path.name, name)
            for name, expected in links.items():
                assert np.abs(frames[name] - expected).max() < 1e-7, (engine.__name__, path.name, name)
        parsed = pinocchio.load(model.mjcf)  # its MJCF parser drops the sites of a root body without joint
        there = pinocchio.positions(parsed, angles)
        moving = {n for n in points if n != "attachment" and not n.startswith("marker_P")}
        assert moving <= set(there)
        assert all(np.abs(there[n] - points[n]).max() < 1e-9 for n in moving)


def test_speed_of_10000_poses_of_24_joints(tmp_path):
    hand = synthetic_hand(1, joints=3, fingers=tuple(f"f{i}" for i in range(8)))
    description = compile(hand, tmp_path / "hand")
    model = mujoco.load(description.mjcf)
    assert len(model.joints) == 24
    angles = {j: np.random.default_rng(0).uniform(-1, 1, 10000) for j in model.joints}
    start = time.perf_counter()
    mujoco.positions(model, angles)
    assert time.perf_counter() - start < 2.0


def test_simulation_moves_the_followers_along_the_polynomial(tmp_path):
    hand = synthetic_hand(2, joints=3)
    description = compile(hand, tmp_path / "hand")
    at = np.arange(0, 3, 0.01)
    noise = np.random.default_rng(0).normal(0, np.radians(0.05), at.size)
    driver = 0.55 - 0.55 * np.cos(2 * np.pi * 0.7 * at) + noise
    run = mujoco.simulate(description.mjcf, at, {"index_s0": driver})
    first = hand.finger("index").couplings[0].follower_rad(driver)
    second = hand.finger("index").couplings[1].follower_rad(first)
    assert np.abs(run.angles_rad["index_s0"] - driver).max() < 1e-12
    assert np.degrees(np.abs(run.angles_rad["index_s1"] - first).max()) < 0.1
    assert np.degrees(np.abs(run.angles_rad["index_s2"] - second).max()) < 0.1
    own = ours.load(description.mjcf)
    exact = ours.positions(own, {"index_s0": driver, "index_s1": first, "index_s2": second})
    assert all(np.abs(exact[n] - p).max() < 2e-4 for n, p in run.positions.items())
    assert not run.warnings


def test_simulation_reports_at_asked_times(tmp_path):
    description = compile(synthetic_hand(2), tmp_path / "hand")
    at, sample = np.arange(0, 1, 0.02), np.array([0.1234, 0.5])
    run = mujoco.simulate(description.mjcf, at, {"index_s0": at}, sample)
    assert np.allclose(run.angles_rad["index_s0"], sample, atol=1e-9)
    assert run.positions["index_tip"].shape == (2, 3)


def test_bad_input_is_refused(tmp_path):
    description = compile(synthetic_hand(2), tmp_path / "hand")
    model = mujoco.load(description.mjcf)
    with pytest.raises(DescriptionError, match='did you mean "index_s0"'):
        mujoco.positions(model, {"index_s00": np.zeros(3)})
    with pytest.raises(DescriptionError, match="one length"):
        mujoco.positions(model, {"index_s0": np.zeros(3), "index_s1": np.zeros(4)})
    with pytest.raises(DescriptionError, match="cannot be driven"):
        mujoco.simulate(description.mjcf, [0, 1], {"index_s1": [0, 1]})
    with pytest.raises(DescriptionError, match="without gaps"):
        mujoco.simulate(description.mjcf, [0, 1], {"index_s0": [0, np.nan]})
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot name='x'><joint/></robot>")
    for engine in (mujoco, pinocchio, yourdfpy):
        with pytest.raises(DescriptionError, match="cannot load"):
            engine.load(broken)
        with pytest.raises(DescriptionError, match="no such file"):
            engine.load(tmp_path / "absent.urdf")
    with pytest.raises(DescriptionError):
        ours.load(broken)
