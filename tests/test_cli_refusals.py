"""The command line: one sentence for every bad input."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from cli_refusal import edit, refused


@pytest.fixture
def session(recorded, tmp_path):
    """A copy to break."""
    return Path(shutil.copytree(recorded, tmp_path / "broken"))


def log_of(session: Path) -> Path:
    return session / "log" / "flexion_index.csv"


def mocap_of(session: Path) -> Path:
    return session / "mocap" / "flexion_index.tsv"


def rewrite_log(session: Path, column: str, values) -> None:
    """Replace a column of the flexion log; values: of the old column (n,) -> (n,)."""
    head, *rows = [line.split(",") for line in log_of(session).read_text().splitlines()]
    at = head.index(column)
    new = values(np.array([float(row[at] or "nan") for row in rows]))
    lines = [",".join(head)]
    for row, value in zip(rows, new, strict=True):
        row[at] = "" if np.isnan(value) else repr(float(value))
        lines.append(",".join(row))
    log_of(session).write_text("\n".join(lines) + "\n")


def rewrite_markers(file: Path, change) -> None:
    """Change the trajectories of a QTM TSV: change(dict label -> (n, 3) [mm]) in place."""
    lines = file.read_text().splitlines()
    names = next(line for line in lines if line.startswith("MARKER_NAMES")).split("\t")[1:]
    start = next(
        i
        for i, line in enumerate(lines)
        if line and line.split("\t")[-1].strip().lstrip("-")[:1].isdigit() and len(line.split("\t")) >= 3 * len(names)
    )
    table = [line.split("\t") for line in lines[start:]]
    lead = len(table[0]) - 3 * len(names)
    value = np.array([[float(v) if v else np.nan for v in row[lead:]] for row in table]).reshape(
        len(table), len(names), 3
    )
    tracks = {name: value[:, i] for i, name in enumerate(names)}
    change(tracks)
    for row, points in zip(table, np.stack([tracks[n] for n in names], axis=1), strict=True):
        row[lead:] = ["" if np.isnan(v) else repr(float(v)) for v in points.ravel()]
    file.write_text("\n".join([*lines[:start], *("\t".join(row) for row in table)]) + "\n")


# Every bad input: how to make it, and what the sentence must name.


def _wrong_label(root):
    edit(root / "session.toml", '"IN_P1"', '"IN_PX1"')
    return ["flexion_index", "IN_PX1", "did you mean", "IN_P1"]


def _two_markers(root):
    edit(root / "session.toml", '["IN_P1", "IN_P2", "IN_P3"]', '["IN_P1", "IN_P2"]')
    return ["index", "proximal", "three"]


def _one_line(root):
    def change(tracks):
        tracks["IN_P3"][:] = 2 * tracks["IN_P2"] - tracks["IN_P1"]

    rewrite_markers(mocap_of(root), change)
    return ["flexion_index", "IN_P1, IN_P2, IN_P3", "line"]


def _occluded(root):
    rewrite_markers(mocap_of(root), lambda tracks: tracks["IN_D2"].fill(np.nan))
    return ["flexion_index", "IN_D2"]


def _empty_log(root):
    log_of(root).write_text("")
    return ["flexion_index.csv", "empty"]


def _header_only(root):
    log_of(root).write_text(log_of(root).read_text().splitlines()[0] + "\n")
    return ["flexion_index.csv"]


def _still_log(root):
    rewrite_log(root, "position", lambda v: np.full_like(v, v[0]))
    return ["flexion_index.csv", "position"]


def _other_motion(root):
    rng = np.random.default_rng(0)

    def wander(v):
        steps = rng.normal(size=len(v))
        path = np.convolve(np.cumsum(steps), np.ones(15) / 15, mode="same")
        return v.min() + np.ptp(v) * (path - path.min()) / np.ptp(path)

    rewrite_log(root, "position", wander)
    return ["flexion_index.csv", "correlate"]


def _metres(root):
    def change(tracks):
        for track in tracks.values():
            track *= 1000

    for file in (root / "mocap").glob("*.tsv"):
        rewrite_markers(file, change)
    return ["mocap", "unit"]


def _no_trial(root):
    text = (root / "session.toml").read_text()
    head, *trials = text.split("[[trial]]")
    kept = [t for t in trials if 'kind = "flexion"' not in t]
    assert len(kept) < len(trials)
    (root / "session.toml").write_text("[[trial]]".join([head, *kept]))
    return ["index", "flexion"]


def _outside(root):
    edit(root / "session.toml", '"mocap/flexion_index.tsv"', '"../other/flexion_index.tsv"')
    return ["../other/flexion_index.tsv", "folder"]


def _missing_file(root):
    mocap_of(root).unlink()
    return ["flexion_index.tsv"]


def _no_column(root):
    edit(log_of(root), "position", "positon")
    return ["flexion_index.csv", "position"]


def _foreign_c3d(root):
    (root / "mocap" / "flexion_index.c3d").write_bytes(b"\x89PNG\r\n" + bytes(range(256)) * 8)
    edit(root / "session.toml", "mocap/flexion_index.tsv", "mocap/flexion_index.c3d")
    return ["flexion_index.c3d"]


def _truncated_c3d(root):
    from session_writers import write_c3d

    labels = ["PO", "PM", "PL", "IN_P1", "IN_P2", "IN_P3", "IN_D1", "IN_D2", "IN_D3"]
    file = write_c3d(root / "mocap" / "flexion_index.c3d", labels, np.random.default_rng(0).normal(size=(200, 9, 3)))
    file.write_bytes(file.read_bytes()[:3000])
    edit(root / "session.toml", "mocap/flexion_index.tsv", "mocap/flexion_index.c3d")
    return ["flexion_index.c3d"]


def _not_toml(root):
    (root / "session.toml").write_text("[hand\nname = 3")
    return ["session.toml"]


BREAKS = [
    _wrong_label,
    _two_markers,
    _one_line,
    _occluded,
    _empty_log,
    _header_only,
    _still_log,
    _other_motion,
    _metres,
    _no_trial,
    _outside,
    _missing_file,
    _no_column,
    _foreign_c3d,
    _truncated_c3d,
    _not_toml,
]


@pytest.mark.parametrize("broken", BREAKS, ids=lambda f: f.__name__.lstrip("_"))
def test_bad_input_gets_one_sentence(broken, session, tmp_path, capsys):
    named = broken(session)
    target = tmp_path / "out" / "x.hand"
    message = refused(capsys, "identify", session, "--output", target)
    for word in named:
        assert word in message, (word, message)
    assert not target.exists() and not target.parent.exists()


def test_hand_and_description_that_cannot_be_read(loop, recorded, tmp_path, capsys):
    assert "no such file" in refused(capsys, "compile", tmp_path / "none.hand", "--output", tmp_path / "c")
    (tmp_path / "bad.hand").write_text('{"format": "hand-model/1"}')
    assert "bad.hand" in refused(capsys, "compile", tmp_path / "bad.hand", "--output", tmp_path / "c")
    assert "hand.json" in refused(capsys, "replay", recorded, recorded, "--output", tmp_path / "r")
    assert not (tmp_path / "c").exists() and not (tmp_path / "r").exists()
