"""A session's manifest: every refusal names what is wrong and what would be valid."""

from __future__ import annotations

import re

import pytest
from session_refusal import edit, refusal
from session_writers import MANIFEST, write_log, write_session

from hand_model.session import read_session


@pytest.fixture
def root(tmp_path):
    return write_session(tmp_path / "session")


def test_unknown_keys_are_said_once(root):
    edit(root, 'side = "left"', 'side = "left"\nowner = "me"')
    edit(root, 'purpose = "validate"', 'purpose = "validate"\ncoment = "x"')
    edit(root, "[hand]", 'colour = "red"\n[hand]')
    notes = read_session(root).notes
    assert len(notes) == 3 and all("ignored" in note for note in notes)
    assert {re.search('key "(.*?)"', note)[1] for note in notes} == {"owner", "coment", "colour"}


# case: (text in the manifest, replacement, what the message must say)
MANIFEST_REFUSED = {
    "format_version": ('"hand-session/1"', '"hand-session/2"', ["hand-session/2", "hand-session/1"]),
    "format_missing": ('format = "hand-session/1"', "", ["format", "hand-session/1"]),
    "toml_syntax": ("[hand]", "[hand", ["TOML"]),
    "hand_missing": ("[hand]", "[hnd]", ["hand"]),
    "hand_name_missing": ('name = "test hand"', "", ["[hand]", '"name" is missing']),
    "hand_name_number": ('"test hand"', "5", ["[hand]", "name is 5", "text"]),
    "side_unknown": ('side = "left"', 'side = "lft"', ["side", '"lft"', 'did you mean "left"']),
    "side_missing": ('side = "left"', "", ["[hand]", '"side" is missing']),
    "gravity_two": ("[0.0, 0.0, -9.81]", "[0.0, -9.81]", ["[world]", "gravity", "3 numbers"]),
    "gravity_text": ("-9.81]", '"down"]', ["gravity", "3 numbers"]),
    "gravity_millimetres": ("-9.81]", "-9810.0]", ["gravity", "metres per second squared"]),
    "palm_missing": ("[palm]", "[plam]", ["[palm] is missing"]),
    "palm_marker_missing": (', lateral = "PL"', "", ["[palm]", '"lateral" is missing']),
    "palm_marker_typo": ("lateral = ", "laterl = ", ["lateral", "laterl"]),
    "palm_marker_extra": (
        'lateral = "PL"',
        'lateral = "PL", distal = "PD"',
        ["distal", "valid: lateral, medial, origin"],
    ),
    "palm_marker_number": ('"PL"', "3", ["lateral is 3", "text"]),
    "palm_markers_list": ('{ origin = "PO", medial = "PM", lateral = "PL" }', '["PO"]', ["[palm]", "table"]),
    "palm_marker_twice": ('"PM"', '"PO"', ['"PO"', "twice", "[palm]"]),
    "probe_two": (", T3 = [0.034, 0.0, 0.11]", ", T3 = [0.034, 0.0]", ["T3", "3 numbers"]),
    "probe_millimetres": ("T1 = [0.0, 0.0, 0.085]", "T1 = [0.0, 0.0, 85.0]", ["[probe]", "metres"]),
    "probe_one_line": ("T3 = [0.034, 0.0, 0.11]", "T3 = [0.0, 0.0, 0.145]", None),
    "probe_line_beside_tip": (
        "T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11]",
        "T1 = [0.02, 0.0, 0.085], T2 = [0.02, 0.0, 0.125], T3 = [0.02, 0.0, 0.11]",
        ["[probe]", "T1, T2, T3", "line"],
    ),
    "probe_two_markers": (
        "T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11]",
        "T1 = [0.0, 0.0, 0.085], T3 = [0.034, 0.0, 0.11]",
        ["[probe]", "2 markers (T1, T3)", "three"],
    ),
    "probe_missing": ("[probe]", "[prbe]", ["mocap/origin.c3d", "[probe]"]),
    "probe_tipless": (
        "markers = { T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11] }",
        'markers = ["T1", "T2", "T3"]',
        ["[probe]", "tip", "pivot"],
    ),
    "probe_tipless_two": (
        "markers = { T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11] }",
        'markers = ["T1", "T2"]',
        ["[probe]", "2 markers", "three"],
    ),
    "probe_shares_marker": ("{ T1 =", "{ PO =", ['"PO"', "[palm]", "[probe]"]),
    "actuator_full_text": ("speed_full = 255", 'speed_full = "255"', ['[[actuator]] "index"', "speed_full"]),
    "actuator_full_bool": ("speed_full = 255", "speed_full = true", ["speed_full is True"]),
    "actuator_full_zero": ("speed_full = 255", "speed_full = 0", ["speed_full", "above zero"]),
    "actuator_twice": (
        "[[finger]]",
        '[[actuator]]\nname = "index"\n\n[[finger]]',
        ["[[actuator]]", '"index"', "twice"],
    ),
    "finger_twice": ('name = "ring"', 'name = "index"', ["[[finger]]", '"index"', "twice"]),
    "finger_name_slash": ('name = "ring"', 'name = "ring/x"', ["ring/x", "slash"]),
    "finger_actuator_unknown": ('actuator = "index"', 'actuator = "idex"', ["idex", 'did you mean "index"']),
    "finger_without_actuator": ('actuator = "index"\n', "", ["log/index.csv", 'finger "index" has no actuator']),
    "finger_without_segments": ("segments = [{", "segmnts = [{", ['"ring"', '"segments" is missing|no segment']),
    "finger_without_trial": (
        'finger = "ring"\nmocap',
        'finger = "index"\nmocap',
        ['finger "ring" has no flexion trial'],
    ),
    "segment_two_markers": ('["RP1", "RP2", "RP3"]', '["RP1", "RP2"]', ["proximal", "2 markers (RP1, RP2)", "three"]),
    "segment_marker_twice": ('["RP1", "RP2", "RP3"]', '["RP1", "RP2", "RP2"]', ["RP2", "twice"]),
    "segment_markers_numbers": ('["RP1", "RP2", "RP3"]', "[1, 2, 3]", ["markers holds 1", "texts"]),
    "segment_markers_text": ('["RP1", "RP2", "RP3"]', '"RP1"', ["markers is 'RP1'", "list"]),
    "segment_twice": ('name = "distal"', 'name = "proximal"', ["proximal", "twice"]),
    "marker_in_two_segments": ('"ID1"', '"IP1"', ['"IP1"', "index/proximal", "index/distal"]),
    "marker_in_palm_and_finger": ('"ID1"', '"PO"', ['"PO"', "[palm]", "index/distal"]),
    "marker_in_two_fingers": ('"RP1"', '"IP1"', ['"IP1"', "index/proximal", "ring/proximal"]),
    "trial_kind_unknown": ('kind = "excitation"', 'kind = "exitation"', ["exitation", 'did you mean "excitation"']),
    "trial_kind_missing": ('kind = "excitation"\n', "", ["log/excitation.csv", '"kind" is missing']),
    "trial_finger_unknown": (
        'finger = "index"\nlog = "log/exc',
        'finger = "inex"\nlog = "log/exc',
        ["log/excitation.csv", "inex", 'did you mean "index"'],
    ),
    "trial_finger_missing": (
        'finger = "index"\nlog = "log/exc',
        'log = "log/exc',
        ["log/excitation.csv", '"finger" is missing'],
    ),
    "trial_log_missing": ('log = "log/excitation.csv"\n', "", ["[[trial]] 3", '"log" is missing']),
    "trial_log_typo": ('log = "log/exc', 'lg = "log/exc', ['"log" is missing', '"lg"']),
    "trial_mocap_missing": ('mocap = "mocap/origin.c3d"', "", ['"mocap" is missing']),
    "trial_mocap_number": ('"mocap/origin.c3d"', "7", ["mocap is 7", "text"]),
    "trial_file_missing": (
        '"mocap/origin.c3d"',
        '"mocap/orign.c3d"',
        ["mocap/orign.c3d", "does not exist", "mocap/origin.c3d"],
    ),
    "trial_log_file_missing": ('"log/grasp.csv"', '"log/grsp.csv"', ["log/grsp.csv", 'did you mean "log/grasp.csv"']),
    "trial_wrong_ending": (
        'mocap = "mocap/ring.tsv"',
        'mocap = "session.toml"',
        ["session.toml", ".toml|cannot be read", ".c3d"],
    ),
    "trial_folder": ('mocap = "mocap/ring.tsv"', 'mocap = "mocap"', ["folder", "a file"]),
    "trial_log_folder": ('log = "log/grasp.csv"', 'log = "log"', ["folder", "metadata.yaml"]),
    "trial_landmark_unknown": ('name = "medial"', 'name = "medal"', ["medal", 'did you mean "medial"']),
    "trial_landmark_incomplete": ('name = "medial"', 'name = "origin"', ["medial", "landmark"]),
    "trial_joint_unknown": ('joint = "proximal"', 'joint = "proxmal"', ["proxmal", 'did you mean "proximal"']),
    "trial_side_unknown": ('side = "medial"\n', 'side = "left"\n', ['side is "left"', "lateral, medial"]),
    "trial_segment_unknown": (
        '"index/proximal"',
        '"index/proximl"',
        ["index/proximl", 'did you mean "index/proximal"'],
    ),
    "trial_purpose_unknown": ('"validate"', '"validation"', ["validation", 'did you mean "validate"']),
    "trial_stiffness_bool": ('stiffness = "stiff"', "stiffness = true", ["stiffness is True"]),
    "trial_twice": (
        'mocap = "mocap/ring.tsv"',
        'mocap = "mocap/ring.tsv"\n'
        + """
[[trial]]
kind = "flexion"
finger = "ring"
mocap = "mocap/../mocap/ring.tsv"
purpose = "validate"
""",
        ["ring.tsv", "twice"],
    ),
    "trials_missing": (MANIFEST[MANIFEST.index("[[trial]]") :], "", ["no [[trial]]"]),
    "path_up": ('"log/grasp.csv"', '"../grasp.csv"', ["../grasp.csv", "leaves the session folder"]),
    "path_up_hidden": ('"log/grasp.csv"', '"log/../../x/grasp.csv"', ["leaves the session folder"]),
    "path_absolute": ('"log/grasp.csv"', '"/etc/hostname"', ["/etc/hostname", "absolute"]),
    "path_windows": ('"log/grasp.csv"', "'C:\\log.csv'", ["C:", "absolute"]),
    "path_null": ('"log/grasp.csv"', '"log/\\u0000.csv"', ["log is", "relative"]),
    "path_endless": ('"log/grasp.csv"', '"' + "log/" * 3 + "x" * 5000 + '"', ["log"]),
    "path_empty": ('"log/grasp.csv"', '""', ["log is ''"]),
}


@pytest.mark.parametrize("case", MANIFEST_REFUSED)
def test_manifest_refused(case, root):
    old, new, words = MANIFEST_REFUSED[case]
    edit(root, old, new)
    if words is None:
        read_session(root)
        return
    message = refusal(read_session, root)
    assert "session.toml" in message
    for word in words:
        assert any(part in message for part in word.split("|")), (word, message)


def test_two_probe_markers_in_line_with_the_tip_are_enough(root):
    edit(root, ", T3 = [0.034, 0.0, 0.11]", "")
    assert read_session(root).probe.labels == ("T1", "T2")


def test_no_session(tmp_path):
    assert "no such file" in refusal(read_session, tmp_path / "nowhere")
    (tmp_path / "session.toml").write_bytes(b'format = "\xff\xfe"')
    assert "TOML" in refusal(read_session, tmp_path)


def test_links_do_not_leave_the_folder(root, tmp_path):
    write_log(tmp_path / "outside.csv")
    (root / "log/grasp.csv").unlink()
    (root / "log/grasp.csv").symlink_to(tmp_path / "outside.csv")
    assert "log/grasp.csv" in refusal(read_session, root) and "leaves" in refusal(read_session, root)
    (root / "log/grasp.csv").unlink()
    (root / "log/grasp.csv").symlink_to(root / "log/excitation.csv")
    read_session(root)
    (root / "log/grasp.csv").unlink()
    (root / "log/grasp.csv").symlink_to(root / "log/grasp.csv")
    assert "grasp.csv" in refusal(read_session, root)
