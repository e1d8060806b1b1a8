"""Each cause planted in a correct hand, at every joint, left and right: found, named, located; none on the correct
hand."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from conform_hand import FINGERS, Link, make_hand, mirror, rotation, transform, write_mjcf, write_urdf

from hand_model.conform import conform
from hand_model.conform.fix import write_fixed

POSES = 3


def across(link: Link, seed: int) -> np.ndarray:
    """A unit vector across the axis, in the link's frame."""
    v = np.cross(link.axis, np.random.default_rng(seed).normal(size=3))
    return v / np.linalg.norm(v)


def sign_flipped(links, i):
    links[i].axis = -links[i].axis


def offset_dropped(links, i):
    links[i].origin = links[i].origin @ transform(0.2 * links[i].axis, [0, 0, 0])


def axis_shifted(links, i):
    links[i].origin[:3, 3] += links[i].origin[:3, :3] @ (1e-3 * across(links[i], i))


def axis_shifted_by_10_micrometres(links, i):
    links[i].origin[:3, 3] += links[i].origin[:3, :3] @ (1e-5 * across(links[i], i))


def axis_tilted(links, i):
    links[i].axis = rotation(0.01 * across(links[i], i)) @ links[i].axis


def axis_tilted_with_its_link(links, i):
    links[i].origin = links[i].origin @ transform(0.01 * across(links[i], i), [0, 0, 0])


def limits_differ(links, i):
    links[i].limits = (links[i].limits[0], links[i].limits[1] + 0.1)


def limits_degrees(links, i):
    links[i].limits = tuple(np.degrees(links[i].limits))


def limits_mirrored(links, i):
    links[i].limits = (-links[i].limits[1], -links[i].limits[0])


def limits_exchanged(links, i):
    other = links[(i + 1) % len(links)]
    links[i].limits, other.limits = other.limits, links[i].limits


def joints_exchanged_in_the_chain(links, i):
    below = [k for k in links if k.parent == links[i].name and _finger(k) == _finger(links[i])]
    if not below:
        return False
    _exchange(links, links[i].joint, below[0].joint)
    return True


def joints_exchanged_between_fingers(links, i):
    finger, k = links[i].joint.split("_")
    other = {"index": "middle", "middle": "ring", "ring": "index", "little": "thumb", "thumb": "little"}.get(finger)
    if other is None:
        return False
    _exchange(links, links[i].joint, f"{other}_{k}")
    return True


def equality_reversed(links, i):
    if not links[i].follows:
        return False
    driver, law = links[i].follows
    links[i].follows = None
    next(k for k in links if k.joint == driver).follows = (links[i].joint, law)
    return True


def coupling_differs(links, i):
    if not links[i].follows:
        return False
    links[i].follows = (links[i].follows[0], [links[i].follows[1][0], 1.1 * links[i].follows[1][1]])
    return True


def coupling_missing(links, i):
    present = links[i].follows is not None
    links[i].follows = None
    return present


def link_displaced_at_the_tip(links, i):
    if links[i].tip is None:
        return False
    links[i].tip = links[i].tip + [0, 0, 1e-3]
    return True


def _finger(link: Link) -> str:
    return link.joint.split("_")[0]


def _exchange(links, a, b):
    """Write each joint under the other's name, its limits and couplings with it: only the two names are wrong."""
    swap = {a: b, b: a}
    for link in links:
        link.joint = swap.get(link.joint, link.joint)
        if link.follows:
            link.follows = (swap.get(link.follows[0], link.follows[0]), link.follows[1])


MUTATIONS = [
    sign_flipped,
    offset_dropped,
    axis_shifted,
    axis_shifted_by_10_micrometres,
    axis_tilted,
    axis_tilted_with_its_link,
    limits_differ,
    limits_degrees,
    limits_mirrored,
    limits_exchanged,
    joints_exchanged_in_the_chain,
    joints_exchanged_between_fingers,
    equality_reversed,
    coupling_differs,
    coupling_missing,
    link_displaced_at_the_tip,
]
CAUSES = (
    "sign_flipped",
    "offset_dropped",
    "axis_shifted",
    "axis_tilted",
    "limits_differ",
    "limits_degrees",
    "limits_mirrored",
    "limits_exchanged",
    "joints_exchanged",
    "equality_reversed",
    "coupling_differs",
    "coupling_missing",
    "link_displaced",
)


def compare(correct, changed, folder, in_mjcf: bool, frames=None, **options):
    urdf, mjcf = (correct, changed) if in_mjcf else (changed, correct)
    pair = write_urdf(urdf, folder / "a.urdf"), write_mjcf(mjcf, folder / "b.xml", frames=frames, **options)
    return conform(*pair, poses=POSES)


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: m.__name__)
def test_every_planted_cause_is_named_at_every_joint(mutation, tmp_path):
    """All 24 joints, side, file and link frames taking turns; exactly the planted cause, at the planted joint."""
    cause = max((c for c in CAUSES if mutation.__name__.startswith(c)), key=len)
    planted = 0
    for i in range(sum(FINGERS.values())):
        turn = i + MUTATIONS.index(mutation)
        correct = make_hand(turn % 5, ("left", "right")[turn % 2])
        changed = deepcopy(correct)
        if mutation(changed, i) is False:
            continue
        planted += 1
        frames = (None, 1, 2)[turn % 3]
        report = compare(correct, changed, tmp_path, in_mjcf=turn % 4 < 2, frames=frames)
        assert report.causes == (cause,), (correct[i].joint, report.text())
        named = {name for f in report.findings if f.disagrees for name in f.where}
        assert named & {changed[i].joint, correct[i].joint, f"{changed[i].name}_tip"}, (correct[i].joint, named)
        if "exchanged" not in cause and cause != "equality_reversed":
            assert len(named) == 1
    assert planted >= 5


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("frames", [None, 1])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_correct_hand_has_no_finding(seed, frames, side, tmp_path):
    """Other link frames, degrees, ref kept, and hidden names are conventions, not disagreements."""
    links = make_hand(seed, side)
    report = compare(links, links, tmp_path, True, frames)
    assert report.ok and not report.findings, report.text()
    referenced = deepcopy(links)
    for n, link in enumerate(referenced):
        link.ref = 0.3 * np.sin(n)
    report = compare(links, referenced, tmp_path, True, frames, degrees=True)
    assert report.ok and not any(f.cause != "numbers_rounded" for f in report.findings), report.text()
    assert report.explained_mm < 1e-6


@pytest.mark.parametrize("side", ["left", "right"])
def test_ref_dropped_everywhere(side, tmp_path):
    """The converter that reads body poses and overlooks ref: every joint named, with its angle, and the sign of nothing
    wrong."""
    links = make_hand(3, side)
    urdf = write_urdf(links, tmp_path / "a.urdf")
    turned = deepcopy(links)
    for n, link in enumerate(turned):
        link.ref = 0.1 + 0.02 * n
        link.origin = link.origin @ transform(-link.ref * link.axis, [0, 0, 0])
    report = conform(urdf, write_mjcf(turned, tmp_path / "b.xml"), poses=POSES)
    assert report.causes == ("offset_dropped",), report.text()
    offsets = {f.where[0]: f.figures["offset_rad"] for f in report.findings}
    for link in turned:
        assert offsets[link.joint] == pytest.approx(link.ref, abs=1e-9)
    assert all("dropped it" in f.text for f in report.findings)


@pytest.mark.parametrize("in_mjcf", [True, False])
@pytest.mark.parametrize("digits", [3, 4, 5])
def test_rounded_numbers_are_named_as_such(digits, in_mjcf, tmp_path):
    links = make_hand(4, "right", couplings=False)
    urdf = write_urdf(links, tmp_path / "a.urdf", digits=None if in_mjcf else digits)
    report = conform(urdf, write_mjcf(links, tmp_path / "b.xml", digits=digits if in_mjcf else None), poses=POSES)
    assert report.causes == ("numbers_rounded",), report.text()
    assert report.findings[-1].text.startswith("b.xml" if in_mjcf else "a.urdf") or len(report.findings) > 1


def test_six_digits_pass_with_a_note(tmp_path):
    links = make_hand(4, "left", couplings=False)
    urdf = write_urdf(links, tmp_path / "a.urdf")
    report = conform(urdf, write_mjcf(links, tmp_path / "b.xml", digits=7), poses=POSES)
    assert report.ok and {f.cause for f in report.findings} == {"numbers_rounded"}, report.text()


@pytest.mark.parametrize("finger", ["index", "little"])
def test_limits_shifted_by_one(finger, tmp_path):
    links = make_hand(5)
    shifted = deepcopy(links)
    rows = [link for link in shifted if _finger(link) == finger]
    limits = [link.limits for link in rows]
    for k, link in enumerate(rows):
        link.limits = limits[(k + 1) % len(rows)]
    report = compare(links, shifted, tmp_path, True)
    assert report.causes == ("limits_shifted",), report.text()
    named = {n for f in report.findings for n in f.where}
    assert named == {link.joint for link in rows}


def test_limits_shifted_over_the_whole_hand(tmp_path):
    links = make_hand(6)
    shifted = deepcopy(links)
    for k, link in enumerate(shifted):
        link.limits = links[k - 1].limits
    report = compare(links, shifted, tmp_path, False)
    assert report.causes == ("limits_shifted",), report.text()


def test_line_against_a_linkage(tmp_path):
    """The loss is that of the best look at the two laws, worked out here."""
    links = make_hand(7)
    law = [0.0, 0.5, 0.3, -0.1]
    urdf = write_urdf(links, tmp_path / "a.urdf")
    report = conform(urdf, write_mjcf(links, tmp_path / "b.xml", poly={"index_4": law}), poses=POSES)
    assert report.causes == ("linear_mimic",), report.text()
    line = next(k for k in links if k.joint == "index_4").follows[1]
    low, high = next(k for k in links if k.joint == "index_3").limits
    q = np.linspace(low, high, 100001)
    loss = np.degrees(np.abs(np.polyval(law[::-1], q) - np.polyval(line[::-1], q)).max())
    finding = report.findings[0]
    assert finding.where == ("index_4",) and finding.figures["largest_deg"] == pytest.approx(loss, rel=1e-3)
    accepted = conform(urdf, tmp_path / "b.xml", poses=POSES, accept=("linear_mimic",))
    assert accepted.ok and accepted.findings[0].cause == "linear_mimic"


@pytest.mark.parametrize("finger", ["index", "middle", "ring", "little", "thumb"])
def test_chain_of_mimics(finger, tmp_path):
    """A chain that multiplies out to the right law is still a chain: loaders disagree about it."""
    links = make_hand(8)
    last = FINGERS[finger]
    by = {link.joint: link for link in links}
    middle, end, root = by[f"{finger}_{last - 1}"], by[f"{finger}_{last}"], f"{finger}_{last - 2}"
    middle.follows = (root, [0.1, 0.5])
    chained = deepcopy(links)
    end.follows = (root, [end.follows[1][0] + end.follows[1][1] * 0.1, end.follows[1][1] * 0.5])
    urdf = write_urdf(chained, tmp_path / "a.urdf")
    report = conform(urdf, write_mjcf(links, tmp_path / "b.xml"), poses=POSES)
    assert report.causes == ("mimic_chain",) and report.findings[0].where == (end.joint,), report.text()
    fixed = write_fixed(urdf, tmp_path / "b.xml", None, tmp_path / "fixed", poses=POSES)
    assert fixed.report.ok, fixed.report.text()


@pytest.mark.parametrize("frames", [None, 3])
def test_left_against_right(frames, tmp_path):
    links = make_hand(9)
    report = compare(links, [mirror(link) for link in links], tmp_path, True, frames)
    assert report.causes == ("mirrored",), report.text()


def test_missing_joint(tmp_path):
    links = make_hand(10)
    urdf = write_urdf(links, tmp_path / "a.urdf")
    text = urdf.read_text().replace('name="ring_2" type="revolute"', 'name="ring_2" type="fixed"')
    urdf.write_text(text)
    report = conform(urdf, write_mjcf(links, tmp_path / "b.xml"), poses=POSES)
    assert report.causes == ("missing_joint",) and report.findings[0].where == ("ring_2",), report.text()


def test_whole_fingers_exchanged(tmp_path):
    """Index and ring under each other's names, as in a right hand's file used for a left one."""
    links = make_hand(11, couplings=False)
    changed = deepcopy(links)
    for k in range(1, 5):
        _exchange(changed, f"index_{k}", f"ring_{k}")
    report = compare(links, changed, tmp_path, True)
    assert report.causes == ("joints_exchanged",), report.text()
    assert len(report.findings[0].where) == 8


@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m not in (limits_degrees,)], ids=lambda m: m.__name__)
def test_the_corrected_copy_passes(mutation, tmp_path):
    links = make_hand(2, "left")
    changed = deepcopy(links)
    at = next(
        i
        for i, link in enumerate(links)
        if link.joint == ("middle_4" if mutation(deepcopy(links), 9) is False else "middle_3")
    )
    if mutation(changed, at) is False:
        at = next(i for i, link in enumerate(links) if link.follows)
        mutation(changed, at)
    urdf, mjcf = write_urdf(changed, tmp_path / "a.urdf"), write_mjcf(links, tmp_path / "b.xml", frames=1)
    for correct in ("a", "b"):
        fixed = write_fixed(
            urdf, mjcf, None, tmp_path / correct, correct=correct, poses=POSES, engines=("mujoco", "pinocchio")
        )
        assert fixed.report.ok, (correct, fixed.text(), fixed.report.text())
