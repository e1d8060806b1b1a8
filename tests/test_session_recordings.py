"""What only a session's recordings tell: labels, units, occlusion, motion."""

from __future__ import annotations

import numpy as np
import pytest
from session_refusal import edit, refusal
from session_writers import FINGERS, PALM, PROBE, rigid_markers, write_c3d, write_log, write_session

from hand_model.diagnose.finger import _on_a_line, finger_calls
from hand_model.diagnose.locate import angles
from hand_model.session import check_session, read_session
from hand_model.session.check import flatness, missing_direction, moves, on_a_line


@pytest.fixture
def root(tmp_path):
    return write_session(tmp_path / "session")


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


def test_one_marker_of_four_may_stay_hidden_in_a_recording_where_another_shows_it(root):
    edit(root, '"ID3"]', '"ID3", "ID4"]')
    edit(
        root,
        '[[trial]]\nkind = "grasp"',
        '[[trial]]\nkind = "flexion"\nfinger = "index"\nmocap = "mocap/b.c3d"\n\n[[trial]]\nkind = "grasp"',
    )
    labels = [*PALM, *FINGERS["index"][0], *FINGERS["index"][1], "ID4"]
    x = rigid_markers(labels, 300)
    write_c3d(root / "mocap/index.c3d", labels, x)
    x[:, -1] = np.nan
    write_c3d(root / "mocap/b.c3d", labels, x)
    (note,) = [n for n in check_session(read_session(root)) if "never seen" in n and "index/distal" in n]
    assert note.startswith("mocap/b.c3d") and '"ID4"' in note
    write_c3d(root / "mocap/index.c3d", labels, x)  # nobody knows where it is
    assert '"ID4" (index/distal) is occluded in every frame' in refusal(lambda: check_session(read_session(root)))


def test_a_diagnosis_leaves_out_a_finger_with_markers_on_one_line_and_hears_the_others(root):
    assert not any("one line" in note for note in check_session(read_session(root), dead=True))
    spoil_line(0.0)(root)
    session = read_session(root)
    (note,) = [note for note in check_session(session, dead=True) if "one line" in note]
    assert note.startswith("mocap/index.c3d") and "IP1, IP2, IP3" in note and "nothing was read" in note
    assert {f.name: _on_a_line(session, f) for f in session.fingers} == {"index": True, "ring": False}


def test_a_diagnosis_leaves_out_a_finger_that_is_held_and_says_how_far_it_turns(root, monkeypatch):
    """A weight that the drive does not lift: the axis of what hardly turns is noise, and so is its sign."""
    monkeypatch.setattr(angles, "LEAST_TURN", np.pi)
    for call in finger_calls(read_session(root)):
        reading = call()
        assert reading.angles is None and not reading.stations
        assert f'"{reading.finger}" turns by ' in reading.notes[0] and "180 deg at least" in reading.notes[0]


def test_counts_that_are_not_believed_say_nothing_of_the_linkage_either(recorded):
    """A position that echoes the command would stand for the proximal joint's angle."""
    session = read_session(recorded)
    for unread in ((), ("index",)):
        ((call,),) = (finger_calls(session, unread),)
        stations = call().stations
        assert [s.signal for s in stations] == ([] if unread else ["encoder"]) + ["markers"]
        assert all(("load" in state.extra) != bool(unread) for state in stations[-1].naming.balance.states)


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


def test_markers_on_a_line_are_told_by_their_noise():
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(1500, 3, 3))
    flat, line = (np.array([[0, 0, 0], [0.033, 0, 0], [0.015, height, 0]]) for height in (0.0014, 0.0))
    slipped = flat + 1e-4 * noise
    slipped[800:, 1] += [0.004, 0.002, 0.0]
    assert not on_a_line(flat + 1e-4 * noise) and not on_a_line(slipped)
    assert on_a_line(flat + 5e-4 * noise) and on_a_line(line + 1e-4 * noise) and on_a_line(line + 0 * noise)


def test_markers_that_a_hinge_carries_are_off_a_line_where_all_frames_together_say_so():
    """A frame's turn about the line is not known, and need not be: a millimetre off it at half as much noise is plain
    in many frames, and not in few."""
    noise = 4e-4 * np.random.default_rng(0).normal(size=(4000, 3, 3))
    flat, line = (np.array([[0, 0, 0], [0.033, 0, 0], [0.015, height, 0]]) for height in (0.0014, 0.0))
    assert on_a_line(flat + noise) and not on_a_line(flat + noise, hinged=True)
    assert on_a_line(flat + noise[:40], hinged=True) and on_a_line(line + noise, hinged=True)


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
