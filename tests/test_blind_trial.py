"""Score of a blind trial's case: name, place, and nothing else."""

from __future__ import annotations

from typing import Any

import pytest

from hand_model.blind_trial import score_case


def findings(finger: str | None) -> dict[str, Any]:
    """A report that names a clock's drift at a place."""
    finding = {"effect": "clock_drift", "where": {"finger": finger}, "parameters": {}}
    return {"verdict": "explained", "findings": [finding]}


@pytest.mark.parametrize(
    ("hidden", "found", "right"),
    [
        ("index", "index", True),
        ("index", None, True),
        ("index", "ring", False),
        (None, None, True),
        (None, "ring", True),
    ],
)
def test_what_is_hidden_at_no_finger_is_right_at_any(hidden: str | None, found: str | None, right: bool) -> None:
    """A place counts where the answer has one."""
    answer = {"case": "single", "effects": [{"effect": "clock_drift", "finger": hidden}]}
    row = score_case("case_000", answer, findings(found))
    assert (row["placed"], row["right"]) == (right, right)


def test_another_name_is_wrong_whatever_its_place() -> None:
    """No place makes up for a name."""
    answer = {"case": "single", "effects": [{"effect": "palm_marker_slip", "finger": None}]}
    assert not score_case("case_000", answer, findings(None))["right"]
