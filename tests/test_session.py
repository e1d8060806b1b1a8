"""Whole sessions: the manifest's every refusal, what only the recordings tell, rigs, and damaged files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from session_writers import (
    FINGERS,
    MANIFEST,
    PALM,
    PROBE,
    rigid_markers,
    write_bag,
    write_c3d,
    write_log,
    write_session,
    write_tsv,
)

from hand_model.errors import SessionError
from hand_model.session import check_session, read_log, read_mocap, read_session
from hand_model.session.check import flatness, missing_direction, moves

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture
def root(tmp_path):
    return write_session(tmp_path / "session")


def edit(root, old, new, count=1):
    """Replace text in the manifest; the text must be there."""
    file = root / "session.toml"
    text = file.read_text()
    assert old in text, old
    file.write_text(text.replace(old, new, count))


def refusal(call, *args):
    """The message of the SessionError that a call raises: one line."""
    with pytest.raises(SessionError) as caught:
        call(*args)
    message = str(caught.value)
    assert type(caught.value) is SessionError and "\n" not in message
    return message


def test_a_complete_session(root):
    session = read_session(root)
    assert (session.hand, session.side, session.notes) == ("test hand", "left", ())
    assert session.palm.labels == PALM and session.probe.labels == tuple(PROBE)
    np.testing.assert_array_equal(session.probe.position_probe, list(PROBE.values()))
    np.testing.assert_array_equal(session.gravity_world, [0, 0, -9.81])
    assert [f.name for f in session.fingers] == ["index", "ring"] and session.finger("ring").actuator is None
    assert session.finger("index").labels == FINGERS["index"][0] + FINGERS["index"][1]
    assert session.actuators[0].speed_full == 255.0
    assert [t.kind for t in session.select("excitation", validate=True)] == ["excitation"]
    assert session.select("grasp")[0].stiffness == "stiff" and session.select("surface")[0].segment == "index/proximal"
    assert [t.landmark for t in session.select("landmark")] == ["origin", "medial", "lateral"]
    probe = session.select("joint_probe")[0]
    assert (probe.joint, probe.side, probe.mocap().labels) == ("proximal", "medial", (*PALM, *PROBE))
    assert read_session(root / "session.toml").trials == session.trials and session.path == root
    notes = check_session(session)
    assert len(notes) == 1 and "mood" in notes[0]


def test_trial_without_a_file_says_so(root):
    session = read_session(root)
    assert "has no mocap" in refusal(session.select("excitation")[0].mocap)
    assert "has no log" in refusal(session.select("landmark")[0].log)
    assert 'did you mean "ring"' in refusal(session.finger, "rng")


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


def test_pivot_calibrates_a_probe_without_tip(root):
    edit(
        root,
        "markers = { T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11] }",
        'markers = ["T1", "T2", "T3"]',
    )
    write_c3d(root / "mocap/pivot.c3d", list(PROBE), rigid_markers(list(PROBE), 50))
    with (root / "session.toml").open("a") as stream:
        stream.write('\n[[trial]]\nkind = "pivot"\nmocap = "mocap/pivot.c3d"\n')
    session = read_session(root)
    assert session.probe.position_probe is None and session.probe.labels == ("T1", "T2", "T3")
    assert session.select("pivot")[0].mocap().labels == ("T1", "T2", "T3")
    check_session(session)


def test_two_thumb_positions_share_markers_and_actuator(root):
    edit(root, 'name = "ring"', 'name = "thumb_0"')
    edit(root, 'finger = "ring"', 'finger = "thumb_0"')
    second = '[[finger]]\nname = "thumb_1"\nsegments = [{ name = "proximal", markers = ["RP1", "RP2", "RP3"] }]\n\n'
    write_tsv(root / "mocap/thumb_1.tsv", [*PALM, "RP1", "RP2", "RP3"], rigid_markers([*PALM, "RP1", "RP2", "RP3"], 20))
    second += '[[trial]]\nkind = "flexion"\nfinger = "thumb_1"\nmocap = "mocap/thumb_1.tsv"\n\n'
    edit(root, "[[trial]]", second + "[[trial]]")
    assert [finger.name for finger in read_session(root).fingers] == ["index", "thumb_0", "thumb_1"]


def test_kinematics_only_needs_no_probe_and_no_log(root):
    text = (
        MANIFEST[: MANIFEST.index("[probe]")]
        + MANIFEST[MANIFEST.rindex("[[finger]]") : MANIFEST.index('[[trial]]\nkind = "flexion"\nfinger = "index"')]
    )
    text += '[[trial]]\nkind = "flexion"\nfinger = "ring"\nmocap = "mocap/ring.tsv"\n'
    (root / "session.toml").write_text(text)
    session = read_session(root)
    assert session.probe is None and session.actuators == () and check_session(session) == ()


def test_bag_as_log_gives_the_actuators_channel(root):
    t = 100 + np.arange(300) * 0.018
    wave = 12000 + 500 * np.sin(np.arange(300) / 30)
    kind = "std_msgs/msg/Float64"
    topics = {
        "/index/position": (kind, [(x, {"data": p}) for x, p in zip(t, wave, strict=True)]),
        "/index/current": (kind, [(x, {"data": 2.0}) for x in t]),
        "/thumb/position": (kind, [(x, {"data": 0.0}) for x in t]),
    }
    write_bag(root / "log/bag", topics)
    edit(root, '"log/excitation.csv"', '"log/bag"')
    session = read_session(root)
    log = session.select("excitation")[0].log()
    np.testing.assert_allclose(log.column("position"), wave)
    check_session(session)


def test_notes_do_not_depend_on_where_the_folder_lies(root):
    file = root / "log/excitation.csv"
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:50], lines[49], *lines[50:]]))
    notes = check_session(read_session(root))
    assert any(note.startswith("log/excitation.csv: ") for note in notes)
    assert not any(str(root) in note for note in notes)


# ---- what only the recordings tell ----


def index_markers(frames=300, **changes):
    labels = [*PALM, *FINGERS["index"][0], *FINGERS["index"][1]]
    return labels, rigid_markers(labels, frames)


def spoil_label(root):
    labels, x = index_markers()
    labels[3] = "lP1"
    write_c3d(root / "mocap/index.c3d", labels, x)


def spoil_scale(factor):
    def spoil(root):
        labels, x = index_markers()
        write_c3d(root / "mocap/index.c3d", labels, x * factor)

    return spoil


def spoil_all_scales(factor):
    def spoil(root):
        spoil_scale(factor)(root)
        for name in ("origin", "medial", "lateral", "joint", "surface"):
            labels = [*PALM, *PROBE]
            write_c3d(root / f"mocap/{name}.c3d", labels, rigid_markers(labels, 20) * factor)

    return spoil


def spoil_line(noise_m):
    def spoil(root):
        labels, x = index_markers()
        step = x[:, 4] - x[:, 3]
        noise = np.random.default_rng(1).normal(0, noise_m, (len(x), 3, 3))
        x[:, 3:6] = x[:, 3:4] + np.arange(3)[:, None] * 0.6 * step[:, None] + noise
        write_c3d(root / "mocap/index.c3d", labels, x)

    return spoil


def spoil_occluded(index):
    def spoil(root):
        labels, x = index_markers()
        x[:, index] = np.nan
        write_c3d(root / "mocap/index.c3d", labels, x)

    return spoil


def spoil_never_together(root):
    labels, x = index_markers()
    x[::2, 6] = np.nan
    x[1::2, 7] = np.nan
    write_c3d(root / "mocap/index.c3d", labels, x)


def spoil_length(root):
    labels, x = index_markers(6)
    write_c3d(root / "mocap/index.c3d", labels, x)


def spoil_probe(root):
    labels = [*PALM, *PROBE]
    x = rigid_markers(labels, 20)
    x[:, 3:] = x[:, 3:4] + (x[:, 3:] - x[:, 3:4]) * 10
    write_c3d(root / "mocap/joint.c3d", labels, x)


def spoil_probe_unseen(root):
    labels = [*PALM, *PROBE]
    x = rigid_markers(labels, 20)
    x[:, 4] = np.nan
    write_c3d(root / "mocap/joint.c3d", labels, x)


def spoil_log(name, change):
    def spoil(root):
        file = root / f"log/{name}.csv"
        lines = file.read_text().splitlines()
        file.write_text("\n".join(change(lines)))

    return spoil


def in_milliseconds(lines):
    cells = [line.split(",", 1) for line in lines[1:]]
    return [lines[0], *(f"{float(t) * 1000},{rest}" for t, rest in cells)]


def without_samples_of(column):
    def change(lines):
        rows = [line.split(",") for line in lines[1:]]
        return [lines[0], *(",".join("" if i == column else cell for i, cell in enumerate(row)) for row in rows)]

    return change


RECORDINGS_REFUSED = {
    "wrong_label": (spoil_label, ["mocap/index.c3d", 'no marker "IP1"', 'did you mean "lP1"']),
    "hand_of_100_m": (spoil_scale(1000.0), ["mocap/index.c3d", "m apart", "unit"]),
    "hand_of_100_um": (spoil_scale(0.001), ["mocap/index.c3d", "m apart", "unit"]),
    "every_file_in_metres": (spoil_all_scales(1000.0), ["mocap/index.c3d", "unit"]),
    "one_file_in_centimetres": (spoil_scale(10.0), ["index.c3d", "palm", "unit"]),
    "probe_ten_times": (spoil_probe, ["mocap/joint.c3d", "T1, T2, T3", "[probe]"]),
    "probe_marker_unseen": (spoil_probe_unseen, ["mocap/joint.c3d", "T1, T2, T3", "in 0 of 20 frames"]),
    "collinear": (spoil_line(0.0), ["mocap/index.c3d", "IP1, IP2, IP3", "one line"]),
    "collinear_noisy": (spoil_line(4e-4), ["mocap/index.c3d", "IP1, IP2, IP3", "one line"]),
    "occluded_finger": (spoil_occluded(7), ["mocap/index.c3d", '"ID2"', "index/distal", "every frame"]),
    "occluded_palm": (spoil_occluded(1), ["mocap/index.c3d", '"PM"', "palm", "every frame"]),
    "never_together": (spoil_never_together, ["mocap/index.c3d", "ID1, ID2, ID3", "in 0 of 300 frames"]),
    "six_frames": (spoil_length, ["mocap/index.c3d", "6 of 6 frames", "10 or more"]),
    "truncated": (
        lambda root: (root / "mocap/index.c3d").write_bytes((root / "mocap/index.c3d").read_bytes()[:30_000]),
        ["mocap/index.c3d", "truncated"],
    ),
    "foreign": (lambda root: (root / "mocap/index.c3d").write_bytes(b"x" * 5000), ["mocap/index.c3d", "not a C3D"]),
    "log_empty": (lambda root: (root / "log/index.csv").write_text(""), ["log/index.csv", "empty"]),
    "log_header_only": (spoil_log("index", lambda lines: lines[:1]), ["log/index.csv", "empty"]),
    "log_still": (lambda root: write_log(root / "log/index.csv", moving=False), ["log/index.csv", "position", "move"]),
    "excitation_still": (
        lambda root: write_log(root / "log/excitation.csv", moving=False),
        ["log/excitation.csv", "excitation", "move"],
    ),
    "log_no_current": (
        spoil_log("index", lambda lines: [lines[0].replace("current", "curent"), *lines[1:]]),
        ["log/index.csv", '"current"', 'did you mean "curent"'],
    ),
    "log_no_position_samples": (
        spoil_log("grasp", without_samples_of(1)),
        ["log/grasp.csv", '"position"', "no sample"],
    ),
    "log_in_milliseconds": (spoil_log("excitation", in_milliseconds), ["log/excitation.csv", "seconds"]),
    "log_too_short": (spoil_log("index", lambda lines: lines[:12]), ["log/index.csv", "index.c3d|position"]),
    "only_validation": (
        lambda root: edit(root, 'mocap = "mocap/ring.tsv"', 'mocap = "mocap/ring.tsv"\npurpose = "validate"'),
        ['finger "ring"', "validate"],
    ),
}


@pytest.mark.parametrize("case", RECORDINGS_REFUSED)
def test_recordings_refused(case, root):
    spoil, words = RECORDINGS_REFUSED[case]
    spoil(root)
    message = refusal(lambda: check_session(read_session(root)))
    for word in words:
        assert any(part in message for part in word.split("|")), (word, message)


def test_a_direction_that_is_missing():
    rng, up = np.random.default_rng(0), np.linspace(0, 100, 200)
    assert missing_direction(up + rng.normal(size=200)) == "extension"
    assert missing_direction(-up) == "flexion"
    assert missing_direction(np.r_[up, up[::-1]]) == "" and missing_direction(np.array([np.nan, 1.0])) == ""


def test_flatness_of_known_triangles():
    rng = np.random.default_rng(0)
    for height in (0.0, 0.004, 0.02):
        corners = np.array([[0, 0, 0], [0.03, 0, 0], [0.015, height, 0]])
        turns = np.linalg.qr(rng.normal(size=(400, 3, 3)))[0]
        moving = corners @ turns + rng.normal(size=(400, 1, 3))
        size = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
        assert flatness(moving) == pytest.approx(size[1] / size[0], abs=1e-6)
        assert flatness(moving + rng.normal(0, 3e-4, moving.shape)) == pytest.approx(size[1] / size[0], abs=0.025)


def test_motion_stands_out_of_noise():
    rng = np.random.default_rng(0)
    n = np.arange(800)
    for scale in (1.0, 1e-4):
        assert moves(scale * 500 * np.sin(n / 50))
        assert moves(scale * (500 * np.sin(n / 50) + rng.normal(0, 5, 800)))
        assert moves(scale * np.round(60 * np.clip(n / 100 - 4, 0, 1)))
        assert not moves(scale * rng.normal(0, 5, 800))
        assert not moves(scale * np.round(rng.normal(0, 1, 800)))
        assert not moves(scale * np.full(800, 12000.0))
        assert not moves(scale * (12000.0 + (n == 300)))


# ---- rigs ----

RIG = """format = "hand-session/1"
[hand]
name = "pendulum"
[rig]
model = "rig.xml"
[signals]
position = "joint:hinge:position"
torque = "actuator:motor:force"
[[trial]]
kind = "motion"
log = "log/a.csv"
set = { "body:mass:mass" = 0.5, "option:gravity" = [0, 0, -9.81] }
"""
RIG_MODEL = """<mujoco><worldbody><body name="mass"><joint name="hinge"/><geom size="0.1"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"""


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "log").mkdir()
    (tmp_path / "session.toml").write_text(RIG)
    (tmp_path / "rig.xml").write_text(RIG_MODEL)
    (tmp_path / "log/a.csv").write_text("time,position,torque,supply\n0,0,1,7\n0.1,1,1,7\n0.2,2,,7\n")
    return tmp_path


def test_a_rig(rig):
    session = read_session(rig)
    assert session.palm is None and session.fingers == ()
    assert session.rig.signals == {"position": "joint:hinge:position", "torque": "actuator:motor:force"}
    assert session.trials[0].set == {"body:mass:mass": 0.5, "option:gravity": [0, 0, -9.81]}
    assert check_session(session) == ()  # further columns are channels of their own


RIG_REFUSED = {
    "model_missing": ('"rig.xml"', '"rg.xml"', ["rg.xml", "MJCF"]),
    "model_outside": ('"rig.xml"', '"../rig.xml"', ["leaves"]),
    "signals_missing": ("[signals]", "[signal]", ["[signals]"]),
    "signal_kind": ('"joint:hinge:position"', '"jont:hinge:position"', ["jont:hinge:position", "joint:NAME:position"]),
    "signal_quantity": ('"joint:hinge:position"', '"joint:hinge:positon"', ["positon", 'did you mean "position"']),
    "signal_joint": ('"joint:hinge:position"', '"joint:hnge:position"', ["hnge", 'did you mean "hinge"']),
    "signal_actuator": ('"actuator:motor:force"', '"actuator:moto:force"', ["moto", 'did you mean "motor"']),
    "signal_number": ('"actuator:motor:force"', "4", ["torque is 4"]),
    "signal_twice": ('"actuator:motor:force"', '"joint:hinge:position"', ["two columns"]),
    "trial_kind": ('"motion"', '"grasp"', ["grasp", "motion"]),
    "set_key": ('"body:mass:mass"', '"mass"', ['"mass"', "kind:name:attribute"]),
    "set_value": ("= 0.5", '= "heavy"', ["body:mass:mass", "heavy", "number"]),
    "set_no_table": ('{ "body:mass:mass" = 0.5, "option:gravity" = [0, 0, -9.81] }', "5", ["set is 5"]),
    "with_palm": (
        "[rig]",
        '[palm]\nmarkers = { origin = "a", medial = "b", lateral = "c" }\n[rig]',
        ["[rig]", "[palm]"],
    ),
    "column_missing": ("position = ", "positio = ", ['"positio"', 'did you mean "position"', "a.csv"]),
}


@pytest.mark.parametrize("case", RIG_REFUSED)
def test_rig_refused(case, rig):
    old, new, words = RIG_REFUSED[case]
    edit(rig, old, new)
    message = refusal(lambda: check_session(read_session(rig)))
    for word in words:
        assert word in message, (word, message)


def test_rig_model_that_is_no_mjcf(rig):
    for text in ("<robot/>", "<mujoco>", ""):
        (rig / "rig.xml").write_text(text)
        assert "rig.xml" in refusal(read_session, rig)


# ---- damage at random places: a valid reading, or a SessionError, never anything else ----


def survives(call, *args):
    try:
        call(*args)
    except SessionError as error:
        assert "\n" not in str(error)
        return 0
    return 1


@pytest.mark.parametrize("name", ["mocap/index.c3d", "mocap/ring.tsv", "log/index.csv"])
def test_cut_and_damaged_recordings(name, root):
    rng = np.random.default_rng(0)
    file = root / name
    data = file.read_bytes()
    read = read_log if name.startswith("log") else read_mocap
    assert survives(read, file)
    for i in range(150):
        file.write_bytes(data[: rng.integers(len(data))])
        cut = survives(read, file)
        assert not (cut and name.endswith("c3d")), "a C3D that ends early was taken for a whole one"
    for i in range(150):
        damaged = bytearray(data)
        places = rng.integers(0, len(data) if i % 2 else 1500, rng.integers(1, 8))
        for place in places:
            damaged[place] = rng.integers(256)
        file.write_bytes(damaged)
        survives(read, file)


def test_cut_and_damaged_manifest(root):
    rng = np.random.default_rng(0)
    data = (root / "session.toml").read_bytes()
    for i in range(300):
        damaged = bytearray(data[: rng.integers(len(data))] if i % 3 == 0 else data)
        for place in rng.integers(0, len(damaged), rng.integers(0, 5)) if damaged else ():
            damaged[place] = rng.choice(np.frombuffer(data, "u1")) if i % 2 else rng.integers(256)
        (root / "session.toml").write_bytes(damaged)
        survives(read_session, root)


def test_every_value_of_the_manifest_replaced_by_another_type(root):
    values = ["5", "true", '"x"', "[]", "{}", "[[1]]", "{ a = 1 }", "nan", "1979-05-27"]
    places = list(re.finditer(r"= (.+)$", MANIFEST, re.MULTILINE))
    assert len(places) > 30
    for place in places:
        for value in values:
            (root / "session.toml").write_text(MANIFEST[: place.start(1)] + value + MANIFEST[place.end(1) :], "utf-8")
            survives(read_session, root)


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared recordings here")
def test_every_shared_session():
    folders = sorted(file.parent for file in SHARED.glob("*/*/session.toml"))
    assert folders
    for folder in folders:
        session = read_session(folder)
        assert session.trials and session.notes == (), folder
        check_session(session)
