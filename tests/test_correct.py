"""Corrected copies of sessions: what was wrong is put right, everything else and the original stay as they were."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from folder_contents import contents

from hand_model.diagnose.findings import Finding
from hand_model.diagnose.prove.correct import corrected_markers, refuse_output, write_corrected, write_csv, write_tsv
from hand_model.errors import HandModelError
from hand_model.output import replacing
from hand_model.session import Mocap, read_session
from hand_model.session.csv_log import read_csv_log
from hand_model.session.qtm_tsv import read_qtm_tsv


def finding(effect: str, trials: list[str], **more) -> Finding:
    where = {"finger": None, "actuator": "index", "trials": trials, **more.pop("where", {})}
    return Finding(effect, (effect,), 1.0, (), where, "", more, {}, None, "put right")


def test_markers_and_logs_are_read_back_as_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    position = rng.normal(0, 0.2, (40, 3, 3))
    position[5, 1] = np.nan
    mocap = Mocap(("A", "B 2", "C"), np.arange(40) / 119.7, position, 119.7, tmp_path / "x.c3d")
    write_tsv(tmp_path / "x.tsv", mocap)
    again = read_qtm_tsv(tmp_path / "x.tsv")
    assert again.labels == mocap.labels
    np.testing.assert_allclose(again.position_world, position, atol=1e-9)
    np.testing.assert_allclose(again.time_s, mocap.time_s, atol=1e-12)
    current = rng.normal(0, 9, 40)
    current[3] = np.nan
    write_csv(tmp_path / "x.csv", mocap.time_s, {"position": position[:, 0, 0], "current": current})
    log = read_csv_log(tmp_path / "x.csv")
    np.testing.assert_array_equal(log.column("current"), current)
    np.testing.assert_array_equal(log.time_s, mocap.time_s)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hand_model.twin.case import draw_case

    folder = tmp_path_factory.mktemp("twin") / "s"
    draw_case(7, "none").record(folder)
    return folder


def test_clock_and_counts_are_put_right_in_a_copy(session: Path, tmp_path: Path) -> None:
    read = read_session(session)
    before = contents(session)
    trial = next(t for t in read.trials if t.kind == "flexion")
    drift = finding("clock_drift", [trial.name], rate_minus_one={"value": 0.002, "unit": "1"})
    actuator = read.finger(trial.finger).actuator
    periodic = finding("encoder_periodic_error", [trial.name], where={"actuator": actuator})
    copy = write_corrected(read, [drift, periodic], {actuator: lambda counts: counts + 5.0}, tmp_path)
    assert contents(session) == before
    again = read_session(copy)
    for old, new in zip(read.trials, again.trials, strict=True):
        if old.log_path is None:
            continue
        a, b = old.log(), new.log()
        mine = old.finger == trial.finger
        np.testing.assert_allclose(np.diff(b.time_s), np.diff(a.time_s) / (1.002 if mine else 1.0), rtol=1e-9)
        shift = 5.0 if read.finger(old.finger).actuator == actuator else 0.0
        np.testing.assert_allclose(b.column("position"), a.column("position") + shift, rtol=1e-12)
        np.testing.assert_array_equal(b.column("current"), a.column("current"))


def test_nothing_is_written_where_nothing_is_to_be_put_right(session: Path, tmp_path: Path) -> None:
    physics = replace(finding("stribeck_friction", []), correction=None)
    assert write_corrected(read_session(session), [physics], {}, tmp_path) is None
    assert not list(tmp_path.iterdir())


def test_a_copy_that_cannot_be_written_leaves_the_earlier_one(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = read_session(session)
    trial = next(t for t in read.trials if t.kind == "flexion")
    drift = finding("clock_drift", [trial.name], rate_minus_one={"value": 0.002, "unit": "1"})
    before = contents(write_corrected(read, [drift], {}, tmp_path))

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("hand_model.diagnose.prove.correct.write_csv", full)
    with pytest.raises(OSError, match="no space"):
        write_corrected(read, [drift], {}, tmp_path)
    assert [f.name for f in tmp_path.iterdir()] == ["corrected"]
    assert contents(tmp_path / "corrected") == before


def test_the_copy_names_its_files_however_the_manifest_spells_them_and_may_lie_in_the_session(
    session: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "it's mine"
    shutil.copytree(session, folder)
    manifest = folder / "session.toml"
    manifest.write_text(manifest.read_text().replace('"log/', '"./log//') + "# the laboratory's own words\n")
    read = read_session(folder)
    trial = next(t for t in read.trials if t.kind == "flexion")
    drift = finding("clock_drift", [trial.name], rate_minus_one={"value": 0.002, "unit": "1"})
    for output in (folder / "diagnosis", folder):
        for _ in range(2):  # again into the same folder
            copy = write_corrected(read, [drift], {}, output)
            again = read_session(copy)
            assert [t.log_path.name for t in again.select("flexion", trial.finger)] == [
                f"{t.log_path.stem}_corrected.csv" for t in read.select("flexion", trial.finger)
            ]
            assert not list(copy.rglob("corrected"))
        shutil.rmtree(copy)


def test_a_file_of_several_fingers_is_put_right_finger_by_finger(session: Path) -> None:
    read = read_session(session)
    recorded = read.select("flexion")[0].mocap()
    seen = {label: recorded.markers([label]) for label in recorded.labels}
    first, second = recorded.labels[-2:]
    shift = np.array([0.0, 0.0, 0.004])

    def angles_of(label: str) -> SimpleNamespace:
        labels = (*read.palm.labels, label)
        data = SimpleNamespace(labels=labels, position_world=recorded.markers(labels))
        pose = SimpleNamespace(rotation=np.broadcast_to(np.eye(3), (len(recorded.time_s), 3, 3)))
        return SimpleNamespace(records=[SimpleNamespace(mocap=recorded, data=data, pose=pose)])

    columns = np.zeros((1, 12, 3))
    columns[0, 9:] = np.eye(3)  # the last of four markers
    slip = SimpleNamespace(effect="marker_slip", columns=columns, coefficients=shift)
    naming = SimpleNamespace(blocks=SimpleNamespace(record=np.zeros(1, int), time_s=np.zeros(1)), found=[slip])
    once = corrected_markers(angles_of(first), naming, 0, {"marker_slip"}, recorded)
    both = corrected_markers(angles_of(second), naming, 0, {"marker_slip"}, once)
    for label in recorded.labels:
        moved = shift if label in (first, second) else 0.0
        np.testing.assert_allclose(both.markers([label]), seen[label] - moved, atol=1e-12)


def test_an_output_that_is_a_file_or_holds_somebodys_corrections_is_refused_and_an_earlier_runs_are_forgotten(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "file", tmp_path / "file" / "deeper"):
        with pytest.raises(HandModelError, match="is a file"):
            refuse_output(path)
    theirs = tmp_path / "out" / "corrected" / "mine.c3d"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("x")
    with pytest.raises(HandModelError, match='"corrected", which no diagnosis wrote'):
        refuse_output(tmp_path / "out")
    with replacing(tmp_path / "out", ("corrected",), ("findings.json",)):
        assert theirs.is_file()
    (tmp_path / "out" / "findings.json").write_text("{}")
    refuse_output(tmp_path / "out")
    with replacing(tmp_path / "out", ("corrected", "model"), ("findings.json",)):
        pass
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["findings.json"]


def test_what_a_stopped_run_wrote_is_not_left(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()  # somebody's
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path, ("model", "model_before"), ("findings.json", "r.html")):
        (tmp_path / "model_before").mkdir()
        (tmp_path / "r.html").write_text("x")
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.iterdir()] == ["model"]
    (tmp_path / "findings.json").write_text("{}")  # an earlier run's
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path, ("model", "model_before"), ("findings.json", "r.html")):
        assert [p.name for p in tmp_path.iterdir()] == ["findings.json"]
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_an_output_that_cannot_be_written_is_refused_at_once() -> None:
    with pytest.raises(HandModelError, match="nothing can be written into /proc"):
        refuse_output(Path("/proc/nope/deeper"))
