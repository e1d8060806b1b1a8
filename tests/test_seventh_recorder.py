"""The seventh recorder: its sessions can be read, a seed gives the same bytes, and what it hides can be recorded."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from folder_contents import contents

from hand_model.session import check_session, read_session

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from seventh_recorder.catalogue import OUTSIDE, VOCABULARY
from seventh_recorder.compose import KINDS, make_set

from hand_model.effects import catalogue

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None, reason="the seventh recorder's drive is C, and there is no compiler named cc"
)


def test_healthy_sessions_are_read(tmp_path: Path) -> None:
    make_set(tmp_path / "set", 1000, {"none": 2})
    for case in ("case_000", "case_001"):
        session = read_session(tmp_path / "set" / case)
        assert len(session.fingers) == 2 and session.notes == ()
        assert all("spread" in note or "dropped" in note for note in check_session(session))
    assert [a["effects"] for a in json.loads((tmp_path / "set.answers" / "answers.json").read_text())] == [[], []]


def test_a_seed_gives_the_same_bytes_and_answers_lie_apart(tmp_path: Path) -> None:
    counts = dict.fromkeys(KINDS, 0) | {"single": 1, "weak": 1, "messy": 1}
    for name in ("one", "two"):
        make_set(tmp_path / name, 1004, counts)
    one = contents(tmp_path / "one")
    assert one == contents(tmp_path / "two") and not any("answer" in name for name in one)
    answers = json.loads((tmp_path / "one.answers" / "answers.json").read_text())
    assert sorted(answer["kind"] for answer in answers) == ["messy", "single", "weak"]
    strengths = {answer["kind"]: [hidden["strength"] for hidden in answer["effects"]] for answer in answers}
    assert strengths["single"] == [1.0] and strengths["weak"] == [0.4]
    assert strengths["messy"][0] == 1.0 and set(strengths["messy"][1:]) == {0.1}


def test_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown kinds"):
        make_set(tmp_path / "set", 1005, {"double": 1})
    assert not list(tmp_path.iterdir())


def test_the_whole_table_can_be_hidden_and_much_that_is_not_in_it() -> None:
    names = {effect.name for effect in VOCABULARY}
    assert {e.name for e in catalogue()} <= names and len(names) == 36
    assert len(OUTSIDE) > 10 and not {effect.name for effect in OUTSIDE} & names
