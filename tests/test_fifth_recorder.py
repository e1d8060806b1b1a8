"""The fifth recorder: its sessions can be read, a seed gives the same bytes, and what it hides can be recorded."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from folder_contents import contents

from hand_model.session import check_session, read_session

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from fifth_recorder.compose import KINDS, Case, make_case, make_set
from fifth_recorder.effects.table import INSIDE, OUTSIDE

from hand_model.effects import catalogue

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None, reason="the fifth recorder's motor is C, and there is no compiler named cc"
)
OF_MARKERS = {"marker_slip", "support_slip", "palm_marker_slip", "marker_swap"}  # no columns, so not in the catalogue


@pytest.mark.parametrize("seed", range(3))
def test_a_healthy_session_is_read(tmp_path: Path, seed: int) -> None:
    make_case(tmp_path / "case_000", Case("none", (), seed))
    session = read_session(tmp_path / "case_000")
    assert len(session.fingers) == 2 and session.notes == ()
    assert all("spread" in note or "dropped" in note for note in check_session(session))


def test_a_seed_gives_the_same_bytes_and_answers_lie_apart(tmp_path: Path) -> None:
    counts = dict.fromkeys(KINDS, 0) | {"single": 1, "weak": 1}
    for name in ("one", "two"):
        make_set(tmp_path / name, 4, counts)
    one = contents(tmp_path / "one")
    assert one == contents(tmp_path / "two") and not any("answer" in name for name in one)
    assert contents(tmp_path / "one" / "case_000") != contents(tmp_path / "one" / "case_001")
    answers = json.loads((tmp_path / "one.answers" / "answers.json").read_text())
    assert [answer["case"] for answer in answers] == ["case_000", "case_001"]
    assert sorted(answer["kind"] for answer in answers) == ["single", "weak"]
    assert all(answer["effects"][0]["gain_nats"] > 10 for answer in answers)


def test_the_whole_table_can_be_hidden_and_much_that_is_not_in_it() -> None:
    assert {e.name for e in catalogue()} <= set(INSIDE)
    assert OF_MARKERS <= set(INSIDE) and len(INSIDE) == 36
    assert len(OUTSIDE) > 15 and not set(OUTSIDE) & set(INSIDE)
