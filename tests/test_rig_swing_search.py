"""The search among simulated swings: what it is held to, and what stands in the end."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_model.rig.swing import compete as swing_compete
from hand_model.rig.swing.build import ENOUGH_STEPS, thinned
from hand_model.rig.swing.compete import PARTS, Variant, _folds, fit_stages
from hand_model.rig.swing.diagnose import _figures, _searched, _standing, _starts
from hand_model.rig.swing.fit import Fitted, Task
from hand_model.rig.swing.simulation import INDEX, PARAMETERS, Lane, Swing, simulate, vector
from hand_model.rig.swing.variants import asked, begun, variants


def link_of(error: float, stayed: float | None = None) -> SimpleNamespace:
    """A model with that error, and that of the recordings that its simulation does not leave."""
    return SimpleNamespace(error=error, stayed=error if stayed is None else stayed)


def test_effects_that_help_only_together_stand_together() -> None:
    """An effect that makes the held-out error worse before a later one comes stands where all are worse without it; one
    that they do without is withdrawn, and one that helps last comes last."""
    error = {"": 10.0, "a": 5.0, "ab": 6.0, "abc": 1.0, "ac": 4.9}
    helpers = {"": 10.0, "a": 5.0, "ab": 6.0, "abc": 1.0, "ac": 2.0}
    useless = {"": 10.0, "a": 5.0, "ab": 6.0, "abc": 2.0, "ac": 2.0}
    for table, order, gone in ((error, "abc", []), (helpers, "acb", []), (useless, "ac", ["b"])):

        def chain(some: list, table: dict = table) -> list[SimpleNamespace]:
            keys = ["".join(v.key for v, _ in some[:k]) for k in range(len(some) + 1)]
            return [link_of(table[key]) for key in keys]

        kept, links, rejected = _standing([(SimpleNamespace(key=k), None) for k in "abc"], chain)
        assert "".join(v.key for v, _ in kept) == order
        assert [r["effect"] for r in rejected] == gone
        assert links[-1].error == min(table.values())


@pytest.mark.parametrize(("left", "names"), [(0.3, "ab"), (0.4, "a")])
def test_what_takes_most_of_what_is_left_stands_however_little_that_is(left: float, names: str) -> None:
    """Less than half of one percent of the declared model's squared error: more than half of what an earlier effect
    leaves."""
    table = {"": 10.0, "a": 0.5, "ab": left, "b": 9.9}

    def chain(some: list) -> list[SimpleNamespace]:
        return [link_of(table["".join(v.key for v, _ in some[:k])]) for k in range(len(some) + 1)]

    kept, _, _ = _standing([(SimpleNamespace(key=k), None) for k in "ab"], chain)
    assert "".join(v.key for v, _ in kept) == names


@pytest.mark.parametrize(("stayed", "names"), [(1.0, "ab"), (10.0, "a")])
def test_how_far_off_a_simulation_is_that_has_left_a_recording_says_nothing(stayed: float, names: str) -> None:
    def chain(some: list) -> list[SimpleNamespace]:
        keys = ["".join(v.key for v, _ in some[:k]) for k in range(len(some) + 1)]
        return [link_of(table[key], stayed if not key else None) for key in keys]

    table = {"": 10.0, "a": 0.5, "ab": 0.4, "b": 9.9}
    kept, _, _ = _standing([(SimpleNamespace(key=k), None) for k in "ab"], chain)
    assert "".join(v.key for v, _ in kept) == names


def test_an_effect_whose_size_cannot_be_told_leaves_its_place_to_the_next() -> None:
    """The last of the first search goes, the search goes on without it, and what it finds stands."""
    a, b, c = (SimpleNamespace(key=k, effect=k, start={k: 0.0}) for k in "abc")
    asked = []

    def search(kept, without):
        asked.append(([v.key for v, _ in kept], set(without)))
        second = c if "b" in without else b
        return [(a, SimpleNamespace(taken=(a,))), (second, SimpleNamespace(taken=(a, second)))]

    def chain(some):
        return [link_of(1.0 / (k + 1)) for k in range(len(some) + 1)]

    def ends(link):
        return {"a": (0.5, 1.5), "b": (-1.0, 1.0), "c": (0.1, 0.2)}

    def links(sets):
        return [link_of(1.0 / (len(some) + 1)) for some in sets]

    kept, _, _, rejected = _searched(search, chain, ends, links)
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
            return [link_of(table["".join(v.key for v, _ in some)]) for some in sets]

        def chain(some: list, links: Any = links) -> list[SimpleNamespace]:
            return links([some[:k] for k in range(len(some) + 1)])

        ends = {k: (0.5, 1.5) for k in ("a1", "a2", "b")}
        kept, link, _, _ = _searched(lambda kept, without: found, chain, lambda _, ends=ends: ends, links)
        assert [v.key for v, _ in kept] == stands
        assert _figures(kept, link, links)[:2] == [1.0, 0.4]


def test_a_form_that_predicts_worse_than_the_declared_model_leaves_its_place_to_another() -> None:
    """What the training recordings prefer may predict nothing of those held out: then that form is not asked again, and
    another of the effect may stand."""
    first, second = (SimpleNamespace(key=f"a/{k}", effect="a", start={k: 0.0}) for k in "xy")

    def search(kept: list, without: frozenset[str]) -> list:
        asked.append(set(without))
        form = second if first.key in without else first
        return [(form, SimpleNamespace(taken=(form,)))]

    def links(sets: list) -> list[SimpleNamespace]:
        return [link_of(table["".join(v.key for v, _ in some)]) for some in sets]

    for error, stands in ((0.5, ["a/y"]), (1.2, [])):
        asked, table = [], {"": 1.0, "a/x": 1.07, "a/y": error}
        ends = {"x": (0.5, 1.5), "y": (0.5, 1.5)}
        kept, chain, _, rejected = _searched(
            search, lambda some: links([some[:k] for k in range(len(some) + 1)]), lambda _, ends=ends: ends, links
        )
        assert [v.key for v, _ in kept] == stands and asked == [set(), {"a/x"}]
        assert chain[-1].error == min(1.0, error)
        assert {r["effect"] for r in rejected} == {"a/x", "a/y"} - set(stands)


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


@pytest.mark.parametrize("planted", [pytest.param(True, marks=pytest.mark.slow), False])
def test_what_one_effect_hides_is_sought_beside_another(monkeypatch: pytest.MonkeyPatch, planted: bool) -> None:
    """A drive that sags and friction that rises at low speed, neither of which is taken alone: both, or none."""
    line = {"inertia": 0.02, "gain": 0.19, "back_emf": 0.28, "damping": 0.02, "coulomb": 0.06}
    more = {"sag": 0.2, "static_excess": 0.08, "stribeck_speed": 0.9} if planted else {}
    t, random = np.arange(0, 3, 4e-3), np.random.default_rng(0)
    volts = [4 * np.sin(2.1 * t + k) + 3 * np.sin(4.7 * t + 2 * k) for k in range(6)]
    none, seen = np.zeros(len(t)), np.ones(len(t))
    lanes = tuple(Lane(f"run_{k}", False, u, 1.0, none, (0.0, 0.0), none, seen) for k, u in enumerate(volts))
    blank = Swing(lanes, 1.0, 0.0, line, True, 4e-3)
    q = simulate(blank, np.repeat(vector({**line, **more})[None], 6, 0), np.arange(6))
    q += 1e-3 * random.standard_normal(q.shape)
    swing = replace(blank, lanes=tuple(replace(lane, position=q[:, k]) for k, lane in enumerate(lanes)))
    judged = swing_compete._judged

    def pairs_alone(current, none, rivals, *more):
        return judged(current, none, rivals, *more) if all(" and " in r.variant.effect for r in rivals) else None

    monkeypatch.setattr(swing_compete, "_judged", pairs_alone)
    declared = fit_stages([swing], [Task(tuple(line), vector(line), ())], 12)[0]
    taken = swing_compete.compete_swing([swing], declared, 1e-4)
    assert {v.effect for v, _ in taken} == ({"drive_sag", "stribeck_friction"} if planted else set())
    assert all([v.key] == [key for key, _ in r.rivals] for v, r in taken[:2])
    assert [r.variant for _, r in taken] == [v for v, _ in taken] and [len(r.taken) for _, r in taken] == [1, 2][
        : len(taken)
    ]


@pytest.mark.slow
def test_a_second_effect_is_sought_beside_other_forms_of_the_first() -> None:
    """Friction by the load of the gear and a drive that sags: with the form of friction that alone makes up for the sag,
    the sag is sought beside the true one."""
    line = {"inertia": 0.017, "gain": 0.24, "back_emf": 0.21, "damping": 0.018, "coulomb": 0.034}
    t, random = np.arange(0, 4, 4e-3), np.random.default_rng(0)
    volts = [3 * np.sin(2.1 * t + k) + 2.5 * np.sin(4.7 * t + 2 * k) for k in range(6)]
    none, seen = np.zeros(len(t)), np.ones(len(t))
    lanes = tuple(Lane(f"run_{k}", False, u, 1.0, none, (0.0, 0.0), none, seen) for k, u in enumerate(volts))
    blank = Swing(lanes, 0.7, 0.0, line, True, 4e-3)
    q = simulate(blank, np.repeat(vector({**line, "load_gear": 0.08, "sag": 0.12})[None], 6, 0), np.arange(6))
    q += 1e-3 * random.standard_normal(q.shape)
    swing = replace(blank, lanes=tuple(replace(lane, position=q[:, k]) for k, lane in enumerate(lanes)))
    squared = next(v for v in variants(swing) if v.name == "load squared, low speed")
    start = begun(vector(line), squared)
    current = fit_stages([swing], [Task(asked(swing, (squared,)), start, (), True)], 12)[0]
    test, folds = _folds(swing, list(swing.train()))
    rivals = swing_compete._otherwise([swing], squared, current, test, folds, frozenset())
    best = min(rivals, key=lambda r: float(r.error.sum()))
    assert best.variant.key == "drive_sag" and best.fit.theta[INDEX["sag"]] == pytest.approx(0.12, rel=0.1)
    assert [v.effect for v in best.instead or ()] == ["load_dependent_friction"] and best.instead != (squared,)
    assert best.fit.cost < 0.5 * current.cost
    without = swing_compete._otherwise([swing], squared, current, test, folds, frozenset({"drive_sag"}))
    assert all(r.variant.effect != "drive_sag" for r in without)


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
    monkeypatch.setattr(swing_compete, "_otherwise", lambda *_: [])
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
