"""Search for shapes: columns of a grid, projected, and the weight of delayed channels."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from test_diagnose import drive, planted

from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.grid import stacked
from hand_model.diagnose.name.shapes import error_beside, scan
from hand_model.diagnose.name.term import Term
from hand_model.diagnose.name.wander import Wander
from hand_model.effects import effect


@pytest.mark.parametrize(
    ("name", "shape", "amplitude"),
    [
        ("stribeck_friction", {"form": 0.0, "stribeck_speed": 20.0}, [20.0]),
        ("detent_load", {"form": 0.0, "centre": 50.0, "width": 6.0}, [12.0]),
        ("nonlinear_spring", {}, [0.004, 0.0]),
    ],
)
def test_a_scan_finds_the_shape_of_which_a_refit_is_best(name, shape, amplitude) -> None:
    balance = Balance(drive(7, planted(name, shape, amplitude), trials=3))
    kind = effect(name)
    best = min(balance.fit((Term(kind, s),)).rss for s in balance.grid(kind).shapes)
    assert scan(balance, kind, ()).rss == pytest.approx(best, rel=1e-9)
    assert scan(balance, kind, ()).rss == pytest.approx(best, rel=1e-9)  # from kept columns


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("current_channel_delay", {"form": 0.0, "delay": 0.03}),
        ("current_saturation", {"limit": 50.0}),
        ("stribeck_friction", {"form": 0.0, "stribeck_speed": 20.0}),
    ],
)
def test_what_is_learned_is_the_same_without_the_recordings_that_take_no_part(name, shape) -> None:
    states = drive(7, planted("detent_load", {"form": 0.0, "centre": 50.0, "width": 6.0}, [12.0]), trials=4)
    balance = Balance(states)
    balance = balance.wandering(Wander(balance.stroke, 2.0, 9.0, np.inf))
    terms = (Term(effect("detent_load"), {"form": 0.0, "centre": 50.0, "width": 6.0}), Term(effect(name), shape))
    whole, learned = balance.fit(terms), balance.learning().fit(terms)
    assert len(learned.prediction) == balance.train.sum() < len(whole.prediction)
    np.testing.assert_allclose(whole.prediction[balance.train], learned.prediction, rtol=1e-9)
    assert learned.rss == pytest.approx(whole.rss, rel=1e-9) and learned.declared == pytest.approx(
        whole.declared, rel=1e-9
    )
    assert balance.learning() is balance.learning() and balance.learning().learning() is balance.learning()
    again = pickle.loads(pickle.dumps(balance))
    assert again.fit(terms).rss == whole.rss and len(pickle.dumps(balance)) < 2 * len(pickle.dumps(Balance(states)))


@pytest.mark.parametrize("restless", [False, True])
@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("current_channel_delay", {"form": 0.0, "delay": 0.03}),
        ("current_saturation", {"limit": 50.0}),
        ("presliding_friction", {"bristle_length": 1.5}),
        ("stribeck_friction", {"form": 0.0, "stribeck_speed": 20.0}),
    ],
)
def test_the_error_of_a_fit_is_known_sooner_than_the_fit(name, shape, restless) -> None:
    states = drive(7, planted("detent_load", {"form": 0.0, "centre": 50.0, "width": 6.0}, [12.0]), trials=4)
    balance = Balance(states)
    balance = balance.wandering(Wander(balance.stroke, 2.0, 9.0, np.inf) if restless else None)
    terms = (Term(effect("detent_load"), {"form": 0.0, "centre": 50.0, "width": 6.0}), Term(effect(name), shape))
    for one in (balance, balance.learning(), balance.settled()):
        assert one.error(terms) == pytest.approx(one.fit(terms).rss, rel=1e-9)


@pytest.mark.parametrize("trial", [0.0, 1.0, -2.0])
def test_an_obstacle_is_looked_for_along_its_own_recordings(trial) -> None:
    """Rows of the others add nothing: its error is that of whole fits, of all recordings and of those that learn."""
    balance = Balance(drive(7, planted("detent_load", {"form": 0.0, "centre": 50.0, "width": 6.0}, [12.0]), trials=4))
    balance = balance.wandering(Wander(balance.stroke, 2.0, 9.0, np.inf))
    kind = effect("external_contact")
    others = (Term(effect("stribeck_friction"), {"form": 0.0, "stribeck_speed": 20.0}),)
    shape = {"trial": trial, "form": 0.0, "since": 0.2, "until": 0.8, "begin": 40.0}
    for one in (balance, balance.learning()):
        columns, rows = one.acting_columns(kind, shape)
        whole = one.columns(kind, shape)
        assert (rows is None) == (len(columns) == len(whole))
        rest = np.delete(whole, np.arange(len(whole))[rows or slice(None)], axis=0)
        assert not rest.any() and not whole[:, one.own_columns(kind).stop :].any()
        wanted = one.fit((*others, Term(kind, shape))).rss
        assert error_beside(one, others, kind)(shape) == pytest.approx(wanted, rel=1e-9)


def test_beside_a_term_that_clips_kept_columns_serve() -> None:
    """What is clipped is left out of them: the starts are those of columns made anew."""
    balance = Balance(drive(7, planted("detent_load", {"form": 0.0, "centre": 50.0, "width": 6.0}, [12.0]), trials=3))
    kind, clips = effect("detent_load"), (Term(effect("current_saturation"), {"limit": 60.0}),)
    assert 0 < (~balance.unclipped(clips)).mean() < 0.5
    balance.apart(())
    scan(balance, kind, ())  # keeps the columns
    assert (kind, False) in balance._kept
    kept = scan(balance, kind, clips)
    anew = scan(Balance(balance.states), kind, clips)
    assert kept.terms == anew.terms and kept.rss == pytest.approx(anew.rss, rel=1e-9)


def test_sparse_and_dense_columns_have_the_same_products() -> None:
    rng = np.random.default_rng(0)
    columns = [np.where(np.arange(200)[:, None] // 10 == k, rng.normal(size=(200, 2)), 0.0) for k in range(20)]
    columns[3][:, 1] = 0.0
    other = rng.normal(size=(200, 3))
    whole = np.concatenate(columns, axis=1)
    acting = np.linalg.norm(whole, axis=0) > 0
    sparse = stacked([columns[:12], columns[12:]])
    assert not isinstance(sparse.matrix, np.ndarray)
    np.testing.assert_allclose(sparse.products(other), whole[:, acting].T @ other, atol=1e-12)
    np.testing.assert_array_equal(sparse.shape, np.repeat(np.arange(20), 2)[acting])
    for kept in (sparse, stacked([[whole[:, acting] + 1.0]])):
        inside = np.arange(200) > 15
        part, dense = kept.within(inside), kept.products(np.eye(200)) * inside
        np.testing.assert_allclose(part.products(other), dense @ other, atol=1e-12)
        np.testing.assert_allclose(part.length, np.linalg.norm(dense, axis=1), atol=1e-12)
    mine = np.flatnonzero(sparse.shape == 5)
    np.testing.assert_allclose(sparse.gram(mine), columns[5].T @ columns[5], atol=1e-12)


def resting(delay_s: float, seed: int) -> Balance:
    """A drive that rests between moves with a current that friction leaves free, its channel late by `delay_s`."""
    rng = np.random.default_rng(seed)
    out = []
    for state in drive(seed, trials=3):
        t = np.arange(1500) * 0.018
        phase = t % 2.0
        x = 50 + 40 * np.where((t // 2) % 2 < 1, 1, -1) * (np.clip(phase / 1.2, 0, 1) * 2 - 1)
        v = np.gradient(x, t)
        moving = np.abs(v) > 5
        declared = np.stack([np.zeros_like(v), v, np.sign(v) * moving, x, np.ones_like(v)], axis=-1)
        held = rng.uniform(-30, 30, 40)[(t // 2).astype(int)]
        true = np.where(moving, declared @ np.array([0.0, 0.15, 35.0, 0.22, 9.0]), held)
        shown = np.interp(t - delay_s, t, true) + rng.normal(0, 4, len(t))
        out.append(
            type(state)(
                state.trial,
                "index",
                t,
                x,
                v,
                np.zeros_like(v),
                np.where(moving, shown, np.nan),
                declared,
                extra={**{k: a[:1500] for k, a in state.extra.items()}, "sigma": np.where(moving, 0.0, 35.0)},
                declared_names=state.declared_names,
            )
        )
    return Balance(tuple(out))


@pytest.mark.parametrize("late_s", [0.036, 0.09])
def test_a_delay_is_likeliest_where_it_is_though_rest_is_unknown(late_s: float) -> None:
    balance, kind = resting(late_s, 3), effect("current_channel_delay")
    tried = np.arange(0.0, 0.145, 0.009)
    rss = [balance.fit((Term(kind, {"form": 0.0, "delay": d}),)).rss for d in tried]
    assert abs(tried[int(np.argmin(rss))] - late_s) < 0.0091


def test_ignorance_of_rest_is_no_gain_where_nothing_is_late() -> None:
    balance, kind = resting(0.0, 4), effect("current_channel_delay")
    for form in (0.0, 1.0):
        for delay in (0.018, 0.036, 0.072):
            assert balance.fit((Term(kind, {"form": form, "delay": delay}),)).rss > balance.fit().rss


def test_without_a_delay_weights_stay_and_wider_errors_cost() -> None:
    balance = resting(0.0, 5)
    assert balance.weights(()) is balance.weight
    assert balance.vagueness(balance.weight) == 0.0
    assert balance.vagueness(0.5 * balance.weight) == pytest.approx(
        2 * np.log(2) * balance.inflation * balance.train.sum()
    )


def test_a_candidate_that_is_always_dropped_again_ends_the_search(monkeypatch) -> None:
    from hand_model.diagnose.name import search

    balance = Balance(drive(7, planted("detent_load", {"form": 0.0, "centre": 50.0, "width": 6.0}, [12.0]), trials=3))
    kind = effect("torque_ripple")
    offered = balance.fit((Term(kind, {"period": 9.0}),))
    tried: list[str] = []

    def rank(*_arguments):
        tried.append(kind.name)
        assert len(tried) < 10
        return [search.Rival(kind.name, 50.0, offered)]

    monkeypatch.setattr(search, "rank", rank)
    monkeypatch.setattr(search, "settle", lambda *_arguments: balance.fit())
    fit, brought, _ = search.search(search.Pair(balance), (kind,), None)
    assert fit.terms == () and brought == {kind.name: 50.0}
