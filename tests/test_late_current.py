"""Which drives' currents may be late: what answers to commands and the balance say together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_diagnose import TRUTH, drive

from hand_model.diagnose.locate import late_current
from hand_model.diagnose.locate.answers import Answers, Lateness, lateness
from hand_model.diagnose.locate.command import BLIND, _lasting
from hand_model.diagnose.locate.drive import with_gives
from hand_model.diagnose.locate.late_current import _late, current_in_time, timed_drives
from hand_model.diagnose.locate.simulated import SimulatedDrive
from hand_model.diagnose.name.balance import Balance
from hand_model.effects.base import DriveState
from hand_model.effects.current_channel_delay import EFFECT
from hand_model.effects.path import dahl

SHIFT_S = -0.02


def shifted(states: tuple[DriveState, ...], delay_s: float) -> tuple[DriveState, ...]:
    """The states with the current as it is `delay_s` earlier."""

    def one(state: DriveState) -> DriveState:
        seen = np.isfinite(state.effort)
        late = np.interp(state.time_s - delay_s, state.time_s[seen], state.effort[seen])
        return replace(state, effort=np.where(seen, late, np.nan))

    return tuple(one(s) for s in states)


def filtered(states: tuple[DriveState, ...], delay_s: float) -> tuple[DriveState, ...]:
    """The states with the current behind a filter of `delay_s`."""
    read = {"form": 1.0, "delay": delay_s}

    def one(state: DriveState) -> DriveState:
        seen = np.isfinite(state.effort)
        whole = np.interp(state.time_s, state.time_s[seen], state.effort[seen])
        return replace(state, effort=np.where(seen, EFFECT.reading(whole, state.time_s, state.velocity, read), np.nan))

    return tuple(one(s) for s in states)


def answering(
    drives: dict[str, tuple[DriveState, ...]], told: dict[str, tuple[float, float]]
) -> dict[str, tuple[DriveState, ...]]:
    """The drives with how late answers to commands tell each current, and how far that may be wrong [s]."""
    return {
        a: tuple(replace(s, extra={**s.extra, "late": np.array(told[a])}) for s in states)
        for a, states in drives.items()
    }


@pytest.mark.parametrize(
    ("told_s", "doubt_s", "may_be"),
    [(-0.011, 0.0065, True), (-0.02, 0.0065, True), (-0.004, 0.0065, False), (0.011, 0.0065, False)],
)
def test_a_balance_that_plainly_shows_a_shift_is_believed_where_answers_agree(
    told_s: float, doubt_s: float, may_be: bool
) -> None:
    """Answers that are wrong by a sample or two tell less than the balance does; those that speak against it do not."""
    drives = {"index": shifted(drive(3), SHIFT_S), "ring": drive(4)}
    told = {"index": (told_s, doubt_s), "ring": (0.0, doubt_s)}
    timed = answering(drives, told)
    assert _late(drives, timed, {}) == {"index": may_be, "ring": False}


@pytest.mark.parametrize(("told_s", "may_be"), [(-0.025, True), (-0.015, False), (0.012, False)])
def test_answers_that_may_be_early_by_chance_are_so_where_the_balance_says_the_same(
    told_s: float, may_be: bool
) -> None:
    """Beside much else that is missing the balance shifts a current by less than it is early, and answers alone are
    early by chance up to three standard deviations."""
    drives = {"index": shifted(drive(3), -0.006), "ring": drive(4)}
    healthy = {**drives, "index": drive(3)}
    told = {"index": (told_s, 0.0115), "ring": (0.0, 0.0115)}
    assert _late(drives, answering(drives, told), {}) == {"index": may_be, "ring": False}
    assert _late(healthy, answering(healthy, told), {}) == {"index": False, "ring": False}


@pytest.mark.parametrize(
    ("told_s", "doubt_s", "may_be"),
    [(0.002, 0.03, True), (0.05, 0.02, True), (0.16, 0.03, False), (-0.06, 0.02, False)],
)
def test_answers_that_a_filter_leaves_vague_do_not_deny_it(told_s: float, doubt_s: float, may_be: bool) -> None:
    """Of a current behind a filter of 60 ms a sudden rise is noticed anywhere from its start to then."""
    drives = {"index": filtered(drive(3), 0.06), "ring": drive(4)}
    told = {"index": (told_s, doubt_s), "ring": (0.0, 0.005)}
    timed = answering(drives, told)
    assert _late(drives, timed, {}) == {"index": may_be, "ring": False}


@pytest.mark.parametrize("told_s", [-0.006, 0.006])
def test_a_delay_that_a_simulation_tells_to_a_fraction_of_a_sample_must_show_elsewhere(told_s: float) -> None:
    """In the balance, or in answers to commands: a controller that is not quite as taken for bends elsewhere."""
    told = {"index": (told_s, 0.001), "ring": (0.0, 0.001)}

    def may_be(shift_s: float, **answered: Lateness) -> dict[str, bool]:
        drives = {"index": shifted(drive(3), shift_s) if shift_s else drive(3), "ring": drive(4)}
        timed = answering(drives, told)
        return _late(drives, timed, answered)

    assert may_be(0.0) == {"index": False, "ring": False}
    assert may_be(told_s) == {"index": True, "ring": False}
    for share, doubt_s, so in ((1.2, 0.004, True), (1.2, 0.006, False), (-1.0, 0.004, False), (4.0, 0.004, False)):
        answers = Lateness(np.zeros(0), share * told_s, doubt_s)
        assert may_be(0.0, index=answers) == {"index": so, "ring": False}


def test_what_holds_a_drive_at_rest_says_nothing_against_a_late_current() -> None:
    """Before it moves a drive may press against its friction already; late, that is read as it starts."""
    (state, *_) = drive(3)
    moving = state.time_s % 4.0 > 1.0
    sigma = np.where(state.time_s % 4.0 < 1.2, 15.0, 0.1)
    state = replace(state, extra={**state.extra, "moving": moving.astype(float), "sigma": sigma})
    at_rest = np.interp(state.time_s - 0.1, state.time_s, moving.astype(float)) < 1
    assert (at_rest & moving).sum() > 10
    sure, unsure = (_lasting(state, 0.1, doubt_s) for doubt_s in (0.01, 0.05))
    assert np.array_equal(sure[~at_rest], unsure[~at_rest])
    assert np.array_equal(sure[at_rest], BLIND * unsure[at_rest]) and unsure[at_rest & moving].min() == 15.0


@pytest.mark.parametrize(
    ("late_s", "told_s", "in_time"), [(0.0, 0.1, True), (0.1, 0.1, False), (0.0, 0.01, False), (0.0, 0.0, False)]
)
def test_a_current_that_its_balance_says_is_in_time_is(late_s: float, told_s: float, in_time: bool) -> None:
    """Where answers say it to be late, by more than they may err."""
    states = shifted(drive(3), late_s) if late_s else drive(3)
    balance = Balance(tuple(replace(s, extra={**s.extra, "late": np.array([told_s, 0.005])}) for s in states))
    assert current_in_time(balance, balance.fit()) is in_time


def test_answers_are_late_with_the_drive_where_its_current_is_in_time() -> None:
    """Another drive that breaks loose as late has its current much sooner, by which this one's would be late."""
    slow, sooner = (Answers(np.full(20, current_s), np.full(20, 0.17), 0.01) for current_s in (0.02, 0.12))
    for in_time, drive_s, channel_s in (((), 0, 0.1), (("index",), 20, 0.0)):
        told = lateness({"index": sooner, "ring": slow}, in_time)["index"]
        assert len(told.drive_s) == drive_s and told.channel_s == pytest.approx(channel_s)


@pytest.mark.parametrize(
    ("told_s", "answered_s", "may_be"),
    [(0.02, 0.0, False), (0.02, 0.016, True), (0.05, 0.05, True), (-0.02, 0.0, False)],
)
def test_a_lateness_that_a_simulation_tells_stands_where_answers_do_not_deny_it(
    told_s: float, answered_s: float, may_be: bool
) -> None:
    """A controller that is not as taken for looks like a late current, and answers like one that is in time."""
    drives = {"index": drive(3), "ring": drive(4)}
    timed = answering(drives, {"index": (told_s, 0.0015), "ring": (0.0, 0.0015)})
    answered = {"index": Lateness(np.zeros(0), answered_s, 0.007)}
    assert _late(drives, timed, answered) == {"index": may_be, "ring": False}


def test_what_simulation_and_answers_surely_say_stands_beside_a_balance_that_takes_it_for_a_short_filter() -> None:
    drives = {"index": filtered(drive(3), 0.015), "ring": drive(4)}
    timed = answering(drives, {"index": (0.06, 0.0015), "ring": (0.0, 0.0015)})
    assert not _late(drives, timed, {})["index"]
    assert _late(drives, timed, {"index": Lateness(np.zeros(0), 0.06, 0.007)})["index"]


@pytest.mark.parametrize(
    ("brought", "late_s", "doubt_s", "stands"),
    [
        (-0.3, 0.1, 0.01, True),
        (-0.3, 0.1, 0.1, False),
        (-8.0, 0.1, 0.01, False),
        (0.3, 0.1, 0.1, True),
        (-0.3, 0.02, 1e-3, False),  # a sample
    ],
)
def test_a_lateness_that_answers_surely_tell_stands_where_recordings_kept_out_do_not_deny_it(
    brought: float, late_s: float, doubt_s: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    from types import SimpleNamespace

    from hand_model.diagnose.name import station

    monkeypatch.setattr(station, "brought_held_out", lambda naming, which: brought)
    states = answering({"index": drive(0)}, {"index": (late_s, doubt_s)})["index"]
    naming = SimpleNamespace(balance=SimpleNamespace(states=states))
    term = SimpleNamespace(effect=EFFECT, shape={"form": 0.0, "delay": 0.9 * late_s})
    assert station._stands(naming, SimpleNamespace(term=term, evidence=20.0), 0, 8.0) == stands


@pytest.mark.parametrize(
    ("told_s", "answers_doubt_s", "explained", "may_be"),
    [
        (-0.012, 0.007, True, True),
        (0.012, 0.007, True, True),
        (-0.012, 0.007, False, False),
        (-0.012, 0.003, True, False),
        (-0.006, 0.007, True, False),
    ],
)
def test_a_simulation_whose_motion_is_the_recorded_one_tells_a_lateness_alone(
    told_s: float, answers_doubt_s: float, explained: bool, may_be: bool
) -> None:
    """A balance may see nothing of it, since friction may hold a current that rises before the motion; answers may be
    silent, and must not deny it."""
    drives = {"index": drive(3), "ring": drive(4)}
    timed = answering(drives, {"index": (told_s, 0.002), "ring": (0.0, 0.002)})
    answered = {"index": Lateness(np.zeros(0), 0.0, answers_doubt_s)}
    known = ("index", "ring") if explained else ()
    assert _late(drives, timed, answered, known) == {"index": may_be, "ring": False}
    late = {"index": replace(answered["index"], drive_s=np.full(9, 0.03))}  # and its motion with it
    assert _late(drives, timed, late, known) == {"index": False, "ring": False}


def test_an_early_current_makes_no_other_drives_give_odd(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a reversal it seems to give nothing: what both drives' friction needs to turn over would be an effect of the
    other one, or a delay of its current."""

    def giving(state: DriveState) -> np.ndarray:
        return TRUTH[2] * (dahl(state.position, 0.9) - np.sign(state.velocity))

    def read(states: tuple[DriveState, ...]) -> tuple[DriveState, ...]:
        noise = {"position_noise": 0.05, "bandwidth_s": 0.02, "smoothed": 0.0, "moving": 1.0, "steady": 1.0}
        told = [{k: np.full(len(s.time_s), v) for k, v in noise.items()} for s in states]
        return tuple(replace(s, extra={**s.extra, **extra}) for s, extra in zip(states, told, strict=True))

    early = shifted(drive(3, giving, noise=0.5), -0.04)
    drives = {"index": read(early), "ring": read(drive(4, giving, noise=0.5))}
    drives = with_gives(drives, tuple(drives))
    assert drives["ring"][0].extra["granted"].max() < 0.8
    for motions, sure in (({"trial_0": ()}, True), ({}, False)):
        told = {"index": SimulatedDrive("index", -0.04, 0.001, motions), "ring": SimulatedDrive("ring", 0.0, 0.001)}
        asked: list[float] = []

        def late(drives: dict[str, tuple[DriveState, ...]], *_: object, asked: list[float] = asked) -> dict[str, bool]:
            asked.append(float(drives["ring"][0].extra["granted"].max()))
            return {"index": True, "ring": True}

        monkeypatch.setattr(late_current, "_late", late)
        timed, _ = timed_drives(drives, {}, told)
        assert timed["ring"][0].extra["granted"].max() == asked[0]
        assert asked[0] > 0.9 if sure else asked[0] < 0.8
