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


@pytest.mark.parametrize(
    ("after", "within", "gone"), [(1.0, True, True), (1.04, True, True), (1.15, False, True), (1.3, False, False)]
)
def test_what_a_finding_proves_is_counted(after: float, within: bool, gone: bool) -> None:
    """Of an error of 2 over a noise of 1."""
    answer = {"case": "single", "effects": [{"effect": "torque_ripple", "finger": "index"}]}
    fit = {"before": 2.0, "after": after, "noise_floor": 1.0}
    named = {"effect": "torque_ripple", "where": {"finger": "index"}, "parameters": {}, "fit": fit}
    row = score_case("case_000", answer, {"verdict": "mismatch", "findings": [named]})
    assert row["proofs"] == [{"within": within, "gone": gone}]
    assert score_case("case_000", answer, {"verdict": "mismatch", "findings": [{**named, "fit": {}}]})["proofs"] == []
