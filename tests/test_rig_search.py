"""What a rig's search may rest on: noise that is no mismatch, friction that turns round over a distance, long
recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rig_bench import ARM, Motion, recorded

from hand_model.effects.path import jenkins
from hand_model.rig import diagnose_rig, load_rig
from hand_model.rig.diagnose import trusted_fit
from hand_model.rig.evidence import weigh
from hand_model.rig.laws import TURNING
from hand_model.rig.name.candidates import candidates
from hand_model.rig.name.compete import _settled_down, borne_out, compete, score, splits
from hand_model.rig.name.problem import Term, extended, normal, pose
from hand_model.rig.swing import compete as swing_compete
from hand_model.rig.swing.build import ENOUGH_STEPS, thinned
from hand_model.rig.swing.compete import PARTS, Variant, _folds
from hand_model.rig.swing.diagnose import _figures, _searched, _standing, _starts
from hand_model.rig.swing.fit import Fitted, jacobian
from hand_model.rig.swing.free import free_errors
from hand_model.rig.swing.free_fit import Task
from hand_model.rig.swing.simulation import INDEX, PARAMETERS, Lane, Swing, simulate, vector
from hand_model.rig.swing.start import freed, started
from hand_model.session import read_session


def bench(folder: Path, by_load: float, noise: float, late: float = 0.0, last: float = 1.0) -> Path:
    """Six recordings of two sines each, the last two held out; by_load: friction per load, which turns round over 0.1
    rad;
    noise [N m] of the torque, which acts late [s] after it is recorded; last: times as fast the fourth of them."""

    def torque(motion: Motion) -> np.ndarray:
        t, q, v, a = motion
        load = (0.6 * 0.04 + 0.002) * a + 0.6 * 0.2 * 9.81 * np.sin(q)
        return np.interp(t + late, t, load + 0.03 * v + 0.08 * np.sign(v) + by_load * np.abs(load) * jenkins(q, 0.1))

    return recorded(folder, ARM, 6, torque, noise, last)


def test_friction_by_load_that_turns_round_over_a_distance(tmp_path: Path) -> None:
    """Load-dependent friction is named first, with its size and the distance within 10 %, and leaves little of the
    mismatch."""
    found = diagnose_rig(read_session(bench(tmp_path / "s", 0.3, 0.01)))
    first = found.findings[0]
    assert first.effect == "load_dependent_friction"
    assert [first.parameters[n]["value"] for n in ("per_load", "reach")] == pytest.approx([0.3, 0.1], rel=0.1)
    assert found.lack_of_fit["one_effect"] < 0.2


def test_a_noisy_torque_is_no_mismatch(tmp_path: Path) -> None:
    """Ten percent of noise on a torque that the declared model explains: consistent, and the friction is the planted
    one."""
    session = read_session(bench(tmp_path / "s", 0.0, 0.08))
    assert diagnose_rig(session).verdict == "consistent"
    fit = trusted_fit(load_rig(session))[0]
    friction = [t for c, t in zip(fit.columns, fit.theta, strict=True) if c.kind in ("damping", "frictionloss")]
    assert friction == pytest.approx([0.03, 0.08], rel=0.1)


def test_a_torque_that_acts_a_fraction_of_a_sample_late_is_a_delay_and_no_spring(tmp_path: Path) -> None:
    """Loudest in one fast recording: the delay wins, as long as it is; without it nothing does."""
    for late in (0.0, 0.0015):
        rig = load_rig(read_session(bench(tmp_path / str(late), 0.0, 0.002, late, 3.0)))
        fit = trusted_fit(rig)[0]
        terms = compete(pose(fit), candidates(rig, fit, "hinge"))[0]
        assert [t.candidate.effect for t in terms] == ["current_channel_delay"] * (late > 0)
        assert not late or terms[0].shape["delay"] == pytest.approx(-late, rel=0.1)


def test_terms_are_fitted_beside_each_other_and_leave_where_they_do_not_pay(tmp_path: Path) -> None:
    """A shape that is off finds its place beside another term; what takes nothing away goes, unless that was tried
    before."""
    rig = load_rig(read_session(bench(tmp_path / "s", 0.3, 0.01)))
    fit = trusted_fit(rig)[0]
    problem, known = pose(fit, "hinge"), {c.key: c for c in candidates(rig, fit, "hinge")}
    turning, drag = (
        next(c for k, c in known.items() if k.startswith(name))
        for name in (f"load_dependent_friction/{TURNING}", "quadratic_damping")
    )
    terms = Term(turning, {"form": 1.0, "reach": 0.3}), Term(drag, {})
    kept, stays = _settled_down(problem, terms, 0, set())
    assert [t.candidate.key for t in kept] == [turning.key] and stays == [True, False]
    assert kept[0].shape["reach"] == pytest.approx(0.1, rel=0.3)  # at the loads of the declared fit
    assert _settled_down(problem, terms, 0, {(turning.key,)})[1] == [True, True]


def test_a_column_beside_a_delay_is_late_as_all_others_are(tmp_path: Path) -> None:
    """Normal equations with one more term are those of all terms at once."""
    rig = load_rig(read_session(bench(tmp_path / "s", 0.3, 0.01, late=0.02)))
    fit = trusted_fit(rig)[0]
    known = {c.effect: c for c in candidates(rig, fit, "hinge")}
    late, drag = Term(known["current_channel_delay"], {"delay": 0.02}), Term(known["quadratic_damping"], {})
    problem = pose(fit, "hinge")
    for one, other in zip(
        extended(problem, [late], drag, normal(problem, [late])), normal(problem, [late, drag]), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def test_the_best_of_many_rivals_is_held_to_the_best_of_chance() -> None:
    """Of rivals that gain nothing one in twenty rounds names one, be they independent or all the same; a real gain that
    one of many alike has is as sure as alone."""
    random, blocks = np.random.default_rng(0), 30
    none, group = np.full(blocks, 10.0), np.arange(blocks)
    for alike in (False, True):
        hits = 0
        for _ in range(200):
            noise = random.standard_normal((1 if alike else 15, blocks))
            hits += weigh(none, none - np.repeat(noise, 15 if alike else 1, 0), [1] * 15, group) is not None
        assert hits < 25
    gain = 0.6 + random.standard_normal((1, blocks))
    alone = weigh(none, none - gain, [1], group)
    among = weigh(none, none - np.repeat(gain, 15, 0), [1] * 15, group)
    assert alone is not None and among is not None and among.probability == alone.probability


def test_the_loudest_block_does_not_speak_for_all() -> None:
    """What every block says counts, however loud one is; what that one says alone does not."""
    group, loud = np.arange(20), np.where(np.arange(20) == 3, 1e4, 1.0)
    assert weigh(loud, np.array([0.5 * loud]), [1], group) is not None
    alone = np.where(np.arange(20) == 3, 0.5, 1.0 + 0.01 * (-1.0) ** np.arange(20)) * loud
    assert weigh(loud, np.array([alone]), [1], group) is None


def test_effects_that_help_only_together_stand_together() -> None:
    """An effect that makes the held-out error worse before a later one comes stands where all are worse without it; one
    that they do without is withdrawn, and one that helps last comes last."""
    error = {"": 10.0, "a": 5.0, "ab": 6.0, "abc": 1.0, "ac": 4.9}
    helpers = {"": 10.0, "a": 5.0, "ab": 6.0, "abc": 1.0, "ac": 2.0}
    useless = {"": 10.0, "a": 5.0, "ab": 6.0, "abc": 2.0, "ac": 2.0}
    for table, order, gone in ((error, "abc", []), (helpers, "acb", []), (useless, "ac", ["b"])):

        def chain(some: list, table: dict = table) -> list[SimpleNamespace]:
            keys = ["".join(v.key for v, _ in some[:k]) for k in range(len(some) + 1)]
            return [SimpleNamespace(error=table[key]) for key in keys]

        kept, links, rejected = _standing([(SimpleNamespace(key=k), None) for k in "abc"], chain)
        assert "".join(v.key for v, _ in kept) == order
        assert [r["effect"] for r in rejected] == gone
        assert links[-1].error == min(table.values())


def test_an_effect_whose_size_cannot_be_told_leaves_its_place_to_the_next() -> None:
    """The last of the first search goes, the search goes on without it, and what it finds stands."""
    a, b, c = (SimpleNamespace(key=k, effect=k, start={k: 0.0}) for k in "abc")
    asked = []

    def search(kept, without):
        asked.append(([v.key for v, _ in kept], set(without)))
        second = c if "b" in without else b
        return [(a, SimpleNamespace(taken=(a,))), (second, SimpleNamespace(taken=(a, second)))]

    def chain(some):
        return [SimpleNamespace(error=1.0 / (k + 1)) for k in range(len(some) + 1)]

    def ends(link):
        return {"a": (0.5, 1.5), "b": (-1.0, 1.0), "c": (0.1, 0.2)}

    kept, _, _, rejected = _searched(search, chain, ends, lambda sets: [])
    assert [v.key for v, _ in kept] == ["a", "c"] and [r["effect"] for r in rejected] == ["b"]
    assert asked == [([], set()), (["a"], {"b"})]


def test_what_stood_before_a_later_round_comes_back_where_that_holds_no_better() -> None:
    """A variant that suits the first effect alone, another that the last round exchanged it for: what all predict
    decides which stands, and the figure with one effect is that of the one that suits it alone."""
    alone, beside, other = (SimpleNamespace(key=k, effect=k[0], start={k: 0.0}) for k in ("a1", "a2", "b"))
    found = [(beside, SimpleNamespace(taken=(alone,))), (other, SimpleNamespace(taken=(beside, other)))]
    for error, stands in (
        ({"": 1.0, "a1": 0.4, "a2": 0.9, "a2b": 0.5}, ["a1"]),
        ({"": 1.0, "a1": 0.4, "a2": 0.9, "a2b": 0.2}, ["a2", "b"]),
    ):

        def links(sets: list, table: dict = error) -> list[SimpleNamespace]:
            return [SimpleNamespace(error=table["".join(v.key for v, _ in some)]) for some in sets]

        def chain(some: list, links: Any = links) -> list[SimpleNamespace]:
            return links([some[:k] for k in range(len(some) + 1)])

        ends = {k: (0.5, 1.5) for k in ("a1", "a2", "b")}
        kept, link, _, _ = _searched(lambda kept, without: found, chain, lambda _, ends=ends: ends, links)
        assert [v.key for v, _ in kept] == stands
        assert _figures(kept, link, links)[:2] == [1.0, 0.4]


def test_a_fit_with_a_variant_that_was_exchanged_starts_from_both_sides() -> None:
    """Its round knows nothing of it: from what the last round says, and from where it begins beside the declared
    model."""
    variant = Variant("load_dependent_friction", "external", {"load_external": 0.0})
    own, last, declared = (
        vector({"inertia": i, **more})
        for i, more in ((1.0, {"load_gear": 0.3}), (2.0, {"load_external": 0.2}), (3.0, {}))
    )
    free = ("inertia", "load_external")
    starts = _starts(free, [(variant, SimpleNamespace(fit=SimpleNamespace(theta=own)))], declared, last)
    assert [[s[INDEX[n]] for n in ("inertia", "load_external", "load_gear")] for s in starts] == [
        [1.0, 0.2, 0.0],
        [3.0, 0.0, 0.0],
    ]
    known = [(variant, SimpleNamespace(fit=SimpleNamespace(theta=last)))]
    assert len(_starts(free, known, declared, last)) == 1 and _starts(free, [], declared, last)[0] is declared


@pytest.mark.parametrize(("cost", "named"), [(0.5, True), (0.99, False)])
def test_only_what_explains_its_own_recordings_may_explain_others(cost: float, named: bool) -> None:
    """A rival that predicts what is left out of a dying swing, and one that does so without lowering the error that it
    was fitted to; and the large first turns do not speak for all."""
    blocks, folds = 8 * PARTS, [(tuple(i for i in range(8) if i != k), (k,)) for k in range(8)]
    test = SimpleNamespace(lanes=[SimpleNamespace(trial=f"run_{k}") for k in range(8)], driven=False)
    none = np.where(np.arange(blocks) < PARTS, 100.0, 1.0)
    error = np.where(np.arange(blocks) < PARTS, 110.0, 0.3)
    current = Fitted(np.zeros(len(PARAMETERS)), 1.0, 1, 3)
    rival = swing_compete._Rival(Variant("quadratic_damping", "", {}), replace(current, cost=cost, free=4), error)
    found = swing_compete._judged(current, none, [rival], test, folds, 1e-3)
    assert (found is not None and found[0] == 0) == named


def test_a_long_swing_is_searched_on_some_of_its_stretches() -> None:
    """No more training steps than enough, of every trial alike, all that validate; a short one as it is."""
    size = 500
    blank = Lane("", False, np.zeros(size), 1.0, np.zeros(size), (0.0, 0.0), np.zeros(size), np.ones(size))
    lanes = [replace(blank, trial=name, validate=name == "c") for name in "abc" for _ in range(96)]
    swing = Swing(tuple(lanes), 1.0, 0.0, {"inertia": 1.0}, False)
    some = thinned(swing)
    count = {name: sum(lane.trial == name for lane in some.lanes) for name in "abc"}
    assert count["a"] == count["b"] == 12 and count["c"] == 96
    assert len(some.train()) * size <= ENOUGH_STEPS
    short = replace(swing, lanes=tuple(lanes[::10]))
    assert thinned(short) is short


def test_a_recording_with_a_level_of_its_own_is_not_left_out_whole(tmp_path: Path) -> None:
    """Two recordings: each is left out alone where they share all parameters, in halves and thirds where each sets its
    own friction."""
    folder = bench(tmp_path / "s", 0.3, 0.01)
    head, *trials = (path := folder / "session.toml").read_text().split("[[trial]]")
    for levels, count in (
        (("", ""), 2),
        (('set = { "joint:hinge:frictionloss" = 0.05 }\n', 'set = { "joint:hinge:frictionloss" = 0.1 }\n'), 5),
    ):
        path.write_text("[[trial]]".join([head, *(t + level for t, level in zip(trials[:2], levels, strict=True))]))
        parts = splits(pose(trusted_fit(load_rig(read_session(folder)))[0]))
        assert len(parts) == count and np.all(np.sum(parts, 0) == (1 if count == 2 else 2))


def test_a_free_swing_starts_where_its_first_period_says() -> None:
    """Starts that are wrong by half a degree and 0.1 rad/s come back to what the recording was made with, at a friction
    that is wrong by a tenth; those of a driven joint stay."""
    theta = vector({"inertia": 0.02, "damping": 4e-4, "coulomb": 1e-3})
    starts, steps = ((1.2, 0.5), (0.3, -1.5), (-0.6, 2.0)), 1500
    blank = [
        Lane(n, False, np.zeros(steps), 1.0, np.zeros(steps), s, np.zeros(steps), np.ones(steps))
        for n, s in zip("abc", starts, strict=True)
    ]
    swing = Swing(tuple(blank), 0.8, 0.0, {"inertia": 0.02}, False, 4e-3, 1.0)
    q = simulate(swing, np.repeat(theta[None], 3, 0), np.arange(3))
    lanes = tuple(
        replace(lane, position=q[:, k], start=(lane.start[0] + 0.009, lane.start[1] - 0.1))
        for k, lane in enumerate(swing.lanes)
    )
    wrong = theta * np.where(np.isin(PARAMETERS, ("damping", "coulomb")), 1.1, 1.0)
    found = started(replace(swing, lanes=lanes), wrong)
    assert np.abs([np.subtract(lane.start, s) for lane, s in zip(found.lanes, starts, strict=True)]).max() < 0.005
    driven = replace(swing, lanes=lanes, driven=True)
    assert started(driven, wrong) is driven and freed(driven, wrong) is driven


def test_a_free_start_takes_no_part_in_what_a_law_is_held_to() -> None:
    """Under the true law nothing is left, whatever the start was taken for; of a wrong law it leaves what no start
    explains."""
    theta, steps = vector({"inertia": 0.02, "damping": 4e-4, "coulomb": 1e-3, "lateral": 4e-3}), 1500
    blank = Lane("a", False, np.zeros(steps), 1.0, np.zeros(steps), (0.5, -1.5), np.zeros(steps), np.ones(steps))
    swing = Swing((blank,), 0.8, 0.0, {"inertia": 0.02}, False, 4e-3, 1.0)
    q = free_errors(swing, theta[None], np.array([0]))[:, 0]
    swing = replace(swing, lanes=(replace(blank, position=q, start=(0.504, -1.53)),))
    zero = vector({"inertia": 0.02, "damping": 4e-4, "coulomb": 1e-3})  # whose encoder's zero is 5 mrad off

    def left(law: np.ndarray) -> float:
        residual, _ = jacobian(started(swing, law), Task(("inertia",), law, (0,)), law)
        return float(np.sqrt(np.mean(residual**2)))

    fixed = free_errors(started(swing, zero), zero[None], np.array([0]))
    assert left(theta) < 1e-4 * np.sqrt(np.mean(fixed**2))
    assert left(zero) > 0.5 * np.sqrt(np.mean(fixed**2))


def test_recordings_left_out_whole_are_predicted_whole() -> None:
    """Of several recordings each is left out once, uncut; of one, neighbouring stretches of it."""
    size = 300
    blank = Lane("", False, np.zeros(size), 1.0, np.zeros(size), (0.0, 0.0), np.zeros(size), np.ones(size))
    cut = Swing(tuple(replace(blank, trial=n) for n in "abcde" for _ in range(3)), 1.0, 0.0, {"inertia": 1.0}, False)
    whole = replace(cut, lanes=cut.lanes[::3])
    test, folds = _folds(cut, list(cut.train()), whole)
    assert test is whole and sorted(i for _, left in folds for i in left) == list(range(5))
    for kept, left in folds:
        assert not {cut.lanes[i].trial for i in kept} & {whole.lanes[i].trial for i in left}
    one = replace(cut, lanes=cut.lanes[:3])
    test, folds = _folds(one, [0, 1, 2], replace(one, lanes=one.lanes[:1]))
    assert test is one and [left for _, left in folds] == [(0,), (1,), (2,)]


def test_recordings_are_left_out_one_by_one_while_they_are_few() -> None:
    """Nine: each alone, so no two of a kind together. Thirty: in ten parts."""
    size = 30
    blank = Lane("", False, np.zeros(size), 1.0, np.zeros(size), (0.0, 0.0), np.zeros(size), np.ones(size))
    for count in (9, 30):
        swing = Swing(tuple(replace(blank, trial=f"{k}") for k in range(count)), 1.0, 0.0, {"inertia": 1.0}, True)
        folds = _folds(swing, list(swing.train()))[1]
        assert len(folds) == min(count, 10) and {len(left) for _, left in folds} == {count // len(folds)}
        assert all(sorted((*kept, *left)) == list(range(count)) for kept, left in folds)


def test_a_term_of_one_recording_is_borne_out_in_every_part_of_it(tmp_path: Path) -> None:
    """Friction by load that is there all the time is; a load tied to a place that the first half alone was drawn to is
    not."""
    folder = bench(tmp_path / "s", 0.3, 0.01)
    text = (folder / "session.toml").read_text().split("[[trial]]")
    (folder / "session.toml").write_text("[[trial]]".join([text[0], text[1], text[-1]]))
    table = np.loadtxt(folder / "log/0.csv", delimiter=",", skiprows=1)
    half = len(table) // 2
    table[:half, 2] += 1.4 * np.exp(-(((table[:half, 1] - 0.1) / 0.05) ** 2))
    np.savetxt(folder / "log/0.csv", table, delimiter=",", header="time,position,torque", comments="", fmt="%.8g")
    rig = load_rig(read_session(folder))
    fit = trusted_fit(rig)[0]
    problem = pose(fit)
    assert np.all(np.sum(splits(problem), 0) == 2)  # once in halves, once in thirds
    parts = normal(problem, ())
    known = {c.key: c for c in candidates(rig, fit, "hinge")}
    planted = Term(known[f"load_dependent_friction/{TURNING}@hinge"], {"form": 0.0, "reach": 0.1})
    drawn = score(problem, (), known["detent_load@hinge"], parts)
    assert borne_out(problem, ((), parts), ((planted,), normal(problem, (planted,))))
    assert not borne_out(problem, ((), parts), ((drawn.term,), drawn.parts))


@pytest.mark.parametrize(("helps", "names"), [(True, ["stribeck_friction", "command_delay"]), (False, [])])
def test_what_one_effect_hides_is_sought_beside_another(
    monkeypatch: pytest.MonkeyPatch, helps: bool, names: list[str]
) -> None:
    """Friction that gains in two recordings and costs in the others, as long as a late drive is not known: both or
    none."""
    count, blocks = 8, 8 * PARTS
    stage = SimpleNamespace(
        lanes=[SimpleNamespace(trial=f"run_{k}") for k in range(count)], driven=True, train=lambda: np.arange(count)
    )
    fitted = Fitted(np.zeros(len(PARAMETERS)), 1.0, 1, 3)
    better = replace(fitted, cost=0.5)
    alone = np.where(np.arange(blocks) < 2 * PARTS, 0.1, 1.05)

    def two_rounds(stages, taken, current, test, folds, without):
        rival = swing_compete._Rival(
            Variant("command_delay" if taken else "stribeck_friction", "", {}),
            better,
            np.full(blocks, 0.2) if taken and helps else alone,
        )
        return fitted, np.ones(blocks), [rival] if len(taken) < 2 else []

    monkeypatch.setattr(swing_compete, "_round", two_rounds)
    monkeypatch.setattr(swing_compete, "freed", lambda swing, theta: swing)
    monkeypatch.setattr(swing_compete, "swings_free", lambda swing: False)
    monkeypatch.setattr(swing_compete, "_exchanged", lambda stages, taken, fit: (taken, fit))
    monkeypatch.setattr(
        swing_compete,
        "_folds",
        lambda swing, train, whole: (swing, [(tuple(i for i in range(count) if i != k), (k,)) for k in range(count)]),
    )
    taken = swing_compete.compete_swing([stage], fitted)
    assert [v.effect for v, _ in taken] == names and [r.variant.effect for _, r in taken] == names


@pytest.mark.parametrize(("error", "names"), [(3.0, ["stribeck_friction"]), (1.0, [])])
def test_a_fit_within_the_noise_is_held_to_what_it_predicts(
    monkeypatch: pytest.MonkeyPatch, error: float, names: list[str]
) -> None:
    """A law that is wrong fits short stretches to within the noise of 2; only what it predicts to within it, too, is
    left at that."""
    count = 8
    stage = SimpleNamespace(
        lanes=[SimpleNamespace(trial=f"run_{k}") for k in range(count)], driven=True, train=lambda: np.arange(count)
    )
    fitted = Fitted(np.zeros(len(PARAMETERS)), 1.0, 1, 3)

    def one_round(stages, taken, current, test, folds, without):
        rival = swing_compete._Rival(
            Variant("stribeck_friction", "", {}), replace(fitted, cost=0.5), np.full(count * PARTS, 0.2 * error)
        )
        return fitted, np.full(count * PARTS, error), [] if taken else [rival]

    monkeypatch.setattr(swing_compete, "_round", one_round)
    monkeypatch.setattr(swing_compete, "freed", lambda swing, theta: swing)
    monkeypatch.setattr(swing_compete, "swings_free", lambda swing: False)
    monkeypatch.setattr(swing_compete, "_exchanged", lambda stages, taken, fit: (taken, fit))
    monkeypatch.setattr(
        swing_compete,
        "_folds",
        lambda swing, train, whole: (swing, [(tuple(i for i in range(count) if i != k), (k,)) for k in range(count)]),
    )
    assert [v.effect for v, _ in swing_compete.compete_swing([stage], fitted, floor=2.0)] == names


@pytest.mark.parametrize(("cost", "name"), [(1.001, "lateral"), (1.5, "both")])
def test_what_made_up_for_a_later_effect_leaves_the_variant(
    monkeypatch: pytest.MonkeyPatch, cost: float, name: str
) -> None:
    """A variant with a parameter less takes the place of one that fits hardly better beside the later effect, not of
    one that fits better."""
    both, lateral = (
        Variant("gravity_load", "both", {"lateral": 0.0, "offset": 0.0}),
        Variant("gravity_load", "lateral", {"lateral": 0.0}),
    )
    taken = both, Variant("stribeck_friction", "", {"static_excess": 0.0})
    theta = np.zeros(len(PARAMETERS))
    monkeypatch.setattr(swing_compete, "variants", lambda swing: (both, lateral))
    monkeypatch.setattr(
        swing_compete, "asked", lambda swing, some: ("inertia", *dict.fromkeys(n for v in some for n in v.start))
    )
    monkeypatch.setattr(
        swing_compete,
        "fit_stages",
        lambda stages, tasks, most: [Fitted(np.ones(len(PARAMETERS)), cost, 1, len(t.free)) for t in tasks],
    )
    kept, _ = swing_compete._exchanged([SimpleNamespace(train=lambda: np.arange(16))], taken, Fitted(theta, 1.0, 1, 4))
    assert [v.name for v in kept] == [name, ""]
