"""The embedded sessions: where they are, how small, and that the script remakes them byte by byte."""

from __future__ import annotations

import importlib.util
import json
import tomllib
from importlib import resources
from pathlib import Path

from hand_model.session import read_session

ROOT = Path(__file__).resolve().parents[1]


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_embedded_sessions_are_reached_from_the_package():
    folder = resources.files("hand_model.assets") / "sessions"
    for name, fingers in (("left", 3), ("right", 6)):
        with resources.as_file(folder / name) as path:
            session = read_session(path)
            assert session.side == name and len(session.fingers) == fingers
            assert any(f.name.startswith("thumb") for f in session.fingers)
            assert any(t.validate for t in session.select("flexion"))
            assert sum(len(content) for content in files(path).values()) < 3_000_000


def test_the_script_remakes_them_byte_by_byte(tmp_path):
    spec = importlib.util.spec_from_file_location("make_sessions", ROOT / "scripts" / "make_sessions.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.make(tmp_path)
    want = ROOT / "assets" / "sessions"
    for name in ("left", "right"):
        assert files(tmp_path / name) == files(want / name)
        assert json.loads((tmp_path / f"{name}.answer.json").read_text()) == json.loads(
            (want / f"{name}.answer.json").read_text()
        )


def test_every_package_is_in_the_wheel():
    """The list in pyproject.toml is by hand because assets/ is mapped into the package: nothing may be missing from
    it.
    """
    listed = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    found = {str(p.parent.relative_to(ROOT)).replace("/", ".") for p in (ROOT / "hand_model").rglob("__init__.py")}
    assert listed == found | {"hand_model.assets"}
