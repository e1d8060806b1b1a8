"""Joints that are no plain hinges: their kinematics, their file, their MJCF, and planted ones recovered through the
compiled file."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from chain_data import BODY, finger_chain
from lxml import etree
from scipy.linalg import expm
from synthetic_hand import synthetic_hand

from hand_model.check import check
from hand_model.compile import compile
from hand_model.compile.course import without_courses
from hand_model.course import ranges, value
from hand_model.diagnose import finger as judging
from hand_model.diagnose.finger import _held_out
from hand_model.diagnose.locate.angles import finger_angles
from hand_model.diagnose.locate.course import _chosen, _Observed, _solve, finger_courses
from hand_model.diagnose.locate.markers import corrected_angles, name_markers
from hand_model.diagnose.prove.markers import OWN, marker_fit, of_chain
from hand_model.diagnose.prove.write_course import with_chains, written_courses
from hand_model.engines import mujoco as engine
from hand_model.errors import HandFileError
from hand_model.hand import Course, ExtraJoint, Finger, Hand, Joint, load_hand
from hand_model.identify.chain import Chain, jacobians, propagate
from hand_model.identify.identification import palm_shape
from hand_model.kinematics import displace
from hand_model.rotation import angle_between, perpendicular_basis, skew
from hand_model.session import read_session
from hand_model.twin import Plan, bebionic, record
from hand_model.twin.influence import Hidden, activate
from hand_model.twin.kinematics import segment_markers
from hand_model.twin.schedule import schedule

SHAPES = {"hinge": [0.0, 0.02, -0.05, 0.03, 0.01], "slide": [0.0, 5e-4, 1e-3, -2e-3]}


def crooked(hand: Hand, finger: str, k: int, kinds: tuple[str, ...], turning: bool) -> Hand:
    """The hand with a course of those extra joints at joint k of a finger."""

    def bent(joint: Joint) -> Joint:
        across = perpendicular_basis(joint.axis_palm)
        extra = tuple(ExtraJoint(kind, across[i % 2], np.array(SHAPES[kind])) for i, kind in enumerate(kinds))
        return replace(joint, course=Course(extra, turning))

    def with_it(own: Finger) -> Finger:
        return replace(own, joints=tuple(bent(j) if i == k else j for i, j in enumerate(own.joints)))

    return replace(hand, fingers=tuple(with_it(f) if f.name == finger else f for f in hand.fingers))


def two() -> Hand:
    hand = crooked(synthetic_hand(3), "index", 0, ("slide", "slide", "hinge"), False)
    return crooked(hand, "ring", 1, ("hinge", "hinge"), True)


def transform(joint: Joint, angle: float) -> np.ndarray:
    """Displacement (4, 4) of a joint as a product of exponentials (Lynch & Park 2017, eq. 4.14)."""

    def exponential(kind: str, axis: np.ndarray, by: float) -> np.ndarray:
        twist = np.zeros((4, 4))
        if kind == "hinge":
            twist[:3, :3], twist[:3, 3] = skew(axis), -np.cross(axis, joint.centre_palm)
        else:
            twist[:3, 3] = axis
        return expm(twist * by)

    parts = [exponential("hinge", joint.axis_palm, angle)]
    extra = [
        exponential(e.kind, e.axis_palm, float(value(e, angle))) for e in (joint.course.joints if joint.course else ())
    ]
    parts = [*parts, *extra] if joint.course and joint.course.turning else [*extra, *parts]
    return np.linalg.multi_dot([np.eye(4), *parts])


@pytest.mark.parametrize("finger", ["index", "ring"])
def test_displacement_is_the_product_of_exponentials_and_its_jacobian_the_difference(finger: str) -> None:
    own = two().finger(finger)
    angles, step = np.random.default_rng(0).uniform(-1, 1.3, (4, 2)), 1e-6
    motion = displace(own, angles)
    for pose, row in enumerate(angles):
        wanted = np.eye(4)
        for i, (joint, angle) in enumerate(zip(own.joints, row, strict=True)):
            wanted = wanted @ transform(joint, angle)
            assert np.allclose(motion.rotation[pose, i], wanted[:3, :3], atol=1e-13)
            assert np.allclose(motion.translation[pose, i], wanted[:3, 3], atol=1e-13)
    points = np.random.default_rng(1).normal(0, 0.05, (5, 3))
    for j in range(2):
        ahead, behind = (displace(own, angles + s * step * np.eye(2)[j]) for s in (1, -1))
        numeric = (ahead.points(1, points) - behind.points(1, points)) / (2 * step)
        assert np.allclose(motion.point_jacobian(1, points)[..., j], numeric, atol=1e-9)


def test_a_chain_with_courses_moves_as_the_hand_does() -> None:
    hand, angles, step = two(), np.random.default_rng(2).uniform(0, 1.2, (5, 2)), 1e-6
    for own in (hand.finger("index"), hand.finger("ring")):
        markers = [np.stack(list(j.markers_palm.values())) for j in own.joints]
        body = np.repeat([1, 2], [len(m) for m in markers])
        chain = Chain(
            np.concatenate(markers),
            np.stack([j.axis_palm for j in own.joints]),
            np.stack([j.centre_palm for j in own.joints]),
            tuple(j.course for j in own.joints),
        )
        x, by_frame, _, _ = jacobians(chain, body, angles)
        wanted = np.concatenate([displace(own, angles).points(k, markers[k]) for k in range(2)], axis=1)
        assert np.allclose(x, wanted, atol=1e-14)
        for j in range(2):
            ahead, behind = (propagate(chain, body, angles + s * step * np.eye(2)[j])[0] for s in (1, -1))
            assert np.allclose(by_frame[..., 6 + j], (ahead - behind) / (2 * step), atol=1e-9)


def test_the_file_holds_a_course_and_older_files_have_none(tmp_path) -> None:
    hand = two()
    hand.save(tmp_path / "a.hand")
    again = load_hand(tmp_path / "a.hand")
    again.save(tmp_path / "b.hand")
    assert (tmp_path / "a.hand").read_bytes() == (tmp_path / "b.hand").read_bytes()
    course, read = hand.finger("index").joints[0].course, again.finger("index").joints[0].course
    assert read.turning == course.turning and [e.kind for e in read.joints] == ["slide", "slide", "hinge"]
    assert all(np.array_equal(a.coefficients, b.coefficients) for a, b in zip(read.joints, course.joints, strict=True))
    synthetic_hand(3).save(tmp_path / "plain.hand")
    assert "course" not in (tmp_path / "plain.hand").read_text()
    assert all(j.course is None for f in load_hand(tmp_path / "plain.hand").fingers for j in f.joints)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "screw"}, "screw"),
        ({"axis_palm": np.ones(3)}, "length one"),
        ({"coefficients": np.array([0.1, 0.2])}, "first zero"),
    ],
)
def test_what_no_file_can_hold_is_refused(tmp_path, change, said: str) -> None:
    hand = two()
    index = hand.finger("index")
    joint = index.joints[0]
    bad = replace(joint, course=replace(joint.course, joints=(replace(joint.course.joints[0], **change),)))
    fingers = tuple(replace(index, joints=(bad, *index.joints[1:])) if f is index else f for f in hand.fingers)
    with pytest.raises(HandFileError, match=said):
        compile(replace(hand, fingers=fingers), tmp_path / "hand")


def test_the_compiled_files_are_the_course(tmp_path) -> None:
    hand = two()
    description = compile(hand, tmp_path / "hand")
    items = ("names", "digits", "engines agree", "coupling", "keyframes")
    assert all(f.passed for f in check(tmp_path / "hand", items=items))
    mj = engine.load(description.mjcf)
    ties = {mj.mj.joint(j).name: (mj.mj.joint(driver).name, c) for j, (driver, c) in mj.courses.items()}
    assert set(ties) == {
        "index_s0_travel",
        "index_s0_travel_2",
        "index_s0_wobble",
        "ring_s1_wobble",
        "ring_s1_wobble_2",
    }
    for (name, (driver, polynomial)), extra in zip(
        sorted(ties.items()),
        [*hand.finger("index").joints[0].course.joints, *hand.finger("ring").joints[1].course.joints],
        strict=True,
    ):
        assert driver == name.split("_travel")[0].split("_wobble")[0]
        assert np.array_equal(polynomial[: len(extra.coefficients)], extra.coefficients)
    text = (tmp_path / "hand" / "README.md").read_text()
    assert "| index | s0 | slide, slide, hinge |" in text
    table = json.loads((tmp_path / "hand" / "hand.json").read_text())["description"]["models"][0]["courses"]
    assert table["ring_s1_wobble_2"]["hinge"] == "ring_s1" and table["index_s0_travel"]["urdf_loss_tip_m"] > 1e-4
    again = compile(load_hand(tmp_path / "hand" / "hand.json"), tmp_path / "again")
    assert again.mjcf.read_bytes() == description.mjcf.read_bytes()
    files = description.urdf, compile(without_courses(hand), tmp_path / "plain").urdf
    joints = [[(j.get("name"), j.find("origin").get("xyz")) for j in etree.parse(str(f)).iter("joint")] for f in files]
    assert joints[0] == joints[1]


def test_a_moving_drive_keeps_the_extra_joints_on_their_course(tmp_path) -> None:
    import mujoco

    description = compile(two(), tmp_path / "hand")
    model = engine.load(description.mjcf)
    mj, data = model.mj, mujoco.MjData(model.mj)
    low, high = mj.key("open").ctrl, mj.key("close").ctrl
    worst = 0.0
    for i in range(2000):
        data.ctrl[:] = low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * i * mj.opt.timestep))
        mujoco.mj_step(mj, data)
        wanted = engine.on_linkages(mj, data.qpos)
        worst = max(worst, *(abs(wanted[mj.jnt_qposadr[j]] - data.qpos[mj.jnt_qposadr[j]]) for j in model.courses))
    assert not engine.raised(data) and worst < 1e-4  # rad, m
    pushed = 0.0
    for _ in range(300):
        data.xfrc_applied[mj.body("index_s1_link").id, :3] = 1.0, 0.0, -1.0  # N
        mujoco.mj_step(mj, data)
        wanted = engine.on_linkages(mj, data.qpos)
        pushed = max(pushed, *(abs(wanted[mj.jnt_qposadr[j]] - data.qpos[mj.jnt_qposadr[j]]) for j in model.courses))
    assert pushed < 3e-4 and not engine.raised(data)
    course = two().finger("index").joints[0].course
    assert all(low < high for low, high in ranges(course, 0.0, 1.0))


PLANTED = [
    ("joint_wobble", "wave", 0),
    ("joint_wobble", "bow", 1),
    ("moving_centre", "ellipse", 0),
    ("moving_centre", "cam", 1),
]
TIP = np.array([0.026, 0.002, 0.003])  # from the last joint's centre


@pytest.mark.parametrize(("effect", "form", "joint"), PLANTED)
def test_a_planted_course_is_recovered_at_the_tip_through_the_compiled_file(
    tmp_path, monkeypatch, effect: str, form: str, joint: int
) -> None:
    truth = bebionic("left", 31, ["index"])
    plan = Plan(
        flexion=("full", "slow"), validation=("full", "medium"), excitations=0, joint_sides=("medial",), still_s=0.3
    )
    hidden = Hidden(effect, "index", 1.0, form, {"joint": joint})
    record(truth, tmp_path / "session", 31, (hidden,), plan)
    session = read_session(tmp_path / "session")
    angles = finger_angles(session, session.fingers[0], palm_shape(session))
    naming = name_markers(angles)
    assert {e.effect for e in naming.found} == {effect}
    left = name_markers(corrected_angles(angles, naming))  # what is named is taken out, and hinges are left
    assert left.excess_before < naming.excess_after + 0.005 * naming.excess_before, (
        left.excess_before,
        naming.excess_after,
        naming.excess_before,
    )
    segment = session.fingers[0].segments[joint].name
    courses = finger_courses(angles, naming, {(effect, segment)})
    assert courses.joints == (joint,)
    fit = marker_fit(courses, of_chain(courses.plain, courses.body), of_chain(courses.coursed, courses.body), OWN)
    assert fit["held_out"] and fit["after"] < 1.05 * fit["noise_floor"]
    assert fit["before"] - fit["after"] > 0.8 * (fit["before"] - fit["noise_floor"])
    markers, found, proved = _held_out(angles, naming)
    assert markers is naming and proved.joints == (joint,) and [(f.effect, f.fit) for _, f in found] == [(effect, fit)]
    misled = replace(courses, plain=courses.coursed, coursed=courses.plain)
    monkeypatch.setattr(judging, "finger_courses", lambda *_: misled)
    markers, found, proved = _held_out(angles, naming)
    assert not markers.found and not found and proved is None

    finger = truth.fingers[0]
    hand = _true_hand(truth, finger)
    stated = written_courses(hand, (SimpleNamespace(effect=effect, where={"finger": "index"}),), {"index": courses})
    assert stated
    elsewhere = replace(hand, palm_markers_palm={label: 1.2 * p for label, p in hand.palm_markers_palm.items()})
    assert not written_courses(
        elsewhere, (SimpleNamespace(effect=effect, where={"finger": "index"}),), {"index": courses}
    )
    driver = np.linspace(0, float(finger.proximal_rad.sum()), 60)
    bent = np.stack([driver, np.polynomial.polynomial.polyval(driver, finger.distal_rad)], axis=1)
    wanted = _true_tip(truth, finger, hidden, plan, bent)
    off = {}
    for name, chain in (("plain", lambda c: c.plain), ("coursed", lambda c: c.coursed)):
        description = compile(with_chains(hand, stated, chain), tmp_path / name)
        model = engine.load(description.mjcf)
        found = engine.positions(model, dict(zip(("index_proximal", "index_distal"), bent.T, strict=True)))["index_tip"]
        off[name] = float(np.sqrt(np.mean(np.sum((found - wanted) ** 2, axis=1))))
    assert off["coursed"] < 4e-4 and off["coursed"] < 0.6 * off["plain"], off


def _true_hand(truth, finger) -> Hand:
    """The twin's finger as a hand of plain hinges, with its tip."""
    joints = []
    for k, own in enumerate(finger.joints):
        tip = own.centre_palm + TIP if k == 1 else None
        joints.append(
            Joint(own.name, own.axis_palm, own.centre_palm, np.zeros((6, 6)), (0.0, 1.2), own.markers_palm, tip)
        )
    return Hand("twin", truth.side, truth.palm_markers_palm, {}, (Finger("index", None, tuple(joints)),), 1e-4, {})


def _true_tip(truth, finger, hidden, plan, bent: np.ndarray) -> np.ndarray:
    """Positions (n, 3) [m] of the tip in the palm frame by the twin's own kinematics."""
    trials = schedule(truth, plan)
    influence = activate(hidden, truth, trials, 31).influence
    last = finger.joints[1]
    tipped = replace(finger, joints=(finger.joints[0], replace(last, markers_palm={"tip": last.centre_palm + TIP})))
    return segment_markers(tipped, bent, [influence], trials[-1], np.zeros(len(bent)))["tip"]


@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_what_another_hinge_explains_is_left_to_the_hinge(kind: str) -> None:
    chain = finger_chain(4)
    drive = np.tile(0.5 - 0.5 * np.cos(np.linspace(0, 2 * np.pi, 150)), 3)
    angle = np.stack([1.3 * drive, 1.1 * drive**2], axis=1)
    noise = np.random.default_rng(5).normal(0, 3e-5, (len(angle), 9, 3))
    observed = _Observed(propagate(chain, BODY, angle)[0] + noise, np.ones((len(angle), 27, 1)), angle, BODY, 3e-5)
    tilted = chain.moved(np.r_[np.zeros(27), 0.03, -0.02, 1e-3, -1e-3, np.zeros(4)])
    form = _chosen(tilted, observed, (), 0, kind == "hinge", kind == "slide")
    solved = _solve(tilted, observed, [form])
    reached = max(np.ptp(ends) for ends in ranges(solved.chain.courses[0], 0.0, 1.3))
    assert reached < {"hinge": 5e-3, "slide": 6e-4}[kind], reached
    assert float(np.degrees(angle_between(solved.chain.axis_palm[0], chain.axis_palm[0]))) < 0.4
    assert solved.cost < 1.05 * noise.size
