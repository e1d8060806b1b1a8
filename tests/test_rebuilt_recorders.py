"""Recorders that rebuild the foreign one: their sessions can be read, a seed gives the same bytes, and what they hide can
be recorded."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest
from folder_contents import contents

from hand_model.session import check_session, read_session

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import eighth_recorder.catalogue
import eighth_recorder.compose
import seventh_recorder.catalogue
import seventh_recorder.compose

from hand_model.effects import catalogue

MAKERS = [seventh_recorder.compose, eighth_recorder.compose]
pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None, reason="the recorders' drives are C, and there is no compiler named cc"
)


@pytest.mark.parametrize("recorder", MAKERS, ids=["seventh", "eighth"])
def test_healthy_sessions_are_read(tmp_path: Path, recorder: ModuleType) -> None:
    recorder.make_set(tmp_path / "set", 1000, {"none": 2})
    for case in ("case_000", "case_001"):
        session = read_session(tmp_path / "set" / case)
        assert 1 <= len(session.fingers) <= 3 and session.notes == ()
        assert all("spread" in note or "dropped" in note for note in check_session(session))
    assert [a["effects"] for a in json.loads((tmp_path / "set.answers" / "answers.json").read_text())] == [[], []]


@pytest.mark.parametrize("recorder", MAKERS, ids=["seventh", "eighth"])
def test_a_seed_gives_the_same_bytes_and_answers_lie_apart(tmp_path: Path, recorder: ModuleType) -> None:
    counts = dict.fromkeys(recorder.KINDS, 0) | {"single": 1, "weak": 1, "messy": 1}
    for name in ("one", "two"):
        recorder.make_set(tmp_path / name, 1004, counts)
    one = contents(tmp_path / "one")
    assert one == contents(tmp_path / "two") and not any("answer" in name for name in one)
    answers = json.loads((tmp_path / "one.answers" / "answers.json").read_text())
    assert sorted(answer["kind"] for answer in answers) == ["messy", "single", "weak"]
    strengths = {answer["kind"]: [hidden["strength"] for hidden in answer["effects"]] for answer in answers}
    assert strengths["single"] == [1.0] and strengths["weak"] == [0.4]
    assert strengths["messy"][0] == 1.0 and set(strengths["messy"][1:]) == {0.1}


@pytest.mark.parametrize("recorder", MAKERS, ids=["seventh", "eighth"])
def test_another_kind_is_refused(tmp_path: Path, recorder: ModuleType) -> None:
    with pytest.raises(ValueError, match="unknown kinds"):
        recorder.make_set(tmp_path / "set", 1005, {"double": 1})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("hidden", [seventh_recorder.catalogue, eighth_recorder.catalogue], ids=["seventh", "eighth"])
def test_the_whole_table_can_be_hidden_and_much_that_is_not_in_it(hidden: ModuleType) -> None:
    names = {effect.name for effect in hidden.VOCABULARY}
    assert {e.name for e in catalogue()} <= names and len(names) == 36
    assert len(hidden.OUTSIDE) > 10 and not {effect.name for effect in hidden.OUTSIDE} & names
