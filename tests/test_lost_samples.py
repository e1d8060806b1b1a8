"""Logs as laboratories hand them over, before a diagnosis: commands that are lost or not the motion's own, dead
channels, wrong units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from session_writers import write_log, write_session

from hand_model.diagnose import diagnose
from hand_model.diagnose.hearing import _current_at, _no_measurement
from hand_model.diagnose.locate.drive import _held, count_range, drive_states, opposes, too_short
from hand_model.errors import HandFileError, SessionError
from hand_model.identify.clock import align
from hand_model.session import Log, read_session


def log(position, **columns) -> Log:
    n = len(position)
    return Log(np.arange(n) / 50, {"position": position, "current": np.ones(n), **columns}, Path("x.csv"))


MOTION = 12000 + 4000 * np.sin(np.arange(400) / 30)
COMMANDS = np.where(np.arange(400) % 100 < 50, 8050.0, 15950.0)


def test_the_range_is_the_commanded_one_where_the_motion_follows_it() -> None:
    assert count_range([log(MOTION, setpoint=COMMANDS)]) == (8050.0, 15950.0)
    glitch = MOTION.copy()
    glitch[7] = 65535.0
    assert count_range([log(glitch, setpoint=COMMANDS)]) == (8050.0, 15950.0)


@pytest.mark.parametrize("setpoint", [np.full(400, np.nan), np.full(400, 12000.0), (COMMANDS - 8000) / 80])
def test_commands_that_are_lost_constant_or_in_another_unit_set_no_range(setpoint) -> None:
    assert count_range([log(MOTION, setpoint=setpoint)]) == (MOTION.min(), MOTION.max())


def test_a_lost_command_is_the_one_before_it_and_a_lost_current_no_zero() -> None:
    np.testing.assert_array_equal(_held(np.array([np.nan, 3.0, np.nan, 5.0, np.nan])), [3.0, 3.0, 3.0, 5.0, 5.0])
    current = np.full(400, 20.0)
    current[100:110] = np.nan
    np.testing.assert_allclose(_current_at(np.arange(400) / 50, log(MOTION, current=current)), 20.0)


def test_a_recording_too_short_for_a_motion_is_told() -> None:
    lost = MOTION.copy()
    lost[40:] = np.nan
    logs = {"a.csv": log(MOTION), "b.csv": log(MOTION[:30]), "c.csv": log(lost)}
    trials = [
        SimpleNamespace(kind="excitation", log_path=Path(name), finger="index", name=name, log=lambda one=one: one)
        for name, one in logs.items()
    ]
    session = SimpleNamespace(trials=trials, finger=lambda name: SimpleNamespace(actuator=name))
    said = too_short(session)
    assert [line.split(" rows")[0] for line in said] == ["b.csv: 30", "c.csv: 40"]
    assert "50 are needed" in said[0]


def test_a_position_that_never_moves_or_is_the_command_is_no_measurement() -> None:
    assert _no_measurement([log(np.full(400, 12000.0), setpoint=COMMANDS)]) == "it never moves"
    assert "setpoint" in _no_measurement([log(COMMANDS, setpoint=COMMANDS)])
    assert _no_measurement([log(MOTION, setpoint=COMMANDS)]) == ""


def test_a_session_that_breaks_its_format_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    session = write_session(tmp_path / "s")
    for column, spoil, said in (("time", lambda x: 1e3 * x, "seconds"), ("current", lambda x: np.nan * x, "no sample")):
        write_log(session / "log/index.csv")
        head, *rows = (session / "log/index.csv").read_text().split("\n")
        at = head.split(",").index(column)
        cells = [row.split(",") for row in rows if row]
        for row in cells:
            value = spoil(float(row[at]))
            row[at] = "" if np.isnan(value) else f"{value:.3f}"
        (session / "log/index.csv").write_text("\n".join([head, *(",".join(row) for row in cells)]) + "\n")
        with pytest.raises(SessionError, match=said) as refused:
            diagnose(session, model=False, output=tmp_path / "out")
        assert "index.csv" in str(refused.value)
    assert not (tmp_path / "out").exists()


def test_counts_that_fall_with_flexion_are_refused() -> None:
    at = np.arange(0, 30, 0.01)
    angle = np.interp(
        at, [0, 1, 4, 5, 7, 9, 9.5, 14, 16, 17, 19, 23, 24, 30], [0, 0, 1.2, 1.2, 0, 0, 0.6, 0.6, 0, 0, 1.2, 1.2, 0, 0]
    )
    with pytest.raises(SessionError, match="must increase with flexion"):
        align(at, angle, at + 100, 9000 - 3000 * angle, "log/index.csv")
    assert align(at, angle, at + 100, 9000 + 3000 * angle, "log/index.csv").offset_s == pytest.approx(100, abs=1e-3)


def test_a_current_of_the_other_sign_is_told_from_the_friction(tmp_path: Path) -> None:
    from hand_model.twin.case import draw_case

    draw_case(3, "none").record(tmp_path / "s")
    for states in drive_states(read_session(tmp_path / "s")).values():
        assert not opposes(states)
        assert opposes(tuple(replace(s, effort=-s.effort) for s in states))
        noise = np.random.default_rng(0)
        assert not opposes(tuple(replace(s, effort=noise.normal(0, 5, len(s.effort))) for s in states))


def test_a_model_of_another_hand_is_refused() -> None:
    from hand_model.diagnose.prove.improve import refuse_other

    def hand(side: str, *fingers: str) -> SimpleNamespace:
        return SimpleNamespace(side=side, fingers=[SimpleNamespace(name=f) for f in fingers])

    refuse_other(hand("left", "index", "ring"), hand("left", "index"))
    with pytest.raises(HandFileError, match="right hand"):
        refuse_other(hand("right", "index"), hand("left", "index"))
    with pytest.raises(HandFileError, match="none of the session's fingers"):
        refuse_other(hand("left", "ring"), hand("left", "index"))
