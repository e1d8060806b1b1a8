"""Touch from the current: detected soon, not in free motion, its stiffness found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model import touch
from hand_model.errors import IdentificationError
from hand_model.identify.motor import identify_motor
from hand_model.identify.motor.recording import actuator_trials
from hand_model.session import read_session


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory):
    from hand_model.twin import Plan, bebionic, record

    folder = tmp_path_factory.mktemp("touch") / "session"
    answer = record(
        bebionic("left", None, ["index"]),
        folder,
        3,
        plan=Plan(grasps=(("block", 40.0), ("foam", 2.0)), grasp_repeats=1),
    )
    session = read_session(folder)
    fit = identify_motor(session, "index")
    detector = touch.calibrate(fit, [(t.name, t.log()) for t in actuator_trials(session, "index")])
    return session, answer, fit, detector


def test_contacts_are_found_in_time(grasps) -> None:
    session, answer, fit, detector = grasps
    for trial in actuator_trials(session, "index", ("grasp",), None):
        log, stem = trial.log(), Path(trial.name).stem
        found = touch.detect(fit, detector, log, trial.name)
        assert len(found) == 2  # it closes twice
        delay = (
            np.interp(found[0].detected_s, log.time_s, answer.trials[stem].log_time_s)
            - answer.table["grasps"][stem]["contact_s"]
        )
        assert -0.02 < delay < (0.06 if trial.object == "block" else 0.4)
        assert found[0].kind == ("stiff" if trial.object == "block" else "compliant")
        for contact in found:
            assert contact.stiffness.value == pytest.approx(answer.table["grasps"][stem]["stiffness"], rel=0.3)


def test_free_motion_is_silent(grasps) -> None:
    session, _, fit, detector = grasps
    for trial in actuator_trials(session, "index", validate=True):
        assert touch.detect(fit, detector, trial.log(), trial.name) == ()


def test_cumulative_sum() -> None:
    z = np.array([0.0, 3.0, 0.5, -4.0, 0.0, 2.0, 2.0])
    assert np.allclose(touch.cumulative_sum(z, 1.0), [0, 2, 1.5, 0, 0, 1, 2])


def test_threshold_keeps_its_probability() -> None:
    """However few the moves it is read from, a threshold is passed by one more move with the probability asked for."""
    rng = np.random.default_rng(0)
    maxima = rng.exponential(2.0, (4000, 21))
    passed = [row[-1] > touch.tail_threshold(row[:-1], 0.01)[0] for row in maxima]
    assert np.mean(passed) == pytest.approx(0.01, abs=0.005)
    assert touch.tail_threshold(maxima[0], 0.001)[0] > touch.tail_threshold(maxima[0], 0.01)[0]


def test_too_little_free_motion_is_refused(grasps) -> None:
    with pytest.raises(IdentificationError, match="at least 12"):
        touch.calibrate(grasps[2], [])


def test_contact_is_found_without_a_controller(grasps) -> None:
    """The current that the recorded motion does not explain betrays a stiff object whatever the controller does."""
    import dataclasses

    session, answer, fit, _ = grasps
    blind = dataclasses.replace(fit, method="regression", output_error=None)
    detector = touch.calibrate(blind, [(t.name, t.log()) for t in actuator_trials(session, "index")])
    for trial in actuator_trials(session, "index", ("grasp",), None):
        if trial.object == "block":
            log, stem = trial.log(), Path(trial.name).stem
            found = touch.detect(blind, detector, log, trial.name)
            assert len(found) == 2
            delay = (
                np.interp(found[0].detected_s, log.time_s, answer.trials[stem].log_time_s)
                - answer.table["grasps"][stem]["contact_s"]
            )
            assert -0.1 < delay < 0.15
