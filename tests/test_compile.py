"""Compiled folders: names, numbers, bytes, linkages, shapes, and hands of every build."""

import dataclasses
import json

import mujoco
import numpy as np
import pytest
from folder_contents import contents
from lxml import etree
from synthetic_hand import synthetic_hand

from hand_model.check import check
from hand_model.compile import compile
from hand_model.compile.coupling import checked, linkages
from hand_model.compile.mesh import capsule_mesh
from hand_model.compile.names import named, sanitised
from hand_model.compile.shape import Capsule, capsule_inertia, segment_distance, with_tips
from hand_model.description import load, read_description
from hand_model.errors import DescriptionError, HandFileError
from hand_model.hand import Finger as HandFinger
from hand_model.hand import Hand, Joint, load_hand


def test_folder_of_a_hand_with_both_thumbs(tmp_path):
    hand = synthetic_hand(1)
    description = compile(hand, tmp_path / "out")
    files = contents(description.folder)
    for name in (
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "hand.json",
        "synthetic_left.xml",
        "synthetic_left.urdf",
        "scene_left.xml",
    ):
        assert name in files
    assert {"synthetic_left_thumb_1.xml", "synthetic_left_thumb_1.urdf"} <= set(files)
    for name in ("synthetic_left.xml", "synthetic_left.urdf"):
        assert b"thumb_0_s0" in files[name] and b"thumb_1" not in files[name]
    assert b"thumb_0" not in files["synthetic_left_thumb_1.xml"]
    assert hand.provenance["mocap/a.c3d"] in (tmp_path / "out/README.md").read_text()


def test_one_thumb_position_gives_one_pair(tmp_path):
    description = compile(synthetic_hand(1, fingers=("thumb_1", "index")), tmp_path / "out")
    assert [m.stem for m in description.models] == ["synthetic_left"]


def test_same_hand_gives_same_bytes_and_replaces_whole(tmp_path):
    hand = synthetic_hand(2, joints=3)
    compile(hand, tmp_path / "a")
    compile(synthetic_hand(3), tmp_path / "b")
    compile(hand, tmp_path / "b")
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]  # no staging folder is left


def test_nothing_is_written_where_compiling_fails(tmp_path, monkeypatch):
    def broken(*_):
        raise RuntimeError("disk full")

    compile(synthetic_hand(2), tmp_path / "out")
    before = contents(tmp_path / "out")
    monkeypatch.setattr("hand_model.compile.folder.readme", broken)
    with pytest.raises(RuntimeError):
        compile(synthetic_hand(3), tmp_path / "out")
    assert contents(tmp_path / "out") == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_foreign_folder_is_not_overwritten(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(DescriptionError, match="not a compiled hand"):
        compile(synthetic_hand(2), tmp_path)
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_hand_json_is_a_hand_file_and_compiles_to_itself(tmp_path):
    first = compile(synthetic_hand(4), tmp_path / "first")
    compile(load_hand(first.folder / "hand.json"), tmp_path / "second")
    assert (tmp_path / "first/synthetic_left.xml").read_bytes() == (tmp_path / "second/synthetic_left.xml").read_bytes()


@pytest.mark.parametrize(
    ("side", "joints", "tips"), [("left", 1, True), ("right", 2, True), ("left", 2, False), ("right", 3, False)]
)
def test_every_item_of_the_conventions_holds(tmp_path, side, joints, tips):
    description = compile(synthetic_hand(20 + joints, side, joints, tips=tips), tmp_path / "out")
    assert [f.sentence for f in check(description.folder) if not f.passed] == []


def test_a_knee_with_one_joint_and_no_log(tmp_path):
    markers = {f"s{i}": np.array([0.02 * i, 0.03, -0.1 - 0.05 * i]) for i in range(3)}
    joint = Joint("shank", np.array([0.1, 0.99, 0.0]), np.zeros(3), np.zeros((6, 6)), (-0.1, 1.9), markers)
    palm = {f"t{i}": np.array([0.02 * i, 0.03, 0.1 + 0.05 * i]) for i in range(3)}
    knee = Hand("knee", "right", palm, {}, (HandFinger("leg", None, (joint,)),), 1e-3, {})
    description = compile(knee, tmp_path / "knee")
    assert [f.sentence for f in check(description.folder) if not f.passed] == []
    model = mujoco.MjModel.from_xml_path(str(description.mjcf))
    assert (model.nq, model.nu, model.neq) == (1, 0, 0)
    assert "guess" in (description.folder / "README.md").read_text()


def test_names_are_sanitised_and_unique(tmp_path):
    hand = synthetic_hand(5, fingers=("index finger", "index_finger", "2nd/ring"))
    fingers = (dataclasses.replace(hand.fingers[0], actuator="index finger_s0"), *hand.fingers[1:])
    palm = {"P-1": np.zeros(3), "P_1": np.ones(3) * 0.01, "é": np.ones(3) * 0.02}
    hand = dataclasses.replace(hand, name="my hand", fingers=fingers, palm_markers_palm=palm)
    description = compile(hand, tmp_path / "out")
    assert description.models[0].stem == "my_hand_left"
    assert [
        f.sentence for f in check(description.folder, items=("names", "digits", "engines agree")) if not f.passed
    ] == []
    names = named(hand)
    used = [n for table in dataclasses.astuple(names) for n in table.values()]
    assert len(used) == len(set(used)) and all(n == sanitised(n) for n in used)
    assert names.marker["", "P-1"] == "marker_P_1" and names.marker["", "P_1"] == "marker_P_1_2"


def test_both_thumb_positions_may_carry_the_same_markers(tmp_path):
    hand = synthetic_hand(5, fingers=("thumb_0", "thumb_1"))
    joints = [
        tuple(
            dataclasses.replace(j, markers_palm={f"TH{k}{i}": p for i, p in enumerate(j.markers_palm.values())})
            for k, j in enumerate(f.joints)
        )
        for f in hand.fingers
    ]
    fingers = tuple(dataclasses.replace(f, joints=j) for f, j in zip(hand.fingers, joints, strict=True))
    description = compile(dataclasses.replace(hand, fingers=fingers), tmp_path / "out")
    for model in description.models:
        loaded = mujoco.MjModel.from_xml_path(str(model.mjcf))
        assert {"marker_TH00", "marker_TH12"} <= {loaded.site(i).name for i in range(loaded.nsite)}
    assert [f.sentence for f in check(description.folder, items=("names", "engines agree")) if not f.passed] == []


def test_two_fingers_on_one_actuator_both_move(tmp_path):
    hand = synthetic_hand(5, fingers=("ring", "little"))
    fingers = tuple(dataclasses.replace(f, actuator="ulnar") for f in hand.fingers)
    description = compile(dataclasses.replace(hand, fingers=fingers), tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(description.mjcf))
    assert [model.actuator(i).name for i in range(model.nu)] == ["ulnar", "ulnar_little"]


def test_mimic_is_the_best_line_within_the_limits_and_its_loss_is_true():
    finger = checked(with_tips(synthetic_hand(6, joints=3))[0].fingers[2])
    first, second = linkages(finger)
    assert (first.source, second.source) == ("s0", "s0")  # never chained
    low, high = finger.joints[0].range_rad
    driver = np.linspace(low, high, 1001)
    exact = finger.couplings[1].follower_rad(finger.couplings[0].follower_rad(driver))
    line = second.multiplier * driver + second.offset
    assert np.abs(exact - line).max() == pytest.approx(second.loss_rad, rel=1e-3)
    for nudge in ((1e-3, 0), (-1e-3, 0), (0, 1e-3), (0, -1e-3)):
        other = (second.multiplier + nudge[0]) * driver + second.offset + nudge[1]
        inside = (
            other.min() >= exact.min() - 1e-9 and other.max() <= max(exact.max(), finger.joints[2].range_rad[1]) + 1e-9
        )
        assert not inside or ((other - exact) ** 2).sum() > ((line - exact) ** 2).sum()


def test_capsule_inertia_against_summed_cubes():
    capsule = Capsule(np.array([0.01, 0.02, 0.0]), np.array([0.03, 0.01, 0.02]), 0.008)
    exact, cube = capsule_inertia(capsule), 0.0003
    low, high = np.minimum(capsule.start, capsule.end) - 0.008, np.maximum(capsule.start, capsule.end) + 0.008
    points = np.stack(np.meshgrid(*(np.arange(a, b, cube) for a, b in zip(low, high, strict=True))), -1).reshape(-1, 3)
    along = capsule.end - capsule.start
    share = np.clip((points - capsule.start) @ along / (along @ along), 0, 1)
    inside = points[np.linalg.norm(points - capsule.start - share[:, None] * along, axis=1) <= 0.008]
    mass = 1100 * cube**3
    offset = inside - inside.mean(0)
    tensor = mass * ((offset**2).sum() * np.eye(3) - offset.T @ offset)
    assert exact.mass == pytest.approx(mass * len(inside), rel=2e-3)
    assert np.allclose(exact.centre, inside.mean(0), atol=1e-5)
    assert np.allclose(exact.tensor, tensor, atol=5e-3 * np.abs(tensor).max())


def test_capsule_mesh_is_watertight():
    import trimesh

    capsule = Capsule(np.array([0.01, 0.02, 0.0]), np.array([0.03, 0.01, 0.02]), 0.008)
    own = trimesh.Trimesh(*capsule_mesh(capsule))
    assert own.is_watertight and own.is_winding_consistent and own.volume > 0
    assert np.allclose(own.center_mass, capsule_inertia(capsule).centre, atol=1e-9)


def test_segment_distance_against_sampling():
    random, share = np.random.default_rng(0), np.linspace(0, 1, 401)
    for _ in range(50):
        a, b, c, d = random.normal(size=(4, 3))
        one, two = a + share[:, None] * (b - a), c + share[:, None] * (d - c)
        sampled = np.linalg.norm(one[:, None] - two[None], axis=-1).min()
        assert segment_distance(a, b, c, d) <= sampled + 1e-12
        assert segment_distance(a, b, c, d) == pytest.approx(sampled, abs=1e-2)


def test_grips_become_keyframes_of_the_files_that_have_their_fingers(tmp_path):
    hand = dataclasses.replace(
        synthetic_hand(7), extra={"grips": {"power": {"index": 0.8, "ring": 0.8}, "key": {"thumb_1": 0.5}}}
    )
    description = compile(hand, tmp_path / "out")
    keys = [[e.get("name") for e in etree.parse(str(m.mjcf)).iter("key")] for m in description.models]
    assert keys == [["open", "close", "power"], ["open", "close", "power", "key"]]
    assert [
        f.sentence for f in check(description.folder, items=("keyframes", "contact", "names")) if not f.passed
    ] == []
    with pytest.raises(HandFileError, match='did you mean "index"'):
        compile(dataclasses.replace(hand, extra={"grips": {"power": {"indx": 0.8}}}), tmp_path / "bad")


def _with(finger, **changes):
    return dataclasses.replace(finger, **changes)


@pytest.mark.parametrize(
    ("breakage", "message"),
    [
        (lambda h: dataclasses.replace(h, fingers=()), "no finger"),
        (lambda h: dataclasses.replace(h, fingers=(h.fingers[0], h.fingers[0])), "two fingers of one name"),
        (lambda h: dataclasses.replace(h, fingers=(_with(h.fingers[0], joints=()),)), "needs joints"),
        (lambda h: _coupling(h, driver="s7"), "did you mean"),
        (lambda h: _coupling(h, coefficients=np.ones(6)), "one to five"),
        (lambda h: _coupling(h, driver="s1"), "circle"),
        (lambda h: _joint(h, centre_palm=np.array([np.nan, 0, 0])), "not finite"),
        (lambda h: _joint(h, covariance=np.full((6, 6), np.inf)), "not finite"),
    ],
)
def test_hands_that_cannot_be_compiled_are_refused(tmp_path, breakage, message):
    with pytest.raises(HandFileError, match=message):
        compile(breakage(synthetic_hand(8)), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def _coupling(hand, **changes):
    finger = hand.fingers[0]
    broken = dataclasses.replace(finger.couplings[0], **changes)
    return dataclasses.replace(hand, fingers=(_with(finger, couplings=(broken,)),))


def _joint(hand, **changes):
    finger = hand.fingers[0]
    broken = dataclasses.replace(finger.joints[0], **changes)
    return dataclasses.replace(hand, fingers=(_with(finger, joints=(broken, finger.joints[1])),))


def test_descriptions_are_found_and_refused(tmp_path):
    compile(synthetic_hand(9), tmp_path / "out")
    assert isinstance(load(tmp_path / "out"), mujoco.MjModel)
    with pytest.raises(DescriptionError, match="no hand"):
        load("bebionic_middle")
    (tmp_path / "out/synthetic_left.urdf").unlink()
    with pytest.raises(DescriptionError, match="names it"):
        read_description(tmp_path / "out")
    table = json.loads((tmp_path / "out/hand.json").read_text())
    del table["description"]
    (tmp_path / "out/hand.json").write_text(json.dumps(table))
    with pytest.raises(DescriptionError, match="not written by compile"):
        read_description(tmp_path / "out")
