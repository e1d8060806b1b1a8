"""Marker files: every format, unit, gap and label quirk gives the same trajectories."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
from session_writers import rigid_markers, write_c3d, write_c3d_bytes, write_motive, write_trc, write_tsv

from hand_model.errors import SessionError
from hand_model.session import read_mocap

LABELS = ["PO", "PM", "PL", "IP1", "IP2", "IP3"]
SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture
def truth():
    position = rigid_markers(LABELS, 40)
    position[3:9, 1] = np.nan
    position[0, 0] = np.nan
    position[-1, -1] = np.nan
    return position


WRITERS = {
    "c3d_mm": lambda p, x: write_c3d(p / "a.c3d", LABELS, x),
    "c3d_m": lambda p, x: write_c3d(p / "a.c3d", LABELS, x, unit="m"),
    "c3d_no_unit": lambda p, x: write_c3d(p / "a.C3D", LABELS, x, units_key=False),
    "c3d_analog": lambda p, x: write_c3d(p / "a.c3d", LABELS, x, analog=3),
    "tsv": lambda p, x: write_tsv(p / "a.tsv", LABELS, x),
    "tsv_nan": lambda p, x: write_tsv(p / "a.tsv", LABELS, x, gap="NaN"),
    "tsv_zero": lambda p, x: write_tsv(p / "a.tsv", LABELS, x, gap="0.000"),
    "tsv_bare": lambda p, x: write_tsv(p / "a.tsv", LABELS, x, frame_time=False, column_header=False),
    "tsv_no_time": lambda p, x: write_tsv(p / "a.tsv", LABELS, x, frame_time=False),
    "tsv_no_columns": lambda p, x: write_tsv(p / "a.tsv", LABELS, x, column_header=False),
    "trc": lambda p, x: write_trc(p / "a.trc", LABELS, x),
    "trc_m_nan": lambda p, x: write_trc(p / "a.trc", LABELS, x, unit="m", gap="NaN", blank=False),
    "motive": lambda p, x: write_motive(p / "a.csv", LABELS, x),
    "motive_mm": lambda p, x: write_motive(p / "a.csv", LABELS, x, unit="Millimeters", version="1.22"),
    "motive_no_unit": lambda p, x: write_motive(p / "a.csv", LABELS, x, unit="", version="1.20", rigid_body=False),
}


@pytest.mark.parametrize("form", WRITERS)
def test_round_trip(form, truth, tmp_path):
    mocap = read_mocap(WRITERS[form](tmp_path, truth))
    assert mocap.labels == tuple(LABELS)
    assert mocap.rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(mocap.time_s, np.arange(40) / 100.0, atol=1e-12)
    np.testing.assert_allclose(mocap.position_world, truth, atol=2e-7)  # float32, or four decimals of a millimetre


@pytest.mark.parametrize("processor", [84, 85, 86], ids=["intel", "dec", "mips"])
@pytest.mark.parametrize("scale", [0.05, -0.05], ids=["integer", "float"])
def test_c3d_byte_orders(processor, scale, truth, tmp_path):
    seen = ~np.isnan(truth[..., 0])
    stored = np.where(seen[..., None], truth, 0.0) * 1000 / (abs(scale) if scale > 0 else 1.0)
    file = write_c3d_bytes(tmp_path / "a.c3d", LABELS, stored, seen, scale, processor)
    mocap = read_mocap(file)
    assert mocap.labels == tuple(LABELS) and mocap.rate_hz == 50.0
    np.testing.assert_allclose(mocap.position_world, truth, atol=6e-5 if scale > 0 else 2e-7)


def test_c3d_agrees_with_ezc3d(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    labels = [f"M{i}" for i in range(300)]  # more than 255: POINT:LABELS2
    file = write_c3d(tmp_path / "a.c3d", labels, rigid_markers(labels, 20), analog=2)
    mocap = read_mocap(file)
    theirs = ezc3d.c3d(str(file))["data"]["points"][:3].transpose(2, 1, 0) * 1e-3
    assert mocap.labels == tuple(labels)
    np.testing.assert_allclose(mocap.position_world, theirs, rtol=1e-7)


def test_c3d_longer_than_its_header_can_say(tmp_path):
    position = np.tile(rigid_markers(["A"], 7), (10_000, 1, 1))
    mocap = read_mocap(write_c3d(tmp_path / "a.c3d", ["A"], position))
    assert mocap.position_world.shape == (70_000, 1, 3)


def test_c3d_zero_triple_is_a_gap(tmp_path):
    position = rigid_markers(LABELS, 10)
    position[4, 2] = 0.0
    mocap = read_mocap(write_c3d(tmp_path / "a.c3d", LABELS, position))
    assert np.isnan(mocap.position_world[4, 2]).all() and np.isfinite(mocap.position_world[5]).all()


def test_gap_needs_no_all_three_coordinates(tmp_path):
    position = rigid_markers(LABELS, 10)
    position[4, 2, 1] = np.nan
    mocap = read_mocap(write_trc(tmp_path / "a.trc", LABELS, position))
    assert np.isnan(mocap.position_world[4, 2]).all()


def test_single_zero_coordinate_is_no_gap(tmp_path):
    position = rigid_markers(LABELS, 10)
    position[4, 2, 1] = 0.0
    assert np.isfinite(read_mocap(write_tsv(tmp_path / "a.tsv", LABELS, position)).position_world).all()


def test_time_column_with_lost_frames_is_kept(tmp_path):
    file = write_motive(tmp_path / "a.csv", LABELS, rigid_markers(LABELS, 20), frames=19)
    lines = file.read_text().splitlines()
    del lines[-6]
    file.write_text("\n".join(lines))
    steps = np.diff(read_mocap(file).time_s)
    assert steps.max() == pytest.approx(0.02) and np.sum(steps > 0.011) == 1


@pytest.mark.parametrize("write", [write_c3d, write_motive], ids=["c3d", "motive"])
def test_prefixes_and_ghosts(write, tmp_path):
    labels = ["Bob:PO", "Bob:PM", "*12", "U 001", "Unlabeled 1234", "*12", "Unlabeled 1234", "Bob:PL"]
    position = rigid_markers(labels, 12)
    mocap = read_mocap(write(tmp_path / ("a.c3d" if write is write_c3d else "a.csv"), labels, position))
    np.testing.assert_allclose(mocap.markers(["PL", "Bob:PO"]), position[:, [7, 0]], atol=1e-6)
    assert any("Bob:" in note for note in mocap.notes)
    with pytest.raises(SessionError, match='"PX"; did you mean') as caught:
        mocap.markers(["PX"])
    assert "Unlabeled" not in str(caught.value) and "*12" not in str(caught.value)


def test_prefixes_stay_where_two_subjects_share_labels(tmp_path):
    position = rigid_markers(["A:PO", "B:PO"], 12)
    mocap = read_mocap(write_c3d(tmp_path / "a.c3d", ["A:PO", "B:PO"], position))
    assert mocap.labels == ("A:PO", "B:PO")


def test_pieces_of_one_label_are_joined(tmp_path):
    position = rigid_markers(["PO", "PM", "PO"], 30)
    position[20:, 0] = np.nan
    position[:20, 2] = np.nan
    mocap = read_mocap(write_c3d(tmp_path / "a.c3d", ["PO", "PM", "PO"], position))
    joined = np.where(np.arange(30)[:, None] < 20, position[:, 0], position[:, 2])
    np.testing.assert_allclose(mocap.markers(["PO"])[:, 0], joined, atol=1e-6)
    assert any("joined" in note for note in mocap.notes)


def test_two_trajectories_of_one_label_are_refused_only_when_asked_for(tmp_path):
    mocap = read_mocap(write_c3d(tmp_path / "a.c3d", ["PO", "PM", "PO"], rigid_markers(["PO", "PM", "PO"], 30)))
    assert mocap.markers(["PM"]).shape == (30, 1, 3)
    with pytest.raises(SessionError, match="PO"):
        mocap.markers(["PO"])


def test_reading_again_is_free_and_sees_a_change(tmp_path):
    file = write_c3d(tmp_path / "a.c3d", LABELS, rigid_markers(LABELS, 10))
    first = read_mocap(file)
    assert read_mocap(file) is first
    with pytest.raises(ValueError):
        first.position_world[0] = 0.0  # shared readings cannot be spoilt
    write_c3d(file, LABELS, rigid_markers(LABELS, 11))
    assert len(read_mocap(file).time_s) == 11


def test_speed(tmp_path):
    file = write_c3d(tmp_path / "a.c3d", LABELS + ["A", "B", "C"], rigid_markers(LABELS + ["A", "B", "C"], 5000))
    best_s = np.inf
    for i in range(8):
        os.utime(file, ns=(i, i))
        start = time.perf_counter()
        read_mocap(file)
        best_s = min(best_s, time.perf_counter() - start)
    assert best_s < 0.05


def spoil_units(file):
    file.write_text(file.read_text().replace("\tmm\t", "\tfurlong\t"))
    return file


def cut(file, share):
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * share)])
    return file


def replaced(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    return file


def text_file(path, text):
    path.write_text(text)
    return path


X = rigid_markers(LABELS, 200)
REFUSED = {
    "missing": (lambda p: p / "no.c3d", "no such file"),
    "ending": (lambda p: text_file(p / "a.xyz", "1"), "valid: .c3d"),
    "c3d_cut_points": (lambda p: cut(write_c3d(p / "a.c3d", LABELS, X), 0.6), "truncated.*of 200 frames"),
    "c3d_cut_parameters": (lambda p: cut(write_c3d(p / "a.c3d", LABELS, X), 0.02), "a.c3d"),
    "c3d_foreign": (lambda p: text_file(p / "a.c3d", "time,position\n" * 500), "not a C3D"),
    "c3d_empty": (lambda p: text_file(p / "a.c3d", ""), "not a C3D"),
    "c3d_states_too_much": (
        lambda p: write_c3d_bytes(p / "a.c3d", LABELS, X * 1e3, np.ones(X.shape[:2], bool), -1.0, frames_stated=4000),
        "truncated.*of 4000 frames",
    ),
    "c3d_unit": (
        lambda p: write_c3d_bytes(p / "a.c3d", LABELS, X, np.ones(X.shape[:2], bool), -1.0, unit="qq"),
        "POINT:UNITS.*qq.*mm",
    ),
    "c3d_rate": (
        lambda p: write_c3d_bytes(p / "a.c3d", LABELS, X, np.ones(X.shape[:2], bool), -1.0, rate_hz=0.0),
        "POINT:RATE",
    ),
    "c3d_analog_only": (lambda p: write_c3d(p / "a.c3d", [], np.zeros((50, 0, 3)), analog=2), "no marker"),
    "c3d_nameless": (lambda p: write_c3d(p / "a.c3d", ["*1", "*2"], X[:, :2]), "no named marker"),
    "tsv_cut": (lambda p: cut(write_tsv(p / "a.tsv", LABELS, X), 0.7), "truncated"),
    "tsv_short": (lambda p: write_tsv(p / "a.tsv", LABELS, X, frames=300), "200 of 300 frames"),
    "tsv_foreign": (lambda p: text_file(p / "a.tsv", "a\tb\n1\t2\n"), "MARKER_NAMES"),
    "tsv_6d": (lambda p: replaced(write_tsv(p / "a.tsv", LABELS, X), "\t3D", "\t6D"), "6D"),
    "tsv_rate": (
        lambda p: replaced(write_tsv(p / "a.tsv", LABELS, X), "FREQUENCY\t100", "FREQUENCY\tfast"),
        "FREQUENCY",
    ),
    "tsv_count": (lambda p: replaced(write_tsv(p / "a.tsv", LABELS, X), "MARKERS\t6", "MARKERS\t7"), "NO_OF_MARKERS"),
    "tsv_cell": (lambda p: replaced(write_tsv(p / "a.tsv", LABELS, X), "0.01000", "soon"), "line 10, cell 2.*soon"),
    "trc_cut": (lambda p: cut(write_trc(p / "a.trc", LABELS, X), 0.7), "truncated"),
    "trc_foreign": (lambda p: text_file(p / "a.trc", "a\tb\n" * 10), "PathFileType"),
    "trc_unit": (lambda p: spoil_units(write_trc(p / "a.trc", LABELS, X)), "Units.*furlong"),
    "trc_binary": (lambda p: (p / "a.trc").write_bytes(b"\0\1\2") and p / "a.trc", "binary"),
    "motive_cut": (lambda p: cut(write_motive(p / "a.csv", LABELS, X), 0.7), "truncated"),
    "motive_foreign": (lambda p: text_file(p / "a.csv", "time,x\n0,1\n"), "Format Version"),
    "motive_bodies_only": (lambda p: write_motive(p / "a.csv", [], X[:, :0]), "Marker"),
    "motive_unit": (lambda p: replaced(write_motive(p / "a.csv", LABELS, X), "Meters", "Parsecs"), "Length Units"),
    "text_empty": (lambda p: text_file(p / "a.csv", "\n"), "empty"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case, tmp_path):
    make, words = REFUSED[case]
    file = make(tmp_path)
    with pytest.raises(SessionError, match=f"(?s){words}") as caught:
        read_mocap(file)
    assert file.name in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared recordings here")
def test_real_qtm_export():
    mocap = read_mocap(SHARED / "data/human-hand-mocap/recording.tsv")
    assert mocap.position_world.shape == (6000, 21, 3) and mocap.rate_hz == 100.0
    palm = mocap.markers(["hand_top", "hand_left", "hand_right"])
    assert 0.02 < np.nanmedian(np.linalg.norm(palm[:, 0] - palm[:, 1], axis=1)) < 0.15
    assert np.isnan(mocap.markers(["thumb_tip"])).any()
    assert not (mocap.position_world == 0.0).all(axis=2).any()


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared recordings here")
def test_real_c3d_agrees_with_ezc3d():
    ezc3d = pytest.importorskip("ezc3d")
    files = sorted(SHARED.glob("real/*/mocap/*.c3d")) + sorted(SHARED.glob("sessions/*/mocap/*.c3d"))[:8]
    assert files
    for file in files:
        theirs = ezc3d.c3d(str(file))["data"]
        expected = theirs["points"][:3].transpose(2, 1, 0) * 1e-3
        expected[theirs["meta_points"]["residuals"][0].T < 0] = np.nan
        np.testing.assert_allclose(read_mocap(file).position_world, expected, rtol=1e-7)
