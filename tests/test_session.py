"""Whole sessions, and what may be left out of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from session_refusal import edit, refusal
from session_writers import (
    FINGERS,
    MANIFEST,
    PALM,
    PROBE,
    rigid_markers,
    write_bag,
    write_c3d,
    write_session,
    write_tsv,
)

from hand_model.session import check_session, read_session

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture
def root(tmp_path):
    return write_session(tmp_path / "session")


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


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared recordings here")
def test_every_shared_session():
    folders = sorted(file.parent for file in SHARED.glob("*/*/session.toml"))
    assert folders
    for folder in folders:
        session = read_session(folder)
        assert session.trials and session.notes == (), folder
        check_session(session)
