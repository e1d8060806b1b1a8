"""The state of a drive that its commands explain: simulated, with what is slow beside it, and none of the encoder's
noise."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hand_model.diagnose.locate.drive import drive_states
from hand_model.diagnose.locate.motion import estimate_motion
from hand_model.diagnose.locate.simulated import (
    SimulatedDrive,
    _along,
    _motion,
    _slow,
    delays_apart,
    simulated_drive,
    with_simulated,
)
from hand_model.effects.base import least_delay
from hand_model.identify.motor import identify_motor
from hand_model.session import Session, read_session


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    from hand_model.twin import bebionic, record

    folder = tmp_path_factory.mktemp("simulated") / "session"
    record(bebionic("left", None, ["index"]), folder, seed=5)
    return read_session(Path(folder))


@pytest.fixture(scope="module")
def drive(session: Session) -> SimulatedDrive:
    return simulated_drive(session, "index")


def test_the_simulated_state_carries_little_noise_and_is_where_the_drive_was(
    session: Session, drive: SimulatedDrive
) -> None:
    assert drive.motions and abs(drive.delay_s) < 3 * drive.doubt_s
    smooth, simulated = (drive_states(session, simulated=s)["index"] for s in ({}, {"index": drive}))
    for plain, state in zip(smooth, simulated, strict=True):
        cruise = (np.abs(state.velocity) > 20) & (plain.extra["steady"] > 0)
        cruise[1:] &= cruise[:-1]
        assert np.sqrt(np.mean((state.position - plain.position)[cruise] ** 2)) < 2 * float(
            plain.extra["position_noise"][0]
        )
        jitter = [np.std(np.diff(s.velocity)[cruise[1:]]) for s in (plain, state)]
        assert jitter[1] < 0.3 * jitter[0]
        assert np.sum(state.extra["steady"]) > np.sum(plain.extra["steady"])  # starts and stops are not smeared


def test_what_the_simulation_lacks_is_not_smoothed_away(session: Session) -> None:
    fit, trial = identify_motor(session, "index"), session.select("flexion")[0]
    log = trial.log()
    position = log.column("position")
    swing = 0.003 * np.ptp(position)
    slow, fast = (
        dataclasses.replace(
            log, columns={**log.columns, "position": position + swing * np.sin(2 * np.pi * hz * log.time_s)}
        )
        for hz in (0.15, 6.0)
    )
    told = [run is not None and _motion(run) is not None for run in (_along(fit, trial, x) for x in (slow, fast))]
    assert told == [True, False]


def test_what_is_slow_is_told_with_its_derivatives() -> None:
    t = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.02, 200))
    rest = 0.3 - 0.5 * t + 0.8 * t**2
    rest[80:90] = np.nan
    value, rate, curve = _slow(t, rest)
    known = np.isfinite(rest)
    assert np.array_equal(np.isfinite(value), known)
    np.testing.assert_allclose(value[known], rest[known], atol=1e-6)
    np.testing.assert_allclose(rate[known], (-0.5 + 1.6 * t)[known], atol=1e-4)
    np.testing.assert_allclose(curve[known], 1.6, atol=1e-2)


def test_moves_that_hold_too_little_of_a_motion_are_not_taken() -> None:
    t = np.arange(0, 20, 0.02)
    x = 50 - 50 * np.cos(t)
    motion, v, a = estimate_motion(t, x), 50 * np.sin(t), 50 * np.cos(t)
    assert with_simulated(motion, t, (t, x, v, a)) is not None
    epoch = 1.7e9 + t  # seconds since 1970 are known to a fraction of a microsecond
    assert with_simulated(motion, epoch, (t + epoch[0] + 1e-7, x, v, a)) is not None
    assert with_simulated(motion, t, (t, np.where(t < 10, x, np.nan), v, a)) is None


def test_a_delay_that_all_drives_share_is_how_the_log_is_read() -> None:
    drives = {"a": SimulatedDrive("a", 0.021, 0.001), "b": SimulatedDrive("b", 0.005, 0.001)}
    apart = delays_apart(drives)
    assert apart["a"].delay_s == pytest.approx(0.016) and apart["b"].delay_s == 0.0
    assert delays_apart({"a": drives["a"]})["a"].delay_s == 0.021


def test_a_delay_is_told_as_far_as_it_is_known(session: Session) -> None:
    states = drive_states(session)["index"]
    step = least_delay(states) / 0.75
    for doubt, least in ((0.05 * step, 0.2 * step), (step, 0.75 * step)):
        told = tuple(dataclasses.replace(s, extra={**s.extra, "late": np.array([0.0, doubt])}) for s in states)
        assert least_delay(told) == pytest.approx(least)
