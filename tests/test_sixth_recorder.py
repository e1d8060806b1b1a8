"""The sixth recorder: its sessions can be read, a seed gives the same bytes, and what it hides can be recorded."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from folder_contents import contents

from hand_model.session import check_session, read_session

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from sixth_recorder.compose import KINDS, make_case, make_set
from sixth_recorder.effects.table import MAIN, OUTSIDE, VOCABULARY

from hand_model.effects import catalogue

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None, reason="the sixth recorder's drive is C, and there is no compiler named cc"
)
OF_MARKERS = {"marker_slip", "support_slip", "palm_marker_slip", "marker_swap"}  # no columns, so not in the catalogue


@pytest.mark.parametrize("seed", range(1000, 1003))
def test_a_healthy_session_is_read(tmp_path: Path, seed: int) -> None:
    effects, settings = make_case(tmp_path / "case_000", np.random.default_rng(seed), "none", [])
    session = read_session(tmp_path / "case_000")
    assert len(session.fingers) == 2 and session.notes == ()
    assert all("spread" in note or "dropped" in note for note in check_session(session))
    assert effects == [] and {finger.name for finger in session.fingers} == set(settings["fingers"])


def test_a_seed_gives_the_same_bytes_and_answers_lie_apart(tmp_path: Path) -> None:
    counts = dict.fromkeys(KINDS, 0) | {"single": 1, "weak": 1}
    for name in ("one", "two"):
        make_set(tmp_path / name, 1004, counts)
    one = contents(tmp_path / "one")
    assert one == contents(tmp_path / "two") and not any("answer" in name for name in one)
    assert contents(tmp_path / "one" / "case_000") != contents(tmp_path / "one" / "case_001")
    answers = json.loads((tmp_path / "one.answers" / "answers.json").read_text())
    assert [answer["case"] for answer in answers] == ["case_000", "case_001"]
    assert sorted(answer["kind"] for answer in answers) == ["single", "weak"]
    for hidden in (answer["effects"][0] for answer in answers):
        assert hidden["effect"] in MAIN
        assert hidden["parameters"]["amplitude"] > 0
        assert (hidden["parameters"]["mismatch_over_noise"] or 1) > 0.1


def test_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown kinds"):
        make_set(tmp_path / "set", 1005, {"double": 1})
    assert not list(tmp_path.iterdir())


def test_the_whole_table_can_be_hidden_and_much_that_is_not_in_it() -> None:
    assert {e.name for e in catalogue()} <= set(VOCABULARY)
    assert OF_MARKERS <= set(VOCABULARY) and len(VOCABULARY) == 36
    assert len(OUTSIDE) > 10 and not set(OUTSIDE) & set(VOCABULARY)
