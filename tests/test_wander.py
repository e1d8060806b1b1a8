"""What does not repeat: random levels are told from noise and from physics; time stamps and echoes from
measurements."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnose import drive, planted

from hand_model.diagnose.assemble import _wanders
from hand_model.diagnose.locate.measurement import echoes_command, frozen, is_measured, rests_on_command
from hand_model.diagnose.name import station as station_module
from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.candidates import EVIDENCE_LEAST
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.naming import ALPHA
from hand_model.diagnose.name.selection import name_effects
from hand_model.diagnose.name.wander import Wander, estimate_wander
from hand_model.effects import catalogue, effect, outsiders
from hand_model.session import Log
from hand_model.session.stamps import stamps


def test_whitening_and_likelihood_are_those_of_the_dense_covariance():
    rng = np.random.default_rng(4)
    label = np.repeat([0, 1, 2], [7, 1, 12])
    weight, inflation = rng.uniform(0.2, 1.0, 20), 1.7
    wander = Wander(label, 1.3, 9.0, 0.3)
    cover = np.eye(20) + wander.deviation**2 / inflation * np.outer(weight, weight) * (label[:, None] == label)
    values = rng.normal(size=(20, 3))
    white = wander.whiten(values, weight, inflation)
    assert np.allclose(white.T @ white, values.T @ np.linalg.solve(cover, values), atol=1e-12)
    assert np.allclose(values.T @ values - wander.common(values.T, weight, inflation), white.T @ white, atol=1e-12)
    residual = values[:, 0]
    dense = -0.5 * (residual @ np.linalg.solve(cover, residual) / inflation + np.linalg.slogdet(cover)[1])
    assert wander.log_likelihood(residual, weight, inflation) == pytest.approx(dense, rel=1e-12)


def walk(seed: int, size: float, memory_s: float = 6.0):
    rng = np.random.default_rng(seed)

    def add(state):
        step = np.diff(state.time_s, prepend=state.time_s[0])
        out, at = np.zeros(len(step)), rng.normal()
        for i, d in enumerate(step):
            keep = np.exp(-d / memory_s)
            at = keep * at + np.sqrt(1 - keep**2) * rng.normal()
            out[i] = size * at
        return out

    return add


@pytest.mark.parametrize("seed", [pytest.param(0, marks=pytest.mark.slow), 1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_wandering_zero_is_noise_and_not_physics(seed):
    states = drive(seed, walk(seed, 4.0))
    station = judged("current", "index", "index", None, states, catalogue("drive"))
    assert not (station.believed and station.kept)
    assert station.naming.wander.real
    assert 2.5 < station.naming.wander.deviation < 5.5


@pytest.mark.parametrize(("seed", "colour"), [(0, 0.0), (1, 0.0), (2, 0.5)])
def test_replicates_that_repeat_have_no_wander(seed, colour):
    balance = Balance(drive(seed, colour=colour))
    assert not estimate_wander(balance, balance.fit().prediction).real


def test_an_obstacle_in_one_trial_is_still_named_beside_its_rival_chance():
    shape = {"trial": 1.0, "form": 0.0, "since": 0.4, "until": 1.0, "begin": 55.0}
    contact = planted("external_contact", shape, [0.6, *[0.0] * 8])
    naming = name_effects(drive(7, contact), catalogue("drive"))
    assert [f.term.effect.name for f in naming.found] == ["external_contact"]
    assert naming.found[0].amplitudes["stiffness"] == pytest.approx(0.6, rel=0.15)


@pytest.mark.parametrize(("since", "until", "there"), [(0.06, 0.71, (0, 1, 2, 3)), (0.16, 0.58, (0, 2, 3))])
def test_the_while_of_a_weak_obstacle_is_found_between_its_starts(since, until, there):
    """The same while of all recordings or of some; what the finger does elsewhere says nothing of when it ends."""

    def contact(state):
        share = (state.time_s - state.time_s[0]) / np.ptp(state.time_s)
        here = (share >= since) & (share <= until) & (state.extra["trial_index"][0] in there)
        return 0.3 * np.maximum(state.position - 58.0, 0.0) * here

    station = judged("current", "index", "index", None, drive(8, contact), catalogue("drive"))
    assert station.believed and [f.term.effect.name for f in station.kept] == ["external_contact"]
    figures = station.parameters[0]
    assert figures["stiffness"]["value"] == pytest.approx(0.3, rel=0.2)
    assert figures["begin"]["value"] == pytest.approx(58.0, abs=4.0)


@pytest.mark.parametrize("later", [(0.15, 0.6), (0.0, 1.0)])
def test_an_obstacle_of_one_recording_may_be_there_in_one_kept_out_for_the_same_while_or_for_all_of_it(later):
    spans = {0.0: (0.15, 0.6), 3.0: later}

    def contact(state):
        since, until = spans.get(float(state.extra["trial_index"][0]), (2.0, 3.0))
        share = (state.time_s - state.time_s[0]) / np.ptp(state.time_s)
        return 1.0 * np.maximum(state.position - 60.0, 0.0) * ((share >= since) & (share <= until))

    states = drive(7, contact)
    assert states[3].validate
    naming = name_effects(states, [effect("external_contact")])
    station = station_module.Station("current", "index", "index", None, naming)
    assert station.believed and [f.term.shape["trial"] for f in station.kept] == [0.0]
    before, after = station._kept_out
    assert before > 2.0 and after < 1.1


@pytest.mark.slow
def test_an_obstacle_in_recordings_that_others_do_not_foretell_is_no_spring():
    """It is there in two of those that teach and in the one kept out, each time for another while."""
    spans = {0.0: (0.1, 0.8), 2.0: (0.3, 0.7), 3.0: (0.05, 0.65)}

    def contact(state):
        trial = float(state.extra["trial_index"][0])
        since, until = spans.get(trial, (2.0, 3.0))
        share = (state.time_s - state.time_s[0]) / np.ptp(state.time_s)
        return 1.2 * np.maximum(state.position - 70.0, 0.0) * ((share >= since) & (share <= until))

    station = judged("current", "index", "index", None, drive(7, contact), catalogue("drive"))
    assert station.believed and {f.term.effect.name for f in station.kept} == {"external_contact"}


def test_physics_is_found_through_a_wandering_zero():
    extra = planted("position_dependent_friction", {"centre": 45.0, "width": 7.0}, [15.0])
    wandering = walk(3, 3.0)
    naming = name_effects(drive(3, lambda s: extra(s) + wandering(s)), catalogue("drive"))
    assert [f.term.effect.name for f in naming.found] == ["position_dependent_friction"]
    assert naming.found[0].amplitudes["extra_friction"] == pytest.approx(15.0, rel=0.2)


@pytest.mark.parametrize(("seed", "before", "share"), [pytest.param(1, 12, 0.5, marks=pytest.mark.slow), (2, 8, 0.7)])
def test_a_jump_of_friction_is_found_between_the_moments_that_are_tried(seed, before, share):
    """Beside levels per stroke only the stroke in which it happens tells the moment, and every start may be in another
    one."""
    jump = next(e for e in outsiders("drive") if e.name == "friction_jump")
    starts = jump.shapes(drive(seed))[0].starts
    moment = (1 - share) * starts[before] + share * starts[before + 1]
    states = drive(seed, lambda s: jump.columns(s, {"moment": moment}) @ np.array([14.0]), noise=2.5)
    naming = name_effects(states, (*catalogue("drive"), *outsiders("drive")))
    assert [f.term.effect.name for f in naming.found] == ["friction_jump"]
    assert naming.found[0].term.shape["moment"] == pytest.approx(moment, abs=0.1)


def log_of(state, time_s, position) -> Log:
    return Log(time_s, {"position": position, "setpoint": np.where(state.velocity > 0, 100.0, 0.0)}, Path("log.csv"))


def test_stamps_that_belong_to_their_rows_are_believed_and_packets_are_not():
    states = drive(11)
    noise = np.random.default_rng(0)
    right = [log_of(s, s.time_s, s.position + noise.normal(0, 0.05, len(s.position))) for s in states]
    judged = stamps(right)
    assert judged.believed
    assert judged.followed == pytest.approx(1.0, abs=0.05)

    def packed(t):
        edges = np.arange(0, len(t), 9)
        late = np.interp(np.arange(len(t)), edges, t[edges]) + 0.03 * (np.arange(len(t)) // 9 % 2)
        return np.maximum.accumulate(late) + 1e-6 * np.arange(len(t))

    wrong = stamps([log_of(s, packed(s.time_s), log.columns["position"]) for s, log in zip(states, right, strict=True)])
    assert not wrong.believed
    assert wrong.wrong_s > 3e-3


def test_a_position_that_repeats_its_setpoint_is_no_measurement():
    states = drive(12)
    logs = [log_of(s, s.time_s, s.position) for s in states]
    assert not echoes_command(logs)
    assert echoes_command([replace(log, columns={**log.columns, "position": log.columns["setpoint"]}) for log in logs])


def test_a_position_that_rests_on_every_setpoint_to_the_count_is_no_measurement():
    states = drive(12)
    move = np.arange(len(states[0].time_s)) // 100
    setpoint = 12000.0 + 3000.0 * (move % 3) + 37.0 * move
    # starts at once, ends there
    reference = np.convolve(np.r_[np.full(30, setpoint[0]), setpoint], np.ones(31) / 31, mode="valid").round()
    ended = np.random.default_rng(1).normal(0, 5.0, len(setpoint)).round()
    log = log_of(states[0], states[0].time_s, reference)
    log = replace(log, columns={**log.columns, "setpoint": setpoint})
    assert rests_on_command([log]) and not echoes_command([log])
    assert not rests_on_command([replace(log, columns={**log.columns, "position": reference + ended})])
    # an integrator ends there, too, but its motion begins when the current has overcome friction
    current = np.random.default_rng(2).normal(0, 3.0, len(setpoint)) + 60.0 * np.sign(setpoint - reference)
    answers = {**log.columns, "current": np.roll(current, 4)}
    assert rests_on_command([replace(log, columns=answers)])
    driven = {**log.columns, "current": current, "position": np.roll(reference, 4)}
    assert not rests_on_command([replace(log, columns=driven)])
    coarse = {**log.columns, "position": 3000.0 * (reference / 3000.0).round()}
    assert not rests_on_command([replace(log, columns=coarse)])


def test_a_current_of_one_value_a_stroke_is_no_measurement():
    states = drive(12)
    assert is_measured(states)
    levels = np.array([16.0, 26.0, 58.0, 68.0, 115.0])

    def commanded(state):
        level = levels[
            np.searchsorted(np.quantile(np.abs(state.velocity), [0.2, 0.4, 0.6, 0.8]), np.abs(state.velocity))
        ]
        way = np.sign(state.velocity)
        stroke = np.cumsum(np.r_[0, np.diff(way) != 0])
        value = np.array([np.median(level[stroke == k]) for k in range(stroke[-1] + 1)])[stroke] * way
        return replace(state, effort=np.where(np.isfinite(state.effort), value, np.nan))

    assert not is_measured(tuple(commanded(s) for s in states))


def test_a_current_that_the_way_to_the_target_tells_is_asked_for_and_not_measured():
    """Moves pass one place for other targets: what flows there is the same, what a controller asks for is not."""
    rng = np.random.default_rng(3)

    def to_target(state):
        way = np.sign(state.velocity)
        stroke = np.cumsum(np.r_[0, np.diff(way) != 0])
        further = rng.uniform(0, 60, stroke[-1] + 1)[stroke] * way  # some moves are stopped before their target
        ends = np.array([state.position[stroke == k][-1] for k in range(stroke[-1] + 1)])[stroke]
        return replace(state, extra={**state.extra, "setpoint": ends + further})

    def asked(state):
        current = 0.8 * (state.extra["setpoint"] - state.position) + rng.normal(0, 4.0, len(state.time_s))
        return replace(state, effort=np.where(np.isfinite(state.effort), current, np.nan))

    states = tuple(to_target(s) for s in drive(12))
    assert is_measured(states)
    assert not is_measured(tuple(asked(s) for s in states))


def test_a_current_that_speed_alone_tells_is_a_command_and_one_that_rubs_is_none():
    def told(state, coulomb):
        noise = np.random.default_rng(4).normal(0, 4.0, len(state.velocity))
        current = (1.3 * state.velocity / 8).round() * 8 + coulomb * state.direction + noise
        return replace(state, effort=np.where(np.isfinite(state.effort), current, np.nan))

    states = drive(12)
    speed = float(np.std(np.concatenate([s.velocity for s in states])))
    assert not is_measured(tuple(told(s, 0.0) for s in states))
    assert is_measured(tuple(told(s, 0.3 * speed) for s in states))


def test_a_reading_that_is_mostly_clipped_is_still_one():
    """What stands at its end has no noise; what lies below it has."""
    states = drive(12)
    effort = np.concatenate([s.effort[np.isfinite(s.effort)] for s in states])
    low, high = np.quantile(effort, [0.3, 0.65])
    clipped = tuple(replace(s, effort=np.clip(s.effort, low, high)) for s in states)
    assert is_measured(clipped)


def test_a_ripple_is_not_read_from_starts_and_stops():
    state = drive(5)[0]
    steady = (np.arange(len(state.time_s)) % 7 > 2).astype(float)
    masked = replace(state, extra={**state.extra, "steady": steady})
    columns = effect("torque_ripple").columns(masked, {"period": 9.0})
    assert np.all(columns[steady == 0] == 0)
    assert np.any(columns[steady == 1] != 0)


def test_a_loud_moment_counts_for_less_and_a_quiet_recording_for_all():
    from hand_model.diagnose.locate.blocks import _calm

    scatter = np.random.default_rng(3).normal(0, 3e-4, (200, 8, 9, 3))
    assert np.all(_calm(scatter) == 1)
    scatter[80:120] *= 4
    scatter[:, :, 4] = np.nan
    calm = _calm(scatter)
    assert np.all(calm[84:116] < 0.1)
    assert np.all(calm[:70] == 1)


@pytest.mark.parametrize(("level", "found"), [(None, False), (30.0, True), (60.0, False), (0.0, False)])
def test_a_current_that_stands_still_in_motion_was_not_read(level: float | None, found: bool) -> None:
    """By chance neighbours are alike; at its limit a reading stays, and at zero it may be dead."""
    rng = np.random.default_rng(4)
    current = np.clip(np.round(30.0 + rng.normal(0, 6.0, 3000)), None, 60.0)
    current[100:104] = 60.0
    if level is not None:
        current[1000:1020] = level
    moving = np.arange(3000) % 200 < 150
    still = frozen(current, moving)
    assert still.any() == found
    if found:
        assert still[1001:1019].all() and still.sum() < 25
    at_rest = current.copy()
    at_rest[160:190] = 25.0  # a controller holds
    assert not frozen(at_rest, moving)[150:200].any()


def test_one_finger_wanders_only_if_noise_that_lasts_as_in_the_others_does_not_say_as_much():
    def station(finger: str, seed: int, inflation: float, extra=lambda s: 0.0) -> SimpleNamespace:
        balance = Balance(drive(seed, extra)).with_inflation(inflation)
        fit = balance.fit()
        naming = SimpleNamespace(balance=balance, fit=fit, wander=estimate_wander(balance, fit.prediction))
        wander = naming.wander.deviation / balance.sigma
        return SimpleNamespace(finger=finger, signal="current", joint=None, naming=naming, wander=wander)

    restless, calm = station("index", 3, 1.0, walk(3, 3.0)), station("ring", 4, 1.0)
    assert restless.naming.wander.real and _wanders(restless, [restless, calm])
    assert _wanders(restless, [restless, station("ring", 4, 1.5)])
    assert not _wanders(calm, [restless, calm])
    lasting = station("ring", 4, 300.0)  # so long that it says all
    assert not _wanders(restless, [restless, lasting])


def test_what_one_recording_alone_has_must_be_plain_where_no_test_sees_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be in any of them and at any time; what the machine has is in all."""

    def contact(state):
        while_ = (state.trial == "trial_1") & (state.time_s - state.time_s[0] > 0.3 * np.ptp(state.time_s))
        return 0.06 * np.maximum(state.position - 50.0, 0.0) * while_

    asked = []
    monkeypatch.setattr(station_module, "_stands", lambda naming, found, which, least: asked.append(least) or True)
    rippled = planted("torque_ripple", {"period": 9.0}, [0.9, 0.0])
    for add, name in ((contact, "external_contact"), (rippled, "torque_ripple")):
        station = judged("current", "index", "index", None, drive(7, add), [effect(name)])
        assert station.naming.before.p >= ALPHA and [f.term.effect.name for f in station.naming.found] == [name]
    assert asked[0] == pytest.approx(2 * EVIDENCE_LEAST + np.log(100.0))
    assert asked[-1] == pytest.approx(np.log(20.0 * 100.0), abs=0.01)
