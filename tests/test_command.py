"""Command station: a drive at its limit, one that sags, one that brakes; answers to commands, early and late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_model.diagnose.locate.answers import Answers, commands, lateness
from hand_model.diagnose.locate.command import (
    CommandFacts,
    _sags,
    command_facts,
    command_findings,
    delays,
    sags_beneath,
    with_lateness,
)
from hand_model.diagnose.locate.simulated import SimulatedDrive
from hand_model.diagnose.locate.strokes import Loss, later, strokes_of
from hand_model.effects.base import DriveState

STEP_S, VISCOUS, LIMIT = 0.018, 0.15, 66.0
LOADS = 30.0  # range [raw]
COMMANDED = {40.0: 25.0, 120.0: 60.0, 255.0: 100.0}  # raw -> %/s


def load(x: np.ndarray | float) -> np.ndarray | float:
    return 42.0 + 0.2 * x


def healthy(x: float, full: float) -> float:
    return full


def limited(x: float, full: float) -> float:
    return min(full, (LIMIT - load(x)) / VISCOUS)


def sagging(x: float, full: float) -> float:
    return full * (1 - 0.004 * load(x))


def braking(x: float, full: float) -> float:
    return full * min(1.0, 0.2 + (100 - x) / 25)


def strokes(
    profile, seed: int, repeats: int = 4, noise: float = 5.0, viscous: float = VISCOUS, back: float | None = None
) -> tuple[DriveState, np.ndarray]:
    """One recording of strokes there and back at every commanded speed, and its current. back: share of full speed at
    which strokes back follow the profile, too."""
    rng = np.random.default_rng(seed)
    x, v, c, told = [], [], [], []
    for raw, full in sorted(COMMANDED.items()) * repeats:
        for way in (1.0, -1.0):
            at = 0.0
            while at < 100:
                place = at if way > 0 else 100 - at
                speed = profile(at, full) if way > 0 else full if back is None else profile(at, back * full)
                x, v, told = [*x, place], [*v, way * speed], [*told, raw]
                c.append(load(place) + viscous * speed if way > 0 else -25 + 0.2 * place - viscous * speed)
                at += speed * STEP_S
        x, v, c, told = x + [0.0] * 5, v + [0.0] * 5, c + [0.0] * 5, told + [raw] * 5
    x, v, c = (np.array(k) for k in (x, v, c))
    current = c + rng.normal(0, noise, len(c))
    state = DriveState(
        "trial",
        "index",
        np.arange(len(x)) * STEP_S,
        x,
        v + rng.normal(0, 0.5, len(x)),
        np.zeros(len(x)),
        np.where(v == 0, np.nan, current),
        np.ones((len(x), 1)),
        extra={"speed": np.array(told)},
    )
    return state, current


@pytest.mark.parametrize(("begin", "told"), [(30.0, True), (50.0, False)])
def test_a_drive_that_loses_no_more_than_a_healthy_controller_is_at_no_limit(begin: float, told: bool) -> None:
    """From some place on speed falls by just what keeps the current from rising: by 6 %, or by 3.3 %."""
    viscous = 1.6
    held = load(begin) + 100 * viscous
    state, current = strokes(lambda x, full: min(full, (held - load(x)) / viscous), 0, 8, 0.2, viscous)
    assert np.isfinite(command_facts((state,), (current,)).ceiling) == told


@pytest.mark.parametrize("seed", range(3))
def test_a_drive_at_its_limit_in_part_of_its_strokes_is_seen(seed: int) -> None:
    state, current = strokes(limited, seed)
    facts = command_facts((state,), (current,))
    assert facts.ceiling == pytest.approx(LIMIT, rel=0.06)
    ((_, finding),) = command_findings({"index": facts}, {"index": "index"}, {})
    assert finding.parameters["share_cut"]["value"] == facts.share_cut and 0 < facts.share_cut < 0.5


@pytest.mark.parametrize("seed", range(3))
def test_a_limit_that_slower_strokes_meet_too_is_read_as_it_is(seed: int) -> None:
    """What each place needs is told by those that have not met it yet."""
    held = 58.0  # at the end full speed needs 77 raw and the slowest strokes 66
    state, current = strokes(lambda x, full: max(min(full, (held - load(x)) / VISCOUS), 3.0), seed)
    assert command_facts((state,), (current,)).ceiling == pytest.approx(held, rel=0.03)


@pytest.mark.parametrize("profile", [healthy, sagging, braking])
def test_what_is_no_limit_has_none(profile) -> None:
    for seed in range(3):
        state, current = strokes(profile, seed)
        assert np.isnan(command_facts((state,), (current,)).ceiling)


def sags(**profiles) -> set[str | None]:
    facts = {}
    for seed, (name, profile) in enumerate(profiles.items()):
        state, current = strokes(profile, seed, noise=1.0)
        facts[name] = command_facts((state,), (current,))
    found = command_findings(facts, {name: name for name in facts}, {})
    return {f.where["actuator"] for _, f in found if f.effect == "drive_sag"}


def test_drives_that_lose_speed_alike_are_of_a_kind_and_one_that_loses_more_sags() -> None:
    def softer(x: float, full: float) -> float:
        return full * (1 - 0.0012 * load(x))

    def hastier(x: float, full: float) -> float:
        return full * (1 + 0.003 * load(x))

    assert sags(index=sagging, ring=healthy) == {"index"}
    assert sags(index=sagging) == {"index"}
    assert sags(index=sagging, ring=sagging) == set()
    assert sags(index=sagging, ring=softer) == {"index"}
    assert sags(index=sagging, ring=hastier) == set()  # controllers of this hand err by as much


@pytest.mark.parametrize(("later_share", "sags"), [(0.021, True), (0.013, False)])
def test_a_sag_is_plain_by_whole_strokes_and_sure_by_their_later_halves(later_share: float, sags: bool) -> None:
    state, current = strokes(healthy, 0)
    other = command_facts((state,), (current,))
    mine, other = (
        replace(other, loss=Loss(whole, 0.002, 1.0), later=Loss(half, 0.002, 1.0))
        for whole, half in ((0.027, later_share), (0.003, -0.005))
    )
    assert _sags(mine, [other]) == sags
    assert not _sags(replace(mine, loss=Loss(0.02, 0.002, 1.0)), [other])


def test_what_a_slow_controller_still_settles_is_no_sag() -> None:
    """Under load it falls behind as a stroke begins, by less and less as it goes."""

    def settling(x: float, full: float) -> float:
        return full * (1 - 0.008 * load(x) * np.exp(-x / 12))

    def catching_up(x: float, full: float) -> float:
        return full * (1 + 0.25 * np.exp(-x / 12))

    assert sags(index=settling, ring=healthy) == set()
    assert sags(index=catching_up, ring=healthy) == set()


def test_of_the_later_half_of_strokes_the_speed_is_read_there() -> None:
    state, current = strokes(healthy, 0)
    whole = strokes_of((state,), (current,))
    halves = later(whole)
    assert len(halves) == len(whole)
    for half, stroke in zip(halves, whole, strict=True):
        assert half.time_s[-1] == stroke.time_s[-1] and half.position[-1] == stroke.position[-1]
        assert len(half.time_s) == pytest.approx(len(stroke.time_s) / 2, abs=1)
    short = [replace(s, time_s=s.time_s[:8], position=s.position[:8]) for s in whole]
    assert later(short) == []  # four rows tell no speed


@pytest.mark.parametrize(
    ("lost", "sag_t", "later_t", "usual", "told"),
    [
        (0.1, 8, 16, 0.0, True),
        (0.1, 16, 8, 0.0, True),
        (0.1, 3, 30, 0.0, False),  # one of the readings may be chance
        (0.028, 24, 15, 0.0, True),
        (0.028, 7, 30, 0.0, True),
        (0.028, 24, 15, 0.0145, False),  # such controllers lose as much
        (0.012, 24, 15, 0.0, False),  # any controller may lose as much
        (0.028, 24, 15, None, False),  # nothing says what controllers of this hand lose
        (0.05, 24, 15, None, True),
    ],
)
def test_a_sag_is_surely_more_by_both_readings_than_the_other_drives_lose(
    lost: float, sag_t: float, later_t: float, usual: float | None, told: bool
) -> None:
    state, current = strokes(sagging, 0, noise=1.0)
    facts = command_facts((state,), (current,))
    sag, usually = lost / LOADS, Loss(np.nan if usual is None else usual / LOADS, 0.0, LOADS)
    losses = {"loss": Loss(sag, sag / sag_t, LOADS), "later": Loss(sag, sag / later_t, LOADS)}
    session = {"index": replace(facts, **losses)}
    if usual is not None:
        session["ring"] = replace(facts, loss=usually, later=usually)
    found = command_findings(session, {name: name for name in session}, {})
    assert {f.where["actuator"] for _, f in found} == ({"index"} if told else set())


@pytest.mark.parametrize(("profile", "told"), [(sagging, True), (healthy, False)])
def test_a_sag_beside_a_reading_that_clips_is_told_by_strokes_that_stay_below(profile, told: bool) -> None:
    """The faster strokes reach the limit where they flex."""

    def clipped(profile, seed: int) -> tuple[tuple[DriveState, ...], tuple[np.ndarray, ...]]:
        state, current = strokes(profile, seed, repeats=8, noise=1.0)
        return (state,), (np.clip(current, -72.0, 72.0),)

    facts = {"index": command_facts(*clipped(profile, 0)), "ring": command_facts(*clipped(healthy, 1))}
    assert sags_beneath(facts, "index", 72.0) is told
    assert not sags_beneath(facts, "index", 20.0)  # nothing is left that tells


def test_a_stroke_that_ends_slowly_is_at_no_limit() -> None:
    """A controller that takes half a second to stop: less current is needed there, and speed falls."""
    state, current = strokes(lambda x, full: full * min(1.0, 0.02 + (100 - x) / (0.35 * full)), 1, 8, 1.0)
    assert np.isnan(command_facts((state,), (current,)).ceiling)


def test_who_brakes_both_ways_is_at_no_limit() -> None:
    """Whatever noise lets the fastest strokes seem to need near their end, and however long the strokes back take."""
    for seed in range(14):
        state, current = strokes(
            lambda at, full: full * min(1.0, 0.02 + (100 - at) / (0.35 * full)), seed, 4, 7.0, 0.08, back=0.7
        )
        assert np.isnan(command_facts((state,), (current,)).ceiling)


def answering(delay_s: float, seed: int) -> tuple[DriveState, np.ndarray]:
    """Eighty commands that current and position answer after `delay_s`, at moments that no sample knows."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 84.0, STEP_S)
    told = np.arange(1, 81) + rng.uniform(0, 0.5, 80)
    setpoint = np.searchsorted(told, t) % 2 * 100.0
    moves = np.sort(np.r_[told + delay_s, told + delay_s + 0.2])
    level = np.interp(t, moves, np.tile([0.0, 100.0, 100.0, 0.0], 40))
    current = np.where(np.searchsorted(moves, t) % 2 == 1, np.where(setpoint > 0, 40.0, -40.0), 0.0)
    position = level + rng.normal(0, 0.02, len(t))
    state = DriveState(
        "trial",
        "index",
        t,
        position,
        np.gradient(level, t),
        np.zeros(len(t)),
        current,
        np.ones((len(t), 1)),
        extra={"setpoint": setpoint},
    )
    return state, current + rng.normal(0, 2, len(t))


def test_a_late_drive_is_told_by_how_much_beside_a_prompt_one() -> None:
    facts = {
        name: command_facts((s,), (c,))
        for name, (s, c) in {"index": answering(0.09, 1), "ring": answering(0.0, 2)}.items()
    }
    found = command_findings(facts, {"index": "index", "ring": "ring"}, {})
    assert [(f.effect, f.where["finger"]) for _, f in found] == [("command_delay", "index")]
    low, high = found[0][1].parameters["delay"]["ci95"]
    assert low < 0.09 < high and high - low < 2 * STEP_S


def test_who_follows_a_path_answers_none_of_its_points() -> None:
    t = np.arange(0, 30.0, STEP_S)
    steps = np.where(np.arange(len(t)) < 200, 0.0, 50.0)
    path = np.where(t < 10, 0.0, 50 - 50 * np.cos(0.8 * (t - 10)))
    assert commands(t, steps).tolist() == [200]
    assert len(commands(t, path)) == 0
    assert commands(t, np.where(t > 20, 80.0, np.minimum(steps, 50.0))).tolist() == [200, int(np.argmax(t > 20))]


def test_answers_that_differ_by_more_than_they_are_late_are_no_delay() -> None:
    rng = np.random.default_rng(3)
    prompt = Answers(rng.uniform(0, STEP_S, 40), rng.uniform(0, STEP_S, 40), STEP_S)
    for of_them, late in ((1.0, True), (0.3, False)):
        apart = rng.uniform(0, STEP_S, 40) + 0.1 / of_them * (np.arange(40) < 40 * of_them)
        facts = {
            name: CommandFacts(x, Loss(), Loss())
            for name, x in (("index", replace(prompt, current_s=apart, motion_s=apart)), ("ring", prompt))
        }
        assert bool(delays(facts, {}, in_time=["index"])) == late


def test_two_prompt_drives_have_no_delay() -> None:
    facts = {
        name: command_facts((s,), (c,))
        for name, (s, c) in {"index": answering(0.0, 3), "ring": answering(0.0, 4)}.items()
    }
    assert not command_findings(facts, {"index": "index", "ring": "ring"}, {})


@pytest.mark.parametrize(("samples", "late"), [(1.3, False), (3.0, True)])
def test_drives_that_answer_as_far_apart_as_two_of_one_kind_may_are_in_time(samples: float, late: bool) -> None:
    facts = {
        name: replace(command_facts(*((x,) for x in answering(0.0, seed))), answers=late_answers(by, by, seed))
        for seed, (name, by) in enumerate({"index": samples, "ring": 0.0}.items())
    }
    assert len(lateness({name: f.answers for name, f in facts.items()})["index"].drive_s)  # it is seen
    assert bool(delays(facts, {"index": "index", "ring": "ring"})) == late


def test_slow_references_of_all_drives_are_no_delay_of_the_one_that_friction_holds_longer() -> None:
    steps = 3.4 + np.linspace(-0.5, 0.5, 40)
    alike = {
        "index": Answers(steps * STEP_S, (steps + 1.5) * STEP_S, STEP_S),
        "ring": Answers(1.05 * steps * STEP_S, steps * STEP_S, STEP_S),
    }
    assert not any(len(told.drive_s) for told in lateness(alike).values())


def test_a_current_ahead_of_its_time_is_early_and_the_prompt_drive_beside_it_is_not_late() -> None:
    (early, current), (prompt, other) = answering(0.0, 5), answering(0.0, 6)
    ahead = np.interp(early.time_s + 0.1, early.time_s, current)
    facts = {"index": command_facts((early,), (ahead,)), "ring": command_facts((prompt,), (other,))}
    told = lateness({name: f.answers for name, f in facts.items()})
    assert told["index"].channel_s == pytest.approx(-0.1, abs=STEP_S) and abs(told["ring"].channel_s) < 0.5 * STEP_S
    assert not command_findings(facts, {"index": "index", "ring": "ring"}, {})
    states = {"index": (early,), "ring": (prompt,)}  # whatever two simulated drives say of it
    simulated = {name: SimulatedDrive(name, 0.0, 1.5e-3) for name in states}
    timed = with_lateness(states, facts, simulated)
    assert timed["index"][0].extra["late"][0] == told["index"].channel_s
    assert abs(timed["ring"][0].extra["late"][0]) < 0.5 * STEP_S


def late_answers(current: float, motion: float, seed: int) -> Answers:
    """Answers of a drive whose current and motion follow their commands that many sample intervals late, with
    scatter."""
    rng = np.random.default_rng(seed)
    return Answers(
        STEP_S * np.round(current + rng.uniform(0, 1, 58)), STEP_S * np.round(motion + rng.uniform(0, 2, 58)), STEP_S
    )


def test_a_late_current_beside_a_punctual_motion_is_a_late_channel() -> None:
    told = lateness({"index": late_answers(4, 0, 1), "ring": late_answers(0, 0, 2)})
    assert not len(told["index"].drive_s)
    assert told["index"].channel_s == pytest.approx(4 * STEP_S, abs=2 * told["index"].doubt_s)
    assert told["ring"].channel_s < told["ring"].doubt_s


def test_a_drive_that_answers_late_in_both_has_a_punctual_channel() -> None:
    told = lateness({"index": late_answers(5, 5, 3), "ring": late_answers(0, 0, 4)})
    assert np.mean(told["index"].drive_s) == pytest.approx(5 * STEP_S, abs=STEP_S)
    assert told["index"].channel_s < 2 * told["index"].doubt_s


def test_a_late_drive_whose_motion_is_later_still_may_have_an_early_current() -> None:
    """Or it breaks loose slowly: what its balance says decides, and then how late the drive is."""
    facts = {
        name: replace(command_facts(*((x,) for x in answering(0.0, seed))), answers=late_answers(*late, seed))
        for seed, (name, late) in enumerate({"index": (4, 8), "ring": (0, 0)}.items())
    }
    told = lateness({name: f.answers for name, f in facts.items()})["index"]
    assert len(told.drive_s) and -4 * STEP_S - told.doubt_s < told.channel_s < told.doubt_s
    assert abs(told.channel_s + 4 * STEP_S) < 1.5 * told.doubt_s
    fingers = {name: name for name in facts}
    ((_, late),) = delays(facts, fingers)
    ((_, right),) = delays(facts, fingers, {"index": -4 * STEP_S})
    assert late.parameters["delay"]["value"] == pytest.approx(4 * STEP_S, abs=0.5 * STEP_S)
    assert right.parameters["delay"]["value"] == pytest.approx(late.parameters["delay"]["value"] + 4 * STEP_S)
    assert not delays(facts, fingers, {"index": 6 * STEP_S})


def test_a_lone_drive_is_held_against_a_usual_one() -> None:
    late, punctual = (lateness({"index": late_answers(k, 0, 5)})["index"] for k in (5, 0))
    assert late.channel_s > 3 * late.doubt_s and punctual.channel_s < punctual.doubt_s
    assert len(lateness({"index": late_answers(5, 5, 6)})["index"].drive_s)


def test_a_delay_of_a_sample_is_told_by_current_and_motion_together() -> None:
    """By one channel alone it is not, nor by less than healthy drives differ by."""
    punctual = late_answers(0, 0, 8)

    def drive_s(current: float, motion: float) -> np.ndarray:
        return lateness({"index": late_answers(current, motion, 7), "ring": punctual})["index"].drive_s

    assert np.mean(drive_s(1.15, 1.15)) == pytest.approx(1.15 * STEP_S, abs=0.4 * STEP_S)
    for current, motion in ((1.15, 0), (0, 1.15), (0.4, 0.4)):
        assert not len(drive_s(current, motion))


def test_a_soft_controller_is_slow_and_not_late() -> None:
    """Its current rises twice as slowly from the command on, beside one that answers at once; a shifted rise is late,
    also where the current still settles, by a fifth of the rise, while the command comes."""

    def rising(delay_s: float, rise_s: float, seed: int, settling: float = 0.0) -> tuple[DriveState, np.ndarray]:
        state, _ = answering(0.0, seed)
        t, setpoint = state.time_s, state.extra["setpoint"]
        rng = np.random.default_rng(seed)
        told = np.flatnonzero(np.diff(setpoint)) + 1
        since = t - np.maximum.accumulate(np.where(np.isin(np.arange(len(t)), told), t, -9.0)) - delay_s
        current = np.where(setpoint > 0, 60.0, -60.0) * np.clip(since / rise_s, 0, 1) * (since < 0.4)
        current += settling * np.sign(setpoint) * np.clip(since / 0.3 + 1, 0, 1) * (since < 0)
        moved = np.interp(t, np.repeat(t[told], 2) + np.tile([delay_s + rise_s, delay_s + rise_s + 0.2], len(told)),
                          np.tile([0.0, 100.0, 100.0, 0.0], len(told))[: 2 * len(told)])  # fmt: skip
        return replace(state, position=moved), current + rng.normal(0, 4, len(t))

    def late(**drives: tuple[DriveState, np.ndarray]) -> set[str]:
        answers = {name: command_facts((state,), (current,)).answers for name, (state, current) in drives.items()}
        return {name for name, x in lateness(answers).items() if len(x.drive_s)}

    assert late(index=rising(0.0, 0.25, 1), ring=rising(0.0, 0.1, 2)) == set()
    assert late(index=rising(0.08, 0.1, 1), ring=rising(0.0, 0.1, 2)) == {"index"}
    assert late(index=rising(0.2, 0.02, 1, settling=12.0), ring=rising(0.0, 0.02, 2)) == {"index"}
    # alone, too: a rise says itself when it begins
    assert late(index=rising(0.0, 0.25, 1)) == set() and late(index=rising(0.08, 0.1, 1)) == {"index"}


@pytest.mark.parametrize(("begins_s", "late_s"), [(0.021, 0.043), (0.06, 0.011)])
def test_a_drive_that_moves_before_its_current_rises_has_a_late_current_and_no_slow_one(
    begins_s: float, late_s: float
) -> None:
    def answering_at(current_s: float, motion_s: float, *rise_s: float) -> Answers:
        return Answers(np.full(30, current_s), np.full(30, motion_s), 0.0235, np.array(rise_s))

    answers = {
        "index": answering_at(0.043, begins_s, 0.02, 0.028, 0.032),
        "ring": answering_at(0.0, 0.021, 0.003, 0.003, 0.003),
    }
    assert lateness(answers)["index"].channel_s == pytest.approx(late_s, abs=1e-3)


@pytest.mark.parametrize(("scatter_s", "late"), [(0.005, True), (0.03, False)])
def test_who_may_move_before_its_current_rises_by_chance_is_slow_and_not_late(scatter_s: float, late: bool) -> None:
    scatter = scatter_s * np.tile([-1.0, 1.0], 17)

    def answers_of(current_s: float, motion_s: float, spread: np.ndarray, *rise_s: float) -> Answers:
        return Answers(current_s + spread, motion_s + spread, 0.018, np.array(rise_s))

    answers = {
        "index": answers_of(0.058, 0.046, scatter, 0.014, 0.030, 0.060),
        "ring": answers_of(0.020, 0.024, 0.2 * scatter, 0.0025, 0.008, 0.026),
    }
    assert bool(len(lateness(answers)["index"].drive_s)) == late


def test_answers_that_are_variously_late_are_the_drives_and_no_slow_rise() -> None:
    """Each change is answered at its own time, and as fast as another drive answers: together they seem to rise slowly."""
    delays = np.tile([0.02, 0.06, 0.10, 0.14], 15)
    own = np.array([-0.01, -0.002, 0.015])
    prompt = Answers(np.full(60, 0.01), np.full(60, 0.013), 0.018, np.array([0.0025, 0.009, 0.022]), own_s=own)

    def late(own_s: np.ndarray) -> bool:
        answers = Answers(delays + 0.01, delays + 0.013, 0.018, np.array([0.035, 0.073, 0.133]), own_s=own_s)
        return bool(len(lateness({"index": answers, "ring": prompt})["index"].drive_s))

    assert late(own)
    assert not late(np.array([-0.02, 0.03, 0.09]))  # a slow one rises slowly from its own answers on, too


def test_answers_too_few_say_nothing() -> None:
    assert not lateness({"index": Answers(np.full(4, 0.09), np.full(4, 0.09), STEP_S)})


def test_what_one_simulated_drive_says_of_its_current_is_held_against_answers_to_commands() -> None:
    """How the log is read is in the lateness of the one that was simulated; of two the other tells it."""
    drives = {name: answering(0.0, seed) for seed, name in enumerate(("index", "ring"))}
    facts = {name: command_facts((state,), (current,)) for name, (state, current) in drives.items()}
    states = {name: (state,) for name, (state, _) in drives.items()}
    early, prompt = SimulatedDrive("index", -0.02, 2e-3), SimulatedDrive("ring", 0.0, 2e-3)
    answers = lateness({name: f.answers for name, f in facts.items()})["index"]

    def late(*simulated: SimulatedDrive) -> tuple[float, float]:
        timed = with_lateness(states, facts, {d.actuator: d for d in simulated})
        return tuple(timed["index"][0].extra["late"])

    assert late() == pytest.approx((answers.channel_s, np.hypot(answers.doubt_s, 0.1 * answers.channel_s)))
    assert late(early, prompt) == pytest.approx((-0.02, 2e-3))
    value, doubt = late(early)
    assert -0.01 < value < late()[0] and 2e-3 < doubt < late()[1]
    assert late(replace(early, doubt_s=float("inf"))) == late()


@pytest.mark.parametrize("rise_s", [0.06, 0.15])
def test_a_current_that_rises_before_its_commands_is_early_by_what_all_of_them_show_together(rise_s: float) -> None:
    """Each change alone shows next to nothing before it: noise of a tenth of the rise, which takes 60 ms, or for the
    early one more than twice as long."""

    def rising(early_s: float, seed: int, rise_s: float) -> tuple[DriveState, np.ndarray]:
        rng = np.random.default_rng(seed)
        t = np.cumsum(rng.uniform(0.8, 1.2, 2400)) * STEP_S
        setpoint, x, c = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t))
        for k in range(0, len(t) - 60, 60):
            at, up = t[k] + rng.uniform(0, 3 * STEP_S), (k // 60) % 2 == 0
            now = (t >= at) & (t < at + 60 * STEP_S)
            setpoint[t >= at] = 100.0 * up
            ramp = np.clip((t - at + early_s) / rise_s, 0.0, 1.0) * ((t - at + early_s) < 0.6)
            c += (1 if up else -1) * 60.0 * ramp * (t < at + 60 * STEP_S - 0.25)
            x[now] = 50 + (1 if up else -1) * np.clip((t[now] - at - 0.03) * 150 - 45, -45, 45)
        state = DriveState(
            "trial", "index", t, x, np.gradient(x, t), 0 * t, c, np.ones((len(t), 1)),
            extra={"setpoint": setpoint},
        )  # fmt: skip
        return state, c + rng.normal(0, 5.0, len(t))

    def told(early_s: float) -> dict[str, float]:
        drives = {"index": rising(early_s, 1, rise_s), "ring": rising(0.0, 2, 0.06)}
        facts = {a: command_facts((state,), (current,)) for a, (state, current) in drives.items()}
        return {a: x.channel_s for a, x in lateness({a: f.answers for a, f in facts.items()}).items()}

    assert told(0.0) == pytest.approx({"index": 0.0, "ring": 0.0}, abs=5e-3)
    early = told(0.03)
    assert early["index"] == pytest.approx(-0.03, abs=0.01) and early["ring"] == pytest.approx(0.0, abs=5e-3)


def test_a_drive_that_seems_to_answer_a_little_before_it_is_told_is_prompt_and_the_late_one_late() -> None:
    prompt, late = (Answers(np.full(20, current), np.full(20, 0.02), STEP_S) for current in (-5e-4, 0.085))
    told = lateness({"index": late, "ring": prompt})
    assert told["index"].channel_s == pytest.approx(0.085, abs=1e-3) and not len(told["index"].drive_s)
    assert told["ring"].channel_s == pytest.approx(0.0, abs=1e-3)
