"""Sessions of rigs: what the manifest must say of a model and its signals."""

from __future__ import annotations

import pytest
from session_refusal import edit, refusal

from hand_model.session import check_session, read_session

RIG = """format = "hand-session/1"
[hand]
name = "pendulum"
[rig]
model = "rig.xml"
[signals]
position = "joint:hinge:position"
torque = "actuator:motor:force"
[[trial]]
kind = "motion"
log = "log/a.csv"
set = { "body:mass:mass" = 0.5, "option:gravity" = [0, 0, -9.81] }
"""
RIG_MODEL = """<mujoco><worldbody><body name="mass"><joint name="hinge"/><geom size="0.1"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"""


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "log").mkdir()
    (tmp_path / "session.toml").write_text(RIG)
    (tmp_path / "rig.xml").write_text(RIG_MODEL)
    (tmp_path / "log/a.csv").write_text("time,position,torque,supply\n0,0,1,7\n0.1,1,1,7\n0.2,2,,7\n")
    return tmp_path


def test_a_rig(rig):
    session = read_session(rig)
    assert session.palm is None and session.fingers == ()
    assert session.rig.signals == {"position": "joint:hinge:position", "torque": "actuator:motor:force"}
    assert session.trials[0].set == {"body:mass:mass": 0.5, "option:gravity": [0, 0, -9.81]}
    assert check_session(session) == ()  # further columns are channels of their own


RIG_REFUSED = {
    "model_missing": ('"rig.xml"', '"rg.xml"', ["rg.xml", "MJCF"]),
    "model_outside": ('"rig.xml"', '"../rig.xml"', ["leaves"]),
    "signals_missing": ("[signals]", "[signal]", ["[signals]"]),
    "signal_kind": ('"joint:hinge:position"', '"jont:hinge:position"', ["jont:hinge:position", "joint:NAME:position"]),
    "signal_quantity": ('"joint:hinge:position"', '"joint:hinge:positon"', ["positon", 'did you mean "position"']),
    "signal_joint": ('"joint:hinge:position"', '"joint:hnge:position"', ["hnge", 'did you mean "hinge"']),
    "signal_actuator": ('"actuator:motor:force"', '"actuator:moto:force"', ["moto", 'did you mean "motor"']),
    "signal_number": ('"actuator:motor:force"', "4", ["torque is 4"]),
    "signal_twice": ('"actuator:motor:force"', '"joint:hinge:position"', ["two columns"]),
    "trial_kind": ('"motion"', '"grasp"', ["grasp", "motion"]),
    "set_key": ('"body:mass:mass"', '"mass"', ['"mass"', "kind:name:attribute"]),
    "set_value": ("= 0.5", '= "heavy"', ["body:mass:mass", "heavy", "number"]),
    "set_no_table": ('{ "body:mass:mass" = 0.5, "option:gravity" = [0, 0, -9.81] }', "5", ["set is 5"]),
    "with_palm": (
        "[rig]",
        '[palm]\nmarkers = { origin = "a", medial = "b", lateral = "c" }\n[rig]',
        ["[rig]", "[palm]"],
    ),
    "column_missing": ("position = ", "positio = ", ['"positio"', 'did you mean "position"', "a.csv"]),
}


@pytest.mark.parametrize("case", RIG_REFUSED)
def test_rig_refused(case, rig):
    old, new, words = RIG_REFUSED[case]
    edit(rig, old, new)
    message = refusal(lambda: check_session(read_session(rig)))
    for word in words:
        assert word in message, (word, message)


def test_rig_model_that_is_no_mjcf(rig):
    for text in ("<robot/>", "<mujoco>", ""):
        (rig / "rig.xml").write_text(text)
        assert "rig.xml" in refusal(read_session, rig)
