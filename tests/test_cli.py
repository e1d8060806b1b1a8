"""The command line: help in no time, the loop, and one sentence for every bad input."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hand_model.cli import COMMANDS, main
from hand_model.twin import Plan, bebionic, record

SMALL = Plan(flexion=("full", "half", "full"), validation=("half",), excitations=0, still_s=0.3)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A small session of one finger whose marker files are text."""
    folder = tmp_path_factory.mktemp("cli") / "session"
    record(bebionic("left", fingers=["index"]), folder, 1, plan=SMALL, mocap_format="tsv")
    return folder


@pytest.fixture(scope="module")
def loop(recorded, tmp_path_factory):
    """Hand, compiled folder and report, made by the three commands."""
    out = tmp_path_factory.mktemp("loop")
    assert main(["identify", str(recorded), "--output", str(out / "left.hand")]) == 0
    assert main(["compile", str(out / "left.hand"), "--output", str(out / "compiled")]) == 0
    assert main(["replay", str(out / "compiled"), str(recorded), "--output", str(out / "report")]) == 0
    return out


@pytest.fixture
def session(recorded, tmp_path):
    """A copy to break."""
    return Path(shutil.copytree(recorded, tmp_path / "broken"))


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text, old
    file.write_text(text.replace(old, new))


def refused(capsys, *argv: str) -> str:
    """Run a command that must be refused: status 2, nothing on stdout, one sentence on stderr."""
    capsys.readouterr()
    assert main([str(a) for a in argv]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "Traceback" not in err
    return err


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
    start = next(i for i, line in enumerate(lines) if line and line.split("\t")[-1].strip().lstrip("-")[:1].isdigit()
                 and len(line.split("\t")) >= 3 * len(names))  # fmt: skip
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


def test_help_is_quick_and_light():
    code = (
        "import sys; from hand_model.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'scipy', 'mujoco', 'pinocchio', 'matplotlib', 'lxml') if m in sys.modules])"
    )
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    seconds = time.perf_counter() - start
    assert done.stdout.strip().endswith("[]")
    for command in COMMANDS:
        assert command in done.stdout
    assert seconds < 2.0  # 0.1 s where nothing else runs; the bound leaves room for a busy machine


def test_the_package_is_light_and_its_verbs_can_be_called():
    code = (
        "import sys, hand_model\n"
        "assert not {'numpy', 'mujoco', 'scipy'} & set(sys.modules)\n"
        "from hand_model import identify, HandModelError\n"
        "import hand_model.identify.finger as finger\n"
        "assert finger.identify_finger\n"
        "for verb in ('identify', 'compile', 'replay', 'conform', 'check', 'diagnose', 'demo'):\n"
        "    assert callable(getattr(hand_model, verb)), verb\n"
        "for name in hand_model.__all__: getattr(hand_model, name)\n"
        "try: identify('/nowhere')\n"
        "except HandModelError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "/nowhere/session.toml: no such file" in done.stdout


def test_as_a_process(recorded, tmp_path):
    """Exit status and streams as a shell sees them."""
    argv = [sys.executable, "-c", "import sys; from hand_model.cli import main; sys.exit(main())"]
    done = subprocess.run(
        [*argv, "identify", str(recorded / "none"), "--output", "x.hand"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_mistyped_command_and_option(capsys):
    assert 'did you mean "identify"' in refused(capsys, "identfy", "x")
    with pytest.raises(SystemExit) as caught:
        main(["identify", "x"])
    assert caught.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_loop(loop):
    assert (loop / "compiled" / "bebionic_left.xml").is_file() and (loop / "compiled" / "bebionic_left.urdf").is_file()
    figures = json.loads((loop / "report" / "figures.json").read_text())
    assert figures["trials"] == [{"name": "log/flexion_index_b.csv", "finger": "index", "held_out": True,
                                  "frames": figures["trials"][0]["frames"]}]  # fmt: skip
    assert figures["fingers"]["index"]["encoder"]["over_noise"] < 1.3
    assert max(figures["agreement_m"].values()) < 1e-9
    assert (loop / "report" / "report.html").read_text().startswith("<!DOCTYPE html>")


def test_results_go_to_stdout_and_progress_to_stderr(recorded, tmp_path, capsys):
    assert main(["identify", str(recorded), "--output", str(tmp_path / "a.hand"), "--verbose"]) == 0
    out, err = capsys.readouterr()
    assert "proximal" in out and str(tmp_path / "a.hand") in out
    assert err.startswith("index: ")


def test_the_same_report_twice(loop, recorded, tmp_path):
    assert main(["replay", str(loop / "compiled"), str(recorded), "--output", str(tmp_path / "again")]) == 0
    for name in ("report.html", "figures.json"):
        assert (tmp_path / "again" / name).read_bytes() == (loop / "report" / name).read_bytes()


def test_outputs_replace_their_own_kind_only(loop, recorded, tmp_path, capsys):
    foreign = tmp_path / "thesis"
    foreign.mkdir()
    (foreign / "chapter.tex").write_text("precious")
    assert "chapter.tex" in refused(capsys, "replay", loop / "compiled", recorded, "--output", foreign)
    refused(capsys, "compile", loop / "left.hand", "--output", foreign)
    assert "chapter.tex" in refused(capsys, "demo", "--output", foreign)
    assert "is a folder" in refused(capsys, "identify", recorded, "--output", foreign)
    assert "is a file" in refused(capsys, "identify", recorded, "--output", foreign / "chapter.tex" / "left.hand")
    assert "not a .hand file" in refused(capsys, "identify", recorded, "--output", foreign / "chapter.tex")
    assert [f.name for f in foreign.iterdir()] == ["chapter.tex"] and (
        foreign / "chapter.tex"
    ).read_text() == "precious"
    assert main(["replay", str(loop / "compiled"), str(recorded), "--output", str(loop / "report")]) == 0
    assert sorted(f.name for f in loop.iterdir()) == ["compiled", "left.hand", "report"]


def test_compare_and_check(loop, capsys, tmp_path):
    hand = str(loop / "left.hand")
    assert main(["compare", hand, hand, "--output", str(tmp_path / "page")]) == 0
    out = capsys.readouterr().out
    assert "Repeatability" in out and "2 of 2 pairs of axes repeat" in out and "Parallelism" in out
    assert (tmp_path / "page" / "comparison.html").is_file()
    assert (
        main(["check", str(loop / "compiled" / "bebionic_left.xml"), str(loop / "compiled" / "bebionic_left.xml")]) == 0
    )
    assert "no folder" in refused(capsys, "check", loop / "left.hand")


def test_record(tmp_path, capsys):
    argv = [
        "record",
        str(tmp_path / "s"),
        "--fingers",
        "index",
        "--seed",
        "4",
        "--answer",
        str(tmp_path / "answer.json"),
    ]
    assert main(argv) == 0
    assert (tmp_path / "s" / "session.toml").is_file() and json.loads((tmp_path / "answer.json").read_text())[
        "seed"
    ] == 4
    assert "not an empty folder" in refused(capsys, *argv)
    assert 'did you mean "index"' in refused(capsys, "record", tmp_path / "t", "--fingers", "indx")
    assert "named twice" in refused(capsys, "record", tmp_path / "t", "--fingers", "index,index")
    assert "is a folder" in refused(capsys, "record", tmp_path / "t", "--answer", tmp_path)
    message = refused(capsys, "record", tmp_path / "t", "--effect", "stribek_friction")
    assert 'did you mean "stribeck_friction"' in message and not (tmp_path / "t").exists()


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


def test_the_demo_ends_with_figures_and_the_report(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "--side", "left"]) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    page = tmp_path / "hand_model_demo" / "bebionic_left_report" / "report.html"
    assert lines[-1].endswith(str(page)) and page.is_file()
    truth = next(line for line in lines if line.strip().startswith("axes off by"))
    assert float(truth.split("off by ")[1].split()[0]) < 0.5


PENDULUM = """<mujoco><option timestep="0.002" gravity="0 0 -9.81"/><worldbody><body name="mass">
<joint name="hinge" axis="0 1 0" damping="0.01"/><geom type="sphere" size="0.02" pos="0 0 -0.2" mass="0.3"/>
</body></worldbody></mujoco>"""


@pytest.fixture
def rig(tmp_path):
    """A pendulum let go by its own model: replayed, it must move as recorded."""
    import mujoco

    root = tmp_path / "pendulum"
    (root / "log").mkdir(parents=True)
    (root / "pendulum.xml").write_text(PENDULUM)
    trials = ""
    for name, start, extra in (("a", 0.8, ""), ("b", 0.5, 'purpose = "validate"\n')):
        model = mujoco.MjModel.from_xml_string(PENDULUM)
        data = mujoco.MjData(model)
        data.qpos[0] = start
        lines = ["time,position"]
        for i in range(3000):
            if i % 5 == 0:
                lines.append(f"{0.002 * i!r},{float(data.qpos[0])!r}")
            mujoco.mj_step(model, data)
        (root / "log" / f"{name}.csv").write_text("\n".join(lines) + "\n")
        trials += f'[[trial]]\nkind = "motion"\nlog = "log/{name}.csv"\n{extra}'
    (root / "session.toml").write_text(
        'format = "hand-session/1"\n[hand]\nname = "pendulum"\n[rig]\nmodel = "pendulum.xml"\n'
        f'[signals]\nposition = "joint:hinge:position"\n{trials}'
    )
    return root


def test_replay_of_a_rig_needs_no_description(rig, tmp_path, capsys):
    assert main(["replay", str(rig), "--output", str(tmp_path / "report")]) == 0
    assert "On 1 validation trial, the motion simulated in open loop" in capsys.readouterr().out
    rows = json.loads((tmp_path / "report" / "figures.json").read_text())["joints"]
    assert [r["trial"] for r in rows] == ["log/a.csv", "log/b.csv"] and [r["held_out"] for r in rows] == [False, True]
    assert all(r["position_rmse"] < 0.05 for r in rows)
    assert "<svg" in (tmp_path / "report" / "report.html").read_text()


def test_a_rig_without_a_position_is_refused(rig, tmp_path, capsys):
    out = tmp_path / "out"
    edit(rig / "session.toml", "joint:hinge:position", "joint:hinge:velocity")
    assert "joint:NAME:position" in refused(capsys, "diagnose", rig, "--output", out)
    edit(rig / "session.toml", "joint:hinge:velocity", "joint:hinge:position")
    (rig / "log" / "a.csv").write_text("time,position\n" + "".join(f"{0.01 * i},\n" for i in range(500)))
    message = refused(capsys, "diagnose", rig, "--output", out)
    assert "a.csv" in message and "position" in message
    assert not out.exists()


def test_what_is_not_meant_for_a_rig_or_a_folder_is_refused(rig, loop, tmp_path, capsys):
    """And at once, before minutes of work are lost."""
    (tmp_path / "file").write_text("x")
    assert "is a file" in refused(capsys, "diagnose", rig, "--output", tmp_path / "file")
    assert "session itself" in refused(capsys, "diagnose", rig, "--output", rig)
    assert "brings its own model" in refused(
        capsys, "diagnose", rig, "--output", tmp_path / "o", "--model", loop / "left.hand"
    )
    assert not (tmp_path / "o").exists() and (rig / "pendulum.xml").read_text() == PENDULUM
    assert "--fix" in refused(capsys, "check", loop / "compiled", "--fix", tmp_path / "fixed")
    assert "--json" in refused(capsys, "check", loop / "compiled", "--json")


def test_the_python_call_diagnoses_a_rig_as_the_command_does(rig):
    import hand_model
    from hand_model.rig.findings import RigFindings

    findings = hand_model.diagnose(rig)
    assert isinstance(findings, RigFindings)
    assert findings.protocol["held_out"] == ["log/b.csv"]


def test_a_diagnosis_of_a_rig_without_a_model_leaves_none(rig, tmp_path):
    out = tmp_path / "out"
    assert main(["diagnose", str(rig), "--output", str(out)]) == 0
    assert sorted(f.name for f in out.iterdir()) == ["findings.json", "report.html", "rig.xml", "rig_declared.xml"]
    assert main(["diagnose", str(rig), "--output", str(out), "--no-model"]) == 0
    assert sorted(f.name for f in out.iterdir()) == ["findings.json", "report.html"]


def test_what_hands_and_rigs_need(rig, loop, recorded, tmp_path, capsys):
    assert "name its folder before the session" in refused(capsys, "replay", recorded, "--output", tmp_path / "r")
    assert "rig" in refused(capsys, "replay", loop / "compiled", rig, "--output", tmp_path / "r")
    assert "rig" in refused(capsys, "identify", rig, "--output", tmp_path / "x.hand")
    assert 'kind "grasp"' in refused(capsys, "touch", recorded)
    assert not (tmp_path / "r").exists()


def test_a_bar_stands_below_the_results_and_leaves_nothing_behind():
    import io

    from hand_model.cli.progress import WIDTH, Progress

    def screen(text: str) -> list[str]:
        rows, column = [""], 0
        for letter in text:
            if letter == "\n":
                rows, column = [*rows, ""], 0
            elif letter == "\r":
                column = 0
            else:
                rows[-1] = rows[-1][:column] + letter + rows[-1][column + 1 :]
                column += 1
        return [row.rstrip() for row in rows]

    stream = io.StringIO()
    progress = Progress(stream, lines=True, bar=True)
    progress.share(0.5)
    progress("index: consistent")
    assert screen(stream.getvalue()) == ["index: consistent", f"[{'#' * (WIDTH // 2)}{'.' * (WIDTH // 2)}]  50 %"]
    progress.share(1.0)
    assert screen(stream.getvalue()) == ["index: consistent", ""]
    plain = io.StringIO()
    progress = Progress(plain, lines=True, bar=False)
    progress.share(0.5)
    progress("index: consistent")
    assert plain.getvalue() == "index: consistent\n"
