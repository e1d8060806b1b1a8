"""The published BeBionic hand: true to the tables, left and right alike, its grips, and the cylinder that it holds."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from lxml import etree

from hand_model.bebionic import GRIPS, published_deviations, published_hand
from hand_model.check import check
from hand_model.check.mirror import mirror_differences
from hand_model.compile import compile
from hand_model.compile.readme import VERIFICATION
from hand_model.description import embedded, load
from hand_model.errors import HandModelError
from hand_model.kinematics import displace
from hand_model.rotation import angle_between
from hand_model.twin.published import FINGERS, published_joint

ASSETS = Path(__file__).resolve().parents[1] / "assets"


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("hands")
    return {side: compile(published_hand(side), root / f"bebionic_{side}").folder for side in ("left", "right")}


@pytest.mark.parametrize("side", ["left", "right"])
def test_axes_and_centres_in_the_mjcf_are_the_published_ones(folders, side):
    for stem, thumb in ((f"bebionic_{side}", "thumb_0"), (f"bebionic_{side}_thumb_1", "thumb_1")):
        model = mujoco.MjModel.from_xml_path(str(folders[side] / f"{stem}.xml"))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        for finger in (thumb, *FINGERS[2:]):
            axes, centres = published_joint(side, finger)
            for i, segment in enumerate(("proximal", "distal")):
                joint = model.joint(f"{finger}_{segment}").id
                assert angle_between(data.xaxis[joint], axes[i]) < 1e-9
                assert np.allclose(data.xanchor[joint], centres[i], atol=1e-12)


def test_fingers_flex_towards_the_palm_and_thumbs_towards_the_fingers():
    for side in ("left", "right"):
        for finger in published_hand(side).fingers:
            far = [max(j.range_rad, key=abs) for j in finger.joints]
            tip = displace(finger, [[0.0, 0.0], [0.1 * a for a in far]]).points(1, finger.joints[1].tip_palm)[:, 0]
            assert (tip[1, 2] - tip[0, 2] > 0) == finger.name.startswith("thumb")


def test_both_sides_pass_every_item_and_are_mirror_images(folders):
    findings = check(folders["left"], folders["right"]) + check(folders["right"], folders["left"], ("mirror",))
    assert [f.sentence for f in findings if not f.passed] == []
    assert findings[-1].item == "mirror"


def test_stated_uncertainty_is_that_of_the_tables():
    axis, centre = published_deviations()
    differences = np.array(list(mirror_differences(published_hand("left"), published_hand("right")).values()))
    assert np.degrees(axis) == pytest.approx(np.degrees(np.sqrt(np.mean(differences[:, 1] ** 2) / 4)), rel=1e-9)
    squared = differences[:, 2] ** 2 / 3  # per coordinate, two hands
    assert centre == pytest.approx(np.sqrt(squared.mean() / 2), rel=1e-9)


def test_all_grips_are_keyframes_and_the_tips_of_a_tripod_meet(folders):
    names = set()
    for stem in ("bebionic_left", "bebionic_left_thumb_1"):
        model = mujoco.MjModel.from_xml_path(str(folders["left"] / f"{stem}.xml"))
        names |= {model.key(i).name for i in range(model.nkey)}
    assert names == {"open", "close", *GRIPS}
    for side in ("left", "right"):
        model = mujoco.MjModel.from_xml_path(str(folders[side] / f"bebionic_{side}.xml"))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("tripod").id)
        mujoco.mj_kinematics(model, data)
        gap = [np.linalg.norm(data.site("thumb_0_tip").xpos - data.site(f"{f}_tip").xpos) for f in ("index", "middle")]
        assert min(gap) < 0.03


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_hand_closes_on_a_cylinder_and_holds_it_any_way_up(folders, side):
    model = mujoco.MjModel.from_xml_path(str(folders[side] / f"scene_{side}_cylinder.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("open").id)
    cylinder, hand = model.body("cylinder").id, model.body("palm").id
    mujoco.mj_forward(model, data)
    touching = {model.body(model.geom_bodyid[g]).name for c in data.contact for g in c.geom}
    assert touching <= {"cylinder", "support"}  # it lies there, the open hand does not touch it
    low, high = model.actuator_ctrlrange.T
    data.ctrl[:] = np.where(np.abs(high) > np.abs(low), high, low)

    def run(seconds):
        for _ in range(round(seconds / model.opt.timestep)):
            mujoco.mj_step(model, data)
        return data.xpos[cylinder].copy()

    run(1.0)
    data.mocap_pos[0] += [0, 0, -0.3]
    held = run(0.5)
    for gravity in np.concatenate([np.eye(3), -np.eye(3)]) * 9.81:
        model.opt.gravity[:] = gravity
        assert np.linalg.norm(run(0.5) - held) < 0.006
    fingers = {model.body(model.body_rootid[model.geom_bodyid[g]]).id for c in data.contact for g in c.geom}
    assert hand in fingers and not any(w.number for w in data.warning)
    open_hand = model.key("open").id
    data.ctrl[:] = model.key_ctrl[open_hand]
    model.opt.gravity[:] = [0, 0, -9.81]
    assert run(1.0)[2] < held[2] - 0.1  # it was the grip that held it


def test_the_wrapper_commands_the_actuated_joints_only(folders):
    for side in ("left", "right"):
        root = etree.parse(str(folders[side] / f"bebionic_{side}.ros2_control.xacro")).getroot()
        joints = {j.get("name"): j for j in root.iterfind("ros2_control/joint")}
        urdf = etree.parse(str(folders[side] / f"bebionic_{side}.urdf")).getroot()
        moving = {j.get("name"): j for j in urdf.findall("joint") if j.get("type") == "revolute"}
        assert set(joints) == set(moving)
        for name, joint in joints.items():
            assert (joint.find("command_interface") is None) == (moving[name].find("mimic") is not None)


def test_the_wrapper_expands_to_a_urdf_on_a_robot(folders):
    xacro = pytest.importorskip("xacro")
    path = folders["left"] / "bebionic_left.ros2_control.xacro"
    root = etree.fromstring(xacro.process_file(str(path), mappings={"parent": "tool0"}).toxml().encode())
    assert root.find("joint[@name='bebionic_left_mount']/parent").get("link") == "tool0"
    assert root.find("ros2_control/hardware/plugin").text == "mock_components/GenericSystem"


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_embedded_hands_are_what_the_script_makes(folders, side):
    embedded_folder = ASSETS / f"bebionic_{side}"
    made = {p.relative_to(folders[side]): p for p in folders[side].rglob("*") if p.is_file()}
    assert {p.relative_to(embedded_folder) for p in embedded_folder.rglob("*") if p.is_file()} == set(made)
    for name, path in made.items():
        here, there = path.read_bytes(), (embedded_folder / name).read_bytes()
        if name.suffix == ".stl":  # float32 of what the platform's libm gives
            assert len(here) == len(there)
        elif name.name == "README.md":
            assert here.decode().split(VERIFICATION)[0] == there.decode().split(VERIFICATION)[0]
        elif name.suffix in (".xml", ".urdf", ".json", ".xacro"):
            assert _numbers_close(here.decode(), there.decode()), name


def _numbers_close(one: str, other: str) -> bool:
    """Equal word by word, numbers to 1e-9: another platform's libm may differ in the last digit."""
    for a, b in zip(_words(one), _words(other), strict=True):
        try:
            if abs(float(a) - float(b)) > 1e-9 * max(1.0, abs(float(a))):
                return False
        except ValueError:
            if a != b:
                return False
    return True


def _words(text: str) -> list[str]:
    return text.replace('"', " ").replace(",", " ").split()


def test_load_by_name():
    assert {"bebionic_left", "bebionic_right"} <= set(embedded())
    model = load("bebionic_left")
    assert model.joint("thumb_0_proximal").id >= 0
    assert load("bebionic_right_thumb_1").joint("thumb_1_proximal").id >= 0
    assert load("bebionic_left", scene=True).geom("floor").id >= 0


def test_another_side_is_refused():
    with pytest.raises(HandModelError, match='did you mean "left"'):
        published_hand("lefty")
