"""The embedded sessions: where they are, how small, and that the script remakes them byte by byte."""

from __future__ import annotations

import importlib.util
import json
import tomllib
from importlib import resources
from pathlib import Path

import pytest
from folder_contents import contents

from hand_model.session import read_session

ROOT = Path(__file__).resolve().parents[1]


def flat(tree, path=()):
    """Path -> leaf of nested tables and lists."""
    if not isinstance(tree, (dict, list)):
        return {path: tree}
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    return {k: v for key, value in items for k, v in flat(value, (*path, key)).items()}


def test_embedded_sessions_are_reached_from_the_package():
    folder = resources.files("hand_model.assets") / "sessions"
    for name, fingers in (("left", 3), ("right", 6)):
        with resources.as_file(folder / name) as path:
            session = read_session(path)
            assert session.side == name and len(session.fingers) == fingers
            assert any(f.name.startswith("thumb") for f in session.fingers)
            assert any(t.validate for t in session.select("flexion"))
            assert sum(len(content) for content in contents(path).values()) < 3_000_000


def test_the_script_remakes_them_byte_by_byte(tmp_path):
    spec = importlib.util.spec_from_file_location("make_sessions", ROOT / "scripts" / "make_sessions.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.make(tmp_path)
    want = ROOT / "assets" / "sessions"
    for name in ("left", "right"):
        assert contents(tmp_path / name) == contents(want / name)
        # The truth has more digits than a session's files: another processor rounds the last of them otherwise.
        made, kept = (flat(json.loads((f / f"{name}.answer.json").read_text())) for f in (tmp_path, want))
        assert made.keys() == kept.keys()
        assert [v for v in made.values() if isinstance(v, str)] == [v for v in kept.values() if isinstance(v, str)]
        numbers = [k for k, v in kept.items() if isinstance(v, (int, float))]
        assert [made[k] for k in numbers] == pytest.approx([kept[k] for k in numbers], rel=1e-12, abs=1e-15)


def test_every_package_is_in_the_wheel():
    """The list in pyproject.toml is by hand because assets/ is mapped into the package: nothing may be missing from
    it.
    """
    listed = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    found = {str(p.parent.relative_to(ROOT)).replace("/", ".") for p in (ROOT / "hand_model").rglob("__init__.py")}
    assert listed == found | {"hand_model.assets"}
