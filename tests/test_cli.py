"""The command line: help in no time, the loop, what goes to which stream."""

from __future__ import annotations

import json
import subprocess
import sys
import time

import pytest
from cli_refusal import refused

from hand_model.cli import COMMANDS, main


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
    assert figures["trials"] == [
        {
            "name": "log/flexion_index_b.csv",
            "finger": "index",
            "held_out": True,
            "frames": figures["trials"][0]["frames"],
        }
    ]
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


def test_the_demo_ends_with_figures_and_the_report(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "--side", "left"]) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    page = tmp_path / "hand_model_demo" / "bebionic_left_report" / "report.html"
    assert lines[-1].endswith(str(page)) and page.is_file()
    truth = next(line for line in lines if line.strip().startswith("axes off by"))
    assert float(truth.split("off by ")[1].split()[0]) < 0.5


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
