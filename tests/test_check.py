"""Mutation tests of the check: every planted fault is found under its item, and nothing is found on the hand as
compiled."""

import dataclasses
import json
import re

import numpy as np
import pytest
from lxml import etree
from synthetic_hand import synthetic_hand

from hand_model.check import ITEMS, check, record
from hand_model.check.mirror import mirrored
from hand_model.compile import compile
from hand_model.errors import DescriptionError

STEM = "synthetic_left"


@pytest.fixture
def folder(tmp_path):
    return compile(synthetic_hand(1, fingers=("index", "ring")), tmp_path / "out").folder


def _failed(folder, items=ITEMS):
    return {f.item.split(":")[0] for f in check(folder, items=items) if not f.passed}


def _edit(folder, ending, path, action):
    file = folder / f"{STEM}.{ending}"
    tree = etree.parse(str(file))
    action(tree.getroot().xpath(path)[0])
    tree.write(str(file))


def _set(**attributes):
    return lambda e: [e.set(k, v) for k, v in attributes.items()]


def _reverse(e):
    e.set("joint1", e.get("joint2") + "|" + e.get("joint1"))
    second, first = e.get("joint1").split("|")
    e.set("joint1", second)
    e.set("joint2", first)


def _rounded(attribute):
    return lambda e: e.set(attribute, " ".join(f"{float(v):.6g}" for v in e.get(attribute).split()))


def _remove(e):
    e.getparent().remove(e)


def _soften(e):
    del e.attrib["solimp"]
    e.set("solref", "0.02 1")


MUTATIONS = [
    ("hinges", "xml", "//joint[@name='index_s0']", _set(ref="0.1")),
    ("hinges", "xml", "//joint[@name='ring_s1']", _set(pos="0 0.001 0")),
    ("hinges", "xml", "//joint[@name='ring_s1']", _set(axis="0 2 0")),
    ("digits", "xml", "//joint[@name='index_s1']", _rounded("axis")),
    ("digits", "xml", "//site[@name='index_tip']", _rounded("pos")),
    ("digits", "xml", "//site[@name='marker_ring_1b']", _rounded("pos")),
    ("digits", "xml", "//equality/joint[@name='ring_linkage']", _rounded("polycoef")),
    ("digits", "urdf", "//joint[@name='index_s0']/origin", _rounded("xyz")),
    ("engines agree", "urdf", "//joint[@name='index_s1']/axis", _set(xyz="0 1 0")),
    ("engines agree", "xml", "//body[@name='ring_s0_link']", _set(pos="0 0 0")),
    ("engines agree", "xml", "//body[@name='ring_s0_link']", _set(euler="0.01 0 0")),
    ("limits", "urdf", "//joint[@name='index_s0']/limit", _set(upper="3")),
    ("limits", "xml", "//joint[@name='index_s0']", _set(range="-1 1")),
    ("coupling", "xml", "//equality/joint[@name='index_linkage']", _reverse),
    ("coupling", "xml", "//equality/joint[@name='index_linkage']", _remove),
    ("coupling", "xml", "//equality/joint[@name='index_linkage']", _set(joint2="ring_s0")),
    ("coupling", "xml", "//equality/joint[@name='index_linkage']", _set(polycoef="0 1 0 0 0")),
    ("coupling stiffness", "xml", "//equality/joint[@name='ring_linkage']", _soften),
    ("mimic", "urdf", "//joint[@name='index_s1']/mimic", _set(multiplier="2")),
    ("mimic", "urdf", "//joint[@name='index_s1']/mimic", _set(joint="ring_s1")),
    ("mimic", "urdf", "//joint[@name='index_s1']/mimic", _remove),
    ("inertias", "xml", "//body[@name='index_s0_link']/inertial", _set(fullinertia="1e-6 1e-6 3e-6 0 0 0")),
    ("inertias", "xml", "//body[@name='index_s0_link']/inertial", _set(fullinertia="1e-6 1e-6 -1e-6 0 0 0")),
    ("inertias", "xml", "//compiler", _set(balanceinertia="true")),
    ("inertias", "urdf", "//link[@name='index_s0_link']/inertial/mass", _set(value="1")),
    ("geoms", "xml", "//body[@name='index_s0_link']/geom[@class='collision']", _set(group="2")),
    ("geoms", "xml", "//body[@name='index_s0_link']/geom[@class='visual']", _set(contype="1")),
    ("geoms", "xml", "//exclude", _set(body1="index_s1_link", body2="ring_s1_link")),
    ("contact", "xml", "//body[@name='index_s1_link']/geom[@class='collision']", _set(size="0.05")),
    ("keyframes", "xml", "//key[@name='close']", lambda e: e.set("qpos", "1 1 1 1")),
    ("keyframes", "xml", "//key[@name='close']", _set(name="closed")),
    ("names", "xml", "//site[@name='index_tip']", _set(name="tip_index")),
    ("names", "xml", "//site[@name='index_tip']", _set(name="index_s0")),
    ("names", "xml", "//position[@name='index']", _set(name="motor")),
    ("quiet", "xml", "//position[@name='index']", _set(kp="1e9", forcerange="-1e9 1e9")),
]


def test_the_hand_as_compiled_passes(folder):
    assert _failed(folder) == set()


@pytest.mark.parametrize(("item", "ending", "path", "action"), MUTATIONS)
def test_every_planted_fault_is_found(folder, item, ending, path, action):
    _edit(folder, ending, path, action)
    assert _failed(folder, (item,)) == {item}


def test_a_missing_file_is_found(folder):
    (folder / "CHANGELOG.md").unlink()
    assert _failed(folder, ("files", "names")) == {"files"}


def test_a_false_statement_of_loss_is_found(folder):
    file = folder / "hand.json"
    table = json.loads(file.read_text())
    table["description"]["models"][0]["linkages"]["index_linkage"]["mimic_loss_deg"] = 0.0
    file.write_text(json.dumps(table))
    assert _failed(folder, ("mimic", "coupling", "limits")) == {"mimic"}


def test_mirror_is_judged_by_the_stated_uncertainty(tmp_path):
    left = synthetic_hand(1, "left")

    def reflected(tilt):
        fingers = []
        for finger in left.fingers:
            joints = []
            for joint in finger.joints:
                axis, centre = mirrored(joint.axis_palm, joint.centre_palm)
                axis = axis + [tilt, 0, 0]
                markers = {k: p * [1, -1, 1] for k, p in joint.markers_palm.items()}
                tip = None if joint.tip_palm is None else joint.tip_palm * [1, -1, 1]
                joints.append(
                    dataclasses.replace(joint, axis_palm=axis, centre_palm=centre, markers_palm=markers, tip_palm=tip)
                )
            fingers.append(dataclasses.replace(finger, joints=tuple(joints)))
        return dataclasses.replace(left, side="right", fingers=tuple(fingers))

    a = compile(left, tmp_path / "left").folder
    for tilt, passes in ((0.0, True), (0.001, True), (0.05, False)):
        b = compile(reflected(tilt), tmp_path / "right").folder
        finding = check(a, b, ("mirror",))[-1]
        assert (finding.item, finding.passed) == ("mirror", passes)
    assert not check(a, a, ("mirror",))[-1].passed


def test_a_mirrored_hand_moves_as_the_mirror_image():
    from hand_model.kinematics import displace

    finger = synthetic_hand(1).fingers[2]
    joints = []
    for joint in finger.joints:
        axis, centre = mirrored(joint.axis_palm, joint.centre_palm)
        joints.append(dataclasses.replace(joint, axis_palm=axis, centre_palm=centre))
    angles, point = np.random.default_rng(0).uniform(-1, 1, (9, 2)), np.array([0.1, 0.02, 0.01])
    here = displace(finger, angles).points(1, point)
    there = displace(dataclasses.replace(finger, joints=tuple(joints)), angles).points(1, point * [1, -1, 1])
    assert np.allclose(here * [1, -1, 1], there, atol=1e-14)


def test_findings_are_recorded_in_the_readme_once(folder):
    findings = check(folder, items=("names", "hinges", "digits"))
    record(folder, findings)
    record(folder, findings)
    text = (folder / "README.md").read_text()
    assert text.count("## Verification") == 1
    assert re.search(rf"{len(findings)} of {len(findings)} items passed", text)


def test_an_unknown_item_is_refused(folder):
    with pytest.raises(DescriptionError, match='did you mean "hinges"'):
        check(folder, items=("hinge",))
