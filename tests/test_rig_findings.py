"""What a rig's findings say: names, units and signs; the effects in its file, the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rig_pendulum import PENDULUM, planted

from hand_model.report.rig_findings import write_rig_findings
from hand_model.rig import diagnose_rig
from hand_model.rig.findings import NOT_BORNE_OUT, NOT_TAKEN
from hand_model.rig.mjcf import read_effects, write_effects
from hand_model.rig.name.candidates import Candidate
from hand_model.rig.standing import _joint_finding
from hand_model.rig.words import alternatives, joint_unit, rejection, shape_unit, statement
from hand_model.session import read_session


def test_effects_in_the_file_are_replaced_not_piled_up() -> None:
    """Writing effects twice keeps one entry; writing none removes it."""
    once = write_effects(PENDULUM.encode(), [{"joint": "hinge", "swing": {"sag": 0.1}}])
    twice = write_effects(once, [{"joint": "hinge", "swing": {"sag": 0.2}}])
    assert read_effects(twice) == [{"joint": "hinge", "swing": {"sag": 0.2}}]
    assert read_effects(write_effects(twice, [])) == []


def test_a_rigs_findings_say_names_and_units_as_the_format_has_them() -> None:
    """Names of the table of effects, units of the joint, variants beside them."""
    assert joint_unit("effort s/position", "rad", "N m") == "N m s/rad"
    assert joint_unit("rad/effort^2", "rad", "N m") == "rad/(N m)^2"
    assert joint_unit("effort", "m", "N") == "N"
    assert [shape_unit(n, "m") for n in ("reach", "stribeck_speed", "delay", "form")] == ["m", "m/s", "s", "1"]
    assert shape_unit("turns_at", "rad", "N m") == "N m"
    rivals = [
        ("detent_load/a@hinge", 0.3),
        ("detent_load@hinge", 0.5),
        ("torque_ripple@hinge", 0.1),
        ("stribeck_friction/b@hinge", 0.1),
    ]
    mine, others = alternatives(rivals, "stribeck_friction", 0.9)
    assert dict(others) == pytest.approx({"detent_load": 0.72, "torque_ripple": 0.09})
    assert [name for name, _ in others] == ["detent_load", "torque_ripple"]
    assert mine + sum(share for _, share in others) == pytest.approx(0.9) and mine == pytest.approx(0.09)
    assert alternatives((), "stribeck_friction", 0.9) == (0.9, ())
    # the simplest of two that are not told apart has half of it, however seldom it is the best
    mine, others = alternatives(rivals, "stribeck_friction", 0.9, members=2)
    assert mine == pytest.approx(0.45) and dict(others) == pytest.approx({"detent_load": 0.4, "torque_ripple": 0.05})
    assert rejection("load_dependent_friction/low speed@hinge", NOT_TAKEN) == {
        "effect": "load_dependent_friction",
        "variant": "low speed",
        "where": "hinge",
        "reason": NOT_TAKEN,
    }
    values = {
        "drag": {"value": 0.5, "unit": "N s^2/m^2"},
        "form": {"value": 0.0, "unit": "1"},
        "ratio": {"value": 2.0, "unit": "1"},
    }
    proof = {"metric": "effort_rmse", "before": 2.0, "after": 1.0, "unit": "N"}
    for held_out, metric in ((["log/b.csv"], "held-out effort rmse"), ([], "effort rmse on what was fitted")):
        said = statement("quadratic_damping", "", "slide", values, {**proof, "held_out": held_out})
        assert said == f"slide: quadratic damping: drag 0.5 N s^2/m^2, ratio 2; {metric} falls from 2 to 1 N."


@pytest.mark.parametrize(("effect", "told"), [("command_delay", 0.02), ("current_channel_delay", -0.02)])
def test_a_late_drive_has_a_positive_delay(effect: str, told: float) -> None:
    """As in the findings of a hand: a drive acts later than told; a channel recorded ahead is early."""
    rig = SimpleNamespace(unit=lambda j: "rad", effort_unit=lambda j: "N m", drive=lambda j: None)
    candidate = Candidate(effect, "", "hinge", (), ({"delay": -0.02},), lambda r, s: np.zeros((0, 0)), True)
    proof = {"metric": "effort_rmse", "unit": "N m", "before": 2.0, "after": 1.0, "held_out": ["log/b.csv"]}
    step = SimpleNamespace(rivals=(), equals=(), probability=0.9)
    found = _joint_finding(
        rig, None, step, SimpleNamespace(candidate=candidate, shape={"delay": -0.02}), np.zeros(0), proof, None
    )
    assert found.parameters["delay"] == {"value": told, "unit": "s", "ci95": None}
    assert f"delay {told} s" in found.statement
    assert found.where["region"] is None and found.where["finger"] is None


def test_report_of_a_rig_shows_what_was_found(tmp_path: Path) -> None:
    """One page with the map, the effect through the data, before and after; without outside resources."""
    session = read_session(planted(tmp_path / "s", "load"))
    rejected = (
        rejection("stribeck_friction@hinge", NOT_BORNE_OUT),
        rejection("detent_load/of a kind@hinge", NOT_TAKEN),
    )
    findings = replace(diagnose_rig(session), rejected=rejected)
    page = write_rig_findings(session, findings, tmp_path / "out").read_text()
    assert (
        "then withdrawn" in page
        and f"stribeck friction at hinge: {NOT_BORNE_OUT}" in page
        and "not taken: detent load (of a kind)." in page
    )
    for anchor in ('id="findings"', 'id="map"', 'id="effects"', 'id="validation"', "load dependent friction"):
        assert anchor in page
    assert "http://" not in page.replace("http://www.w3.org", "")
