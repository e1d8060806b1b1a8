"""Reading, evaluating and comparing descriptions: against the engines, on published hands, through the command's
function."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conform_hand import make_hand, transform, write_mjcf, write_urdf

from hand_model.conform import CAUSES, conform, main_check, read
from hand_model.conform.evaluate import skeleton
from hand_model.conform.fix import write_fixed
from hand_model.conform.pairing import pair_automatically, tokens
from hand_model.conform.tree import forward, half_units
from hand_model.errors import DescriptionError

HANDS = Path(__file__).resolve().parents[2] / "shared" / "hands"
REAL = {
    "allegro_left": ("allegro_hand_left.urdf", "left_hand.xml"),
    "orca_right": ("orcahand_right.urdf", "orcahand_right.mjcf"),
    "ability_right": ("ability_hand_right_large.urdf", "abh_right_large.xml"),
}
published = pytest.mark.skipif(not HANDS.is_dir(), reason="the published hands are not here")

AWKWARD = """<mujoco><compiler angle="degree" eulerseq="XYz"/>
<default><joint axis="0 1 1"/><default class="c"><joint ref="20" range="-10 30"/><site pos=".1 0 0"/></default></default>
<worldbody><frame pos="0.1 0.2 0.3" euler="10 20 30"><body name="b0" pos=".1 0 0" euler="10 20 30" childclass="c">
<joint name="j0" pos=".01 .02 0.03"/><joint name="j1" axis="1 0 0" pos="0 0 .1"/><site name="s" zaxis="1 2 3"/>
<frame pos="0 .1 .2" axisangle="1 2 3 40"><joint name="j2" class="main" pos=".1 0 0" axis="0 0 1"/>
<body name="b1" xyaxes="1 0 .2 .1 1 0"><joint name="j3" class="c" type="slide" axis="1 1 0"/><site name="s2" quat="1 2 3 4"/></body>
</frame></body></frame></worldbody>
<equality><joint joint1="j0" joint2="j1" polycoef="0.3"/></equality></mujoco>"""


def files(name: str) -> tuple[Path, Path, Path]:
    urdf, mjcf = REAL[name]
    return HANDS / name / urdf, HANDS / name / mjcf, HANDS / name / "pair.toml"


def test_mjcf_is_read_as_mujoco_compiles_it(tmp_path):
    """Nested frames, classes, several joints in a body, joints in frames, pos, ref, slides, every orientation:
    1e-12."""
    import mujoco

    path = tmp_path / "awkward.xml"
    path.write_text(AWKWARD)
    tree = read(path)
    model = mujoco.MjModel.from_xml_string(skeleton(tree))
    data = mujoco.MjData(model)
    names = [j.name for j in tree.joints]
    for q in np.random.default_rng(0).normal(size=(5, 4)):
        for name, value in zip(names, q, strict=True):
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        out = forward(tree, {n: np.array([v]) for n, v in zip(names, q, strict=True)}, range(len(tree.nodes)))
        for node, (rotation, position) in zip(tree.nodes, out, strict=True):
            if node.kind == "hidden" or node.name == "world":
                continue
            there = data.site(node.name) if node.kind == "site" else data.body(node.name)
            np.testing.assert_allclose(position[0], there.xpos, atol=1e-12)
            np.testing.assert_allclose(rotation[0], there.xmat.reshape(3, 3), atol=1e-12)
    compiled = mujoco.MjModel.from_xml_string(
        AWKWARD.replace('zaxis="1 2 3"/>', 'zaxis="1 2 3"/><geom size=".1"/>').replace(
            "</body>", '<geom size=".1"/></body>'
        )
    )
    coupling = tree.joint("j0").coupling
    assert coupling.coefficients == pytest.approx(compiled.eq_data[0][:5])
    assert tree.joint("j0").limits == pytest.approx(compiled.joint("j0").range)
    assert (coupling.driver_ref, coupling.follower_ref) == pytest.approx(tuple(compiled.qpos0[[1, 0]]))


@pytest.mark.parametrize("side", ["left", "right"])
def test_own_kinematics_against_yourdfpy_and_both_engines(side, tmp_path):
    import yourdfpy

    links = make_hand(12, side)
    urdf, mjcf = write_urdf(links, tmp_path / "a.urdf"), write_mjcf(links, tmp_path / "b.xml", frames=1)
    report = conform(urdf, mjcf, poses=50, engines=("mujoco", "pinocchio"))
    assert report.ok and "pinocchio agrees" in report.evaluated_by and "mujoco agrees" in report.evaluated_by
    robot = yourdfpy.URDF.load(str(urdf), load_meshes=False)
    tree = read(urdf)
    rng = np.random.default_rng(1)
    drivers = robot.actuated_joint_names
    for _ in range(10):
        q = {n: rng.uniform(-0.1, 1.0) for n in drivers}
        robot.update_cfg(q)
        settled = tree.resolve_couplings({n: np.array([v]) for n, v in q.items()})
        out = forward(tree, settled, range(len(tree.nodes)))
        for node, (rotation, position) in zip(tree.nodes, out, strict=True):
            there = robot.get_transform(node.name, "palm_base")
            np.testing.assert_allclose(position[0], there[:3, 3], atol=1e-9)
            np.testing.assert_allclose(rotation[0], there[:3, :3], atol=1e-9)


def test_what_mujoco_writes_agrees_within_its_six_digits(tmp_path):
    """MjSpec.to_xml keeps six digits: about 1e-4 mm, which passes and is said."""
    import mujoco

    links = make_hand(13)
    urdf, mjcf = write_urdf(links, tmp_path / "a.urdf"), write_mjcf(links, tmp_path / "b.xml")
    spec = mujoco.MjSpec.from_string(skeleton(read(mjcf)))
    for joint in spec.joints:
        joint.range = np.array(next(k for k in links if k.joint == joint.name).limits)
    spec.compile()
    (tmp_path / "c.xml").write_text(spec.to_xml())
    report = conform(urdf, tmp_path / "c.xml", poses=20)
    assert set(report.causes) == {"coupling_missing"}, report.text()  # the skeleton has no equalities
    assert [f.cause for f in report.findings if f.layer == 3] == ["numbers_rounded"]
    assert 1e-6 < report.findings[-1].figures["shift_mm"] < 1e-3


@published
def test_allegro_left():
    """Index and ring numbered from the other side, and the thumb's second origin with the sign of a right hand's."""
    urdf, mjcf, pair = files("allegro_left")
    report = conform(urdf, mjcf, pair, poses=20, engines=("mujoco", "pinocchio"))
    assert report.causes == ("joints_exchanged", "axis_shifted")
    exchanged, shifted = (next(f for f in report.findings if f.cause == c) for c in report.causes)
    assert set(exchanged.where) == {f"joint_{k}.0" for k in (0, 1, 2, 3, 8, 9, 10, 11)}
    assert shifted.where == ("joint_13.0",) and shifted.figures["shift_mm"] == pytest.approx(10, abs=1e-3)
    assert conform(urdf, mjcf, poses=20).causes == ("axis_shifted",)  # unaided, the axes pair the fingers rightly


@published
def test_orca_right():
    """Seven refs that the URDF has dropped, each with its angle, and nothing else."""
    import mujoco

    urdf, mjcf, pair = files("orca_right")
    report = conform(urdf, mjcf, pair, poses=20, engines=("mujoco", "pinocchio"))
    model = mujoco.MjModel.from_xml_string(skeleton(read(mjcf)))
    refs = {model.joint(j).name: model.qpos0[j] for j in range(model.njnt) if model.qpos0[j]}
    assert report.causes == ("offset_dropped",) and len(refs) == 7
    assert {f.where[0]: f.figures["offset_rad"] for f in report.findings} == pytest.approx(refs, abs=1e-6)
    assert report.explained_mm < 1e-6


@published
def test_ability_right():
    """Knuckles rounded to a millimetre, fingertips 39.05 deg from the same zero, couplings and limits that differ."""
    urdf, mjcf, pair = files("ability_right")
    report = conform(urdf, mjcf, pair, poses=20, engines=("mujoco", "pinocchio"))
    by = {c: [f for f in report.findings if f.cause == c and f.disagrees] for c in report.causes}
    assert set(by) == {"numbers_rounded", "offset_dropped", "coupling_missing", "limits_differ"}
    assert set(by["numbers_rounded"][0].where) == {f"{n}_q1" for n in ("index", "middle", "ring", "pinky")}
    assert 0.2 < by["numbers_rounded"][0].figures["shift_mm"] <= 0.5 * np.sqrt(3)
    offset = 0.766 - 2 * np.arctan2(0.0422244, 0.999108)
    assert [f.figures["offset_rad"] for f in by["offset_dropped"]] == pytest.approx([offset] * 4, abs=1e-3)
    assert {f.where[0] for f in by["coupling_missing"]} == {f"{n}_q2" for n in ("index", "middle", "ring", "pinky")}
    assert any("rrpy" in w for w in report.warnings)


@published
@pytest.mark.parametrize("correct", ["a", "b"])
@pytest.mark.parametrize("name", list(REAL))
def test_a_corrected_copy_of_each_published_hand_passes(name, correct, tmp_path):
    urdf, mjcf, pair = files(name)
    fixed = write_fixed(urdf, mjcf, pair, tmp_path, correct=correct, poses=20, engines=("mujoco", "pinocchio"))
    assert fixed.report.ok and fixed.changed, fixed.report.text()
    assert not list(tmp_path.glob("*.part"))


@published
@pytest.mark.parametrize("name", list(REAL))
def test_automatic_pairing_of_the_published_hands(name):
    """What is paired unaided is what pair.toml says, but for the fingers of the Allegro that it exchanges."""
    import tomllib

    urdf, mjcf, pair = files(name)
    truth = {v: k for k, v in tomllib.loads(pair.read_text())["joints"].items()}
    found = dict(pair_automatically(read(urdf), read(mjcf)).joints)
    wrong = {x for x in truth if found[x] != truth[x]}
    assert wrong == ({f"joint_{k}.0" for k in (0, 1, 2, 3, 8, 9, 10, 11)} if name == "allegro_left" else set())


def test_names_that_only_their_tokens_share(tmp_path):
    links = make_hand(14)
    urdf = write_urdf(links, tmp_path / "a.urdf")
    mjcf = write_mjcf(links, tmp_path / "b.xml")
    text = mjcf.read_text()
    for long, short in (("index", "FF"), ("middle", "MF"), ("ring", "RF"), ("little", "LF"), ("thumb", "TH")):
        for k in range(1, 6):
            text = text.replace(f'"{long}_{k}"', f'"rh_{short}J{k}"')
    mjcf.write_text(text)
    assert tokens("rh_FFJ4") == tokens("index_joint_4")
    report = conform(urdf, mjcf, poses=5)
    assert report.ok and {j.paired_by for j in report.joints} == {"name", "tokens"}, report.text()


def test_names_that_say_nothing_and_another_base_frame(tmp_path):
    """Numbered joints are paired by place and shape, also when the two base frames differ."""
    links = make_hand(15)
    urdf = write_urdf(links, tmp_path / "a.urdf", tips=False)
    turned = transform([0.4, 1.2, -0.7], [0.03, 0.02, 0.05])
    mjcf = write_mjcf(links, tmp_path / "b.xml", frames=1, tips=False, base=turned)
    text = mjcf.read_text()
    for n, link in enumerate(sorted(links, key=lambda k: k.joint[::-1])):
        text = text.replace(f'"{link.joint}"', f'"q{n}"').replace(f'"{link.name}"', f'"part{n}"')
    mjcf.write_text(text)
    report = conform(urdf, mjcf, poses=5)
    truth = {link.joint: f"q{n}" for n, link in enumerate(sorted(links, key=lambda k: k.joint[::-1]))}
    assert {j.a: j.b for j in report.joints} == truth
    assert report.ok, report.text()
    assert report.base_deg == pytest.approx(np.degrees(np.linalg.norm([0.4, 1.2, -0.7])), abs=1e-6)
    assert report.base_mm == pytest.approx((30, 20, 50), abs=1e-6)


def test_exit_codes_and_output(tmp_path, capsys):
    links = make_hand(16)
    urdf, mjcf = write_urdf(links, tmp_path / "a.urdf"), write_mjcf(links, tmp_path / "b.xml")
    assert main_check(urdf, mjcf, poses=5) == 0
    assert capsys.readouterr().out.startswith("AGREE")
    links[3].limits = (0.0, 1.0)
    write_urdf(links, urdf)
    assert main_check(urdf, mjcf, poses=5, json=True) == 1
    table = json.loads(capsys.readouterr().out)
    assert (
        table["ok"] is False
        and table["findings"][0]["cause"] == "limits_differ"
        and table["findings"][0]["cause"] in CAUSES
    )
    assert main_check(urdf, mjcf, poses=5, fix=tmp_path / "fixed") == 1
    assert "The corrected copies agree." in capsys.readouterr().out
    assert main_check(tmp_path / "absent.urdf", mjcf) == 2
    out = capsys.readouterr()
    assert out.out == "" and "no such file" in out.err


@pytest.mark.parametrize(
    "text, said",
    [
        ("<robot/>", "root link"),
        ("<html/>", "neither a URDF"),
        ("not xml", "not XML"),
        ('<robot><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="c"/></joint></robot>', 'no link "c"'),
        ('<robot><link name="a"/><link name="b"/><joint name="j" type="hinge"><parent link="a"/><child link="b"/></joint></robot>', "type 'hinge'"),
        ('<mujoco><worldbody><replicate count="2"><body/></replicate></worldbody></mujoco>', "replicate"),
        ('<mujoco><worldbody><body><joint type="ball"/></body></worldbody></mujoco>', "'ball'"),
        ('<mujoco><worldbody><body><joint axis="0 0 0"/></body></worldbody></mujoco>', "length zero"),
        ('<mujoco><worldbody><body pos="0 x 0"/></worldbody></mujoco>', "not a list of numbers"),
        ('<mujoco><worldbody><body/></worldbody></mujoco>', "no moving joint"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(text, said, tmp_path):
    good = write_urdf(make_hand(0), tmp_path / "good.urdf")
    bad = tmp_path / "bad.xml"
    bad.write_text(text)
    with pytest.raises(DescriptionError, match=said) as error:
        conform(bad, good, poses=2)
    assert "bad.xml" in str(error.value) and "\n" not in str(error.value)


def test_a_pair_file_that_errs(tmp_path):
    links = make_hand(0)
    urdf, mjcf, pair = (
        write_urdf(links, tmp_path / "a.urdf"),
        write_mjcf(links, tmp_path / "b.xml"),
        tmp_path / "pair.toml",
    )
    for text, said in (
        ('[joints]\n"index_1" = "index_11"', "did you mean"),
        ("[joints]", "missing or empty"),
        ('[joint]\n"index_1" = "index_1"', 'unknown key "joint"'),
        ('[joints]\n"index_1" = "index_1"\n"index_2" = "index_1"', "twice"),
        ('base = { a = "palm_base", b = "palm_base" }\n[joints]\n"index_1" = "index_1"', "base should read"),
    ):
        pair.write_text(text)
        with pytest.raises(DescriptionError, match=said):
            conform(urdf, mjcf, pair, poses=2)


def test_last_digits():
    assert half_units("0.0384 0 0.1234") == pytest.approx([5e-5, 5e-5, 5e-5])
    assert half_units("38.472723e-3") == pytest.approx([5e-10])
    assert half_units("0.05")[0] == pytest.approx(5e-4)


def test_the_pytest_plugin(tmp_path):
    """One ini line; a disagreement fails with the report, an agreement passes."""
    links = make_hand(0)
    write_urdf(links, tmp_path / "a.urdf"), write_mjcf(links, tmp_path / "b.xml")
    (tmp_path / "pytest.ini").write_text("[pytest]\nhand_conform = a.urdf b.xml\n")
    command = [sys.executable, "-m", "pytest", "-p", "hand_model.pytest_plugin", "-q"]
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0 and "1 passed" in run.stdout, run.stdout + run.stderr
    links[5].axis = -links[5].axis
    write_urdf(links, tmp_path / "c.urdf")
    command += ["--hand-conform", "c.urdf", "b.xml"]
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "1 failed, 1 passed" in run.stdout and "sign_flipped" in run.stdout, run.stdout


@pytest.mark.parametrize("seed", [9, 11, 15])
def test_another_base_frame_is_a_convention_also_with_one_joint_at_the_base(seed, tmp_path):
    rng = np.random.default_rng(seed)
    links, turned = make_hand(seed), transform(rng.normal(size=3), 0.05 * rng.normal(size=3))
    urdf, mjcf = write_urdf(links, tmp_path / "a.urdf"), write_mjcf(links, tmp_path / "b.xml", digits=7, base=turned)
    report = conform(urdf, mjcf, poses=5)
    assert report.ok, report.text()
    np.testing.assert_allclose(report.base_mm, turned[:3, 3] * 1e3, atol=1e-3)
