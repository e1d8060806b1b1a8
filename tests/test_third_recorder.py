"""The third recorder: its sessions can be read, a seed gives the same bytes, and what it hides can be recorded."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from folder_contents import contents

from hand_model.session import check_session, read_session

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from third_recorder.compose import KINDS, Case, make_case, make_set
from third_recorder.effects import EFFECTS, OUTSIDE
from third_recorder.motor import CompilerError, library

needs_compiler = pytest.mark.skipif(
    shutil.which("cc") is None, reason="the third recorder's motor is C, and there is no compiler named cc"
)
SEED = [11, 0, 31]


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with nothing hidden in it."""
    folder = tmp_path_factory.mktemp("third") / "case_000"
    make_case(Case("none"), folder, SEED)
    return folder


@needs_compiler
def test_a_healthy_session_is_read_without_complaint(healthy: Path) -> None:
    """Nothing to mend but what a laboratory loses: gaps and rows."""
    session = read_session(healthy)
    assert session.notes == ()
    assert check_session(session) == ()


@needs_compiler
def test_a_seed_gives_the_same_bytes_and_answers_lie_apart(tmp_path: Path) -> None:
    """Two sets of one seed; the sessions of a set differ."""
    counts = dict.fromkeys(KINDS, 0) | {"weak": 1, "none": 1}
    for name in ("one", "two"):
        make_set(tmp_path / name, 4, counts)
    one = contents(tmp_path / "one")
    assert one == contents(tmp_path / "two")
    assert contents(tmp_path / "one" / "case_000") != contents(tmp_path / "one" / "case_001")
    assert not any("answer" in name for name in one)
    answers = json.loads((tmp_path / "one.answers" / "answers.json").read_text())
    assert [answer["case"] for answer in answers] == ["case_000", "case_001"]
    assert sorted(answer["kind"] for answer in answers) == ["none", "weak"]


@needs_compiler
@pytest.mark.parametrize(
    "name",
    [
        "external_contact",
        "spring_decoupling",
        "current_saturation",
        "clock_drift",
        "linkage_backlash",
        "camera_distortion",
        "friction_ages_at_rest",
    ],
)
def test_an_effect_is_recorded(name: str, healthy: Path, tmp_path: Path) -> None:
    """It is in the answer, changes the session, and the session can be read."""
    folder = tmp_path / "case_000"
    answer = make_case(Case("outside" if name in OUTSIDE else "single", [name]), folder, SEED)
    (entry,) = answer["effects"]
    assert entry["effect"] == name
    assert (entry["finger"] is None) == (EFFECTS.get(name) or OUTSIDE[name]).everywhere
    assert json.dumps(answer, allow_nan=False)
    check_session(read_session(folder))
    assert contents(folder) != contents(healthy)


def test_without_a_compiler_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Nothing is written then."""
    monkeypatch.setattr(shutil, "which", lambda name: None)
    library.cache_clear()
    with pytest.raises(CompilerError, match="needs a C compiler"):
        make_set(tmp_path / "set", 1, dict.fromkeys(KINDS, 1))
    assert not list(tmp_path.iterdir())
