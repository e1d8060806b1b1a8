"""Recordings as another laboratory would have made them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from hand_model.session import read_session
from hand_model.session.log import read_log

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
from alterations import ALTERATIONS, ENDINGS, altered

SOURCE = Path(__file__).parents[1] / "assets" / "sessions" / "left"


@pytest.mark.parametrize(("number", "name"), list(enumerate(ALTERATIONS)), ids=list(ALTERATIONS))
def test_an_altered_session_holds_the_same_motion(number: int, name: str, tmp_path: Path) -> None:
    target = tmp_path / "session"
    altered(SOURCE, target, ALTERATIONS[name], ENDINGS[number % 4], number)
    before, after = read_session(SOURCE), read_session(target)
    assert {Path(t.name).stem for t in after.trials} <= {Path(t.name).stem for t in before.trials}
    moved = next(t for t in after.trials if t.kind == "flexion")
    twin = next(t for t in before.trials if t.name == moved.name)
    assert moved.mocap().labels == twin.mocap().labels
    ours, theirs = moved.log(), read_log(twin.log_path)
    start = 0.0 if name != "turned" else 3000.0
    seen = np.isfinite(ours.column("position"))
    then = np.interp(ours.time_s[seen] + start, theirs.time_s, theirs.column("position"))
    assert np.corrcoef(ours.column("position")[seen], then)[0, 1] > 0.999
    same_log = (
        len(ours.time_s) == len(theirs.time_s)
        and ours.columns.keys() == theirs.columns.keys()
        and all(np.array_equal(ours.columns[k], theirs.columns[k], equal_nan=True) for k in theirs.columns)
    )
    before_m, after_m = (t.mocap().position_world for t in (twin, moved))
    same_markers = before_m.shape == after_m.shape and np.allclose(before_m, after_m, atol=1e-6, equal_nan=True)
    assert not (same_log and same_markers and len(after.trials) == len(before.trials))
