"""Break what a command reads, and run commands that must be refused."""

from __future__ import annotations

from pathlib import Path

from hand_model.cli import main


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
