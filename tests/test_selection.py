"""Selection of effects: what stands beside a small term, and instead of a large one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnose import drive, planted
from test_kinematic_stations import joint

from hand_model.diagnose.name import candidates, kept_out, search, selection
from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.judgement import _as_likely
from hand_model.diagnose.name.naming import Named, Rival
from hand_model.diagnose.name.selection import name_effects
from hand_model.diagnose.name.shapes import possible
from hand_model.diagnose.name.term import Term
from hand_model.effects import catalogue, effect, outsiders

LEFT = {0: 2000.0, 1: 60.0}  # what a fit without that term leaves more


@pytest.mark.parametrize(("rival", "together", "told"), [(1010.0, 995.0, "large"), (1040.0, 1000.0, "rival")])
def test_small_terms_stand_for_a_rival_only_if_it_explains_more_than_all_of_them_together(
    monkeypatch: pytest.MonkeyPatch, rival: float, together: float, told: str
) -> None:
    """The large term brings 1000 and the small one 25 beside it; a rival in the place of both brings as much as is
    given, and beside the small one `together`."""
    terms = tuple(SimpleNamespace(effect=SimpleNamespace(name=name)) for name in ("large", "small"))
    fit = SimpleNamespace(terms=terms, rss=1000.0, amplitudes=({}, {}))
    balance = SimpleNamespace(
        fit=lambda some: SimpleNamespace(rss=fit.rss + sum(v for i, v in LEFT.items() if terms[i] not in some))
    )

    def in_place(pair, effects, fit, which, others, tangents) -> list[Rival]:
        if which == 1:
            return [Rival("small", 25.0, fit)]
        other = together if 1 in others else rival
        return sorted([Rival("large", 1000.0, fit), Rival("rival", other, fit)], key=lambda r: -r.evidence)

    monkeypatch.setattr(selection, "_in_place", in_place)
    monkeypatch.setattr(selection, "Tangents", SimpleNamespace(of=lambda *_: None))
    monkeypatch.setattr(selection, "evidence", lambda balance, fit, rest, which, scale: {0: 1000.0, 1: 25.0}[which])
    monkeypatch.setattr(selection, "scale_of", lambda *_: 1.0)
    monkeypatch.setattr(selection, "_size", lambda *_: 1.0)
    found = selection._findings(SimpleNamespace(state=balance), balance, (), fit)
    assert [f.term.effect.name for f in found] == ["large", "small"]
    assert found[0].rivals[0].name == told
    assert (found[0].probability > 0.99) == (told == "large")


@pytest.mark.parametrize(
    ("other", "kept_out", "exchanged"),
    [(30.0, 0.0, True), (25.5, 0.0, False), (24.0, 1.5, True), (24.0, 0.5, False), (30.0, -6.0, False)],
)
def test_what_turns_out_likelier_in_the_place_of_a_term_takes_it(
    monkeypatch: pytest.MonkeyPatch, other: float, kept_out: float, exchanged: bool
) -> None:
    """By more than the one unit that chance may make, with all else refitted, or with what recordings kept out say."""
    one, two, three = (SimpleNamespace(effect=SimpleNamespace(name=name)) for name in ("one", "two", "three"))
    fit = SimpleNamespace(terms=(one, two))
    likelier = SimpleNamespace(terms=(one, three))
    balance = SimpleNamespace(fit=lambda terms: SimpleNamespace(terms=terms))
    found = [
        Named(one, {}, (Rival("one", 90.0, fit),), 0.8, 1.0, 1.0),
        Named(two, {}, (Rival("three", 30.0, likelier, kept_out), Rival("two", 25.0, fit)), 0.2, 1, 0),
    ]
    monkeypatch.setattr(candidates, "refit", lambda balance, fit: fit)
    monkeypatch.setattr(candidates, "scale_of", lambda *_: 1.0)
    monkeypatch.setattr(selection, "allowed", lambda *_: True)
    monkeypatch.setattr(
        candidates, "evidence", lambda balance, fit, rest, *_, **__: other if three in fit.terms else 25.0
    )
    monkeypatch.setattr(selection, "settle", lambda pair, effects, terms: SimpleNamespace(terms=terms))
    better = selection._outdone(SimpleNamespace(state=balance), (), fit, found)
    assert (better is not None and better.terms == (one, three)) == exchanged


@pytest.mark.parametrize(
    ("behind", "whole", "foretold", "taken"),
    [
        (7.0, 5.0, 0.0, True),
        (7.0, 1.0, 0.0, False),
        (7.0, 1.0, 3.0, True),
        (7.0, -9.0, 30.0, False),
        (12.0, 9.0, 0.0, False),
    ],
)
def test_a_rival_whose_whole_is_likelier_starts_another_search(
    monkeypatch: pytest.MonkeyPatch, behind: float, whole: float, foretold: float, taken: bool
) -> None:
    """It stays where it starts until all else is found beside it; recordings kept out say which of two alike."""
    kinds = {name: SimpleNamespace(name=name, of_the_hand=True) for name in ("one", "two", "three", "four")}
    one, two, three, four = (SimpleNamespace(effect=kind) for kind in kinds.values())
    fit = SimpleNamespace(terms=(one, two), rss=0.0, size=2)
    other = SimpleNamespace(terms=(three, four), rss=-2 * whole, size=2)
    found = [
        Named(
            one,
            {},
            (Rival("one", 50.0, None), Rival("three", 50.0 - behind, SimpleNamespace(terms=(three,)))),
            0.8,
            1,
            1,
        ),
        Named(two, {}, (Rival("two", 20.0, None),), 0.2, 1, 1),
    ]
    balance = SimpleNamespace(inflation=1.0, train=np.array([True, False]))

    def beside(pair, effects, progress, start, held):
        assert start == (three,) and held == "three"
        return other, {}, []

    monkeypatch.setattr(search, "search", beside)
    monkeypatch.setattr(search, "twice", lambda *_: False)
    monkeypatch.setattr(search, "possible", lambda *_: True)
    monkeypatch.setattr(search, "oddity", lambda *_: 0.0)
    monkeypatch.setattr(search, "parameter_price", lambda *_: 5.0)
    monkeypatch.setattr(search, "scale_of", lambda *_: 1.0)
    monkeypatch.setattr(search, "foretold", lambda balance, fits: [foretold, 0.0])
    pair = SimpleNamespace(state=balance)
    better = search.deeper(pair, balance, (), None, fit, found)
    assert (better is other) == taken
    assert search.deeper(pair, balance, (), None, fit, found[:1]) is None  # nothing stands beside it


def rivals(balance: Balance, *told: tuple[str, dict[str, float], float]) -> list[Rival]:
    """Effects fitted to the training recordings, with the evidence that they are told to have there."""
    return [Rival(name, brought, balance.fit((Term(effect(name), shape),))) for name, shape, brought in told]


DRAG, BENT = ("quadratic_damping", {}), ("nonlinear_spring", {"form": 0.0})


@pytest.mark.parametrize(("ahead", "asked"), [(1.0, True), (2.9, True), (3.1, False)])
def test_recordings_kept_out_tell_apart_what_training_cannot(ahead: float, asked: bool) -> None:
    """Of a spring that seems likelier than the drag that is there; what training tells they are not asked of."""
    balance = Balance(drive(3, add=planted("quadratic_damping", {}, [0.002])))
    told = rivals(balance, (*BENT, 90.0 + ahead), (*DRAG, 90.0))
    heard = kept_out.with_kept_out(balance, told)
    assert (heard[0].name == "quadratic_damping") == asked
    assert heard[0].kept_out == 0.0 and heard[0].evidence == (90.0 if asked else 90.0 + ahead)
    assert heard[1].evidence == pytest.approx(told[0 if asked else 1].evidence + heard[1].kept_out)
    assert kept_out.with_kept_out(balance.learning(), told) == told  # there is none


def test_recordings_kept_out_say_nothing_of_what_one_recording_had() -> None:
    """An obstacle in the last training recording that a bent spring cannot be, whatever the next recording has."""
    balance = Balance(drive(3, add=planted("quadratic_damping", {}, [0.002])))
    touched = {"trial": 1.0, "form": 0.0, "since": 0.0, "until": 1.0, "begin": 60.0}
    told = rivals(balance, ("external_contact", touched, 91.0), (*DRAG, 90.0))
    assert kept_out.with_kept_out(balance, told) == told


def test_a_give_that_a_late_segment_makes_large_takes_another_form() -> None:
    """What yields to drag alone and a lag are one column: each would make the other as large as it likes."""
    states = joint(4, add=lambda t, x, v: -0.03 * (15.0 + 0.2 * x + 35.0 * np.tanh(v) + 0.15 * v), noise=0.15)
    late = tuple(
        replace(
            s,
            effort=s.effort - 0.03 * s.slope * s.velocity,
            declared=s.declared[:, :4],
            declared_names=s.declared_names[:4],
        )
        for s in states
    )
    naming = name_effects(late, [*catalogue("linkage"), *outsiders("linkage")])
    names = [t.effect.name for t in naming.fit.terms]
    assert "linkage_compliance" in names
    assert all(possible(naming.balance, naming.fit, which) for which in range(len(names)))


def test_a_hearing_without_what_fell_explains_as_much_as_the_names_that_did_not_fall() -> None:
    """A spring that relaxes beside a tight spot that recordings kept out do not bear out: without the spot a search may
    end with a hysteresis in the spring's place, which explains less."""
    spring = Term(effect("viscoelastic_spring"), {"relaxation_time": 1.0})
    spot = Term(effect("position_dependent_friction"), {"centre": 45.0, "width": 7.0})
    slip = Term(effect("elastoplastic_hysteresis"), {"form": 0.0, "reach": 15.0})
    balance = Balance(drive(5, planted(spring.effect.name, dict(spring.shape), [0.2])))

    def named(*terms: Term) -> SimpleNamespace:
        return SimpleNamespace(balance=balance, fit=balance.fit(terms))

    fallen = {spot.effect.name}
    assert not _as_likely(named(slip), named(spring, spot), fallen)
    assert _as_likely(named(spring), named(slip, spot), fallen)
    assert _as_likely(named(spring, slip), named(spring, spot), fallen)


@pytest.mark.parametrize(
    ("name", "shape", "amplitude"),
    [
        ("stribeck_friction", {"form": 0.0, "stribeck_speed": 12.0}, [14.0]),
        ("detent_load", {"form": 0.0, "centre": 47.0, "width": 6.0}, [8.0]),
    ],
)
def test_candidates_that_cannot_pass_are_not_looked_at_closely_and_the_first_are_the_same(
    monkeypatch: pytest.MonkeyPatch, name, shape, amplitude
) -> None:
    balance = Balance(drive(7, planted(name, shape, amplitude), trials=3)).learning()
    effects, polish, looked_at = tuple(catalogue("drive")), candidates.polish, []
    pair = SimpleNamespace(
        state=balance, map=lambda function, items, *rest, costs=None: [function(balance, i, *rest) for i in items]
    )

    def counted(balance, fit, which):
        looked_at.append(fit.terms[which].effect.name)
        return polish(balance, fit, which)

    monkeypatch.setattr(candidates, "polish", counted)
    soon = candidates.rank(pair, effects, (), balance.fit())
    few = len(looked_at)
    monkeypatch.setattr(candidates, "FINER", 1e9)
    thorough = candidates.rank(pair, effects, (), balance.fit())
    assert candidates.FIRST <= few < len(looked_at) - few <= 6
    assert soon[0].name == thorough[0].name == name
    assert soon[0].evidence == pytest.approx(thorough[0].evidence, rel=1e-9)
    assert {r.name for r in soon} == {r.name for r in thorough}


SIX = (
    "stribeck_friction",
    "quadratic_damping",
    "position_dependent_friction",
    "detent_load",
    "torque_ripple",
    "end_stop_contact",
)


@pytest.mark.parametrize(("hopeless", "named"), [(False, 6), (True, 5)])
def test_more_than_five_effects_are_looked_for_where_five_explain_most(
    monkeypatch: pytest.MonkeyPatch, hopeless: bool, named: int
) -> None:
    def six(s) -> np.ndarray:
        x, v, way = s.position, s.velocity, np.sign(s.velocity)
        rubs = 14 * np.exp(-np.abs(v) / 20) + 6 * np.exp(-0.5 * ((x - 60) / 7) ** 2)
        return (
            way * (rubs + 3e-3 * v**2)
            + 9 * np.exp(-0.5 * ((x - 30) / 6) ** 2)
            + 4 * np.sin(2 * np.pi * x / 11)
            + 0.8 * np.maximum(x - 85, 0.0)
        )

    for module in (search, selection):
        monkeypatch.setattr(module, "hopeless", lambda balance, fit: hopeless and len(fit.terms) >= 5)
    naming = name_effects(drive(4, six, noise=3.0, trials=3), [effect(name) for name in SIX])
    found = {f.term.effect.name for f in naming.found}
    assert len(found) == named and found <= set(SIX)


def test_what_recordings_kept_out_would_exchange_is_held_to_all_other_terms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the large terms alone another effect may stand for the small ones as well, and be as likely in training."""
    large, small = (SimpleNamespace(effect=SimpleNamespace(name=name)) for name in ("ripple", "tight_spot"))
    fit = SimpleNamespace(terms=(large, small), rss=0.0, amplitudes=({}, {}))
    without = {("tight_spot",): 100.0, ("ripple",): 1.0, (): 200.0}

    balance = SimpleNamespace(fit=lambda some: SimpleNamespace(rss=without[tuple(t.effect.name for t in some)]))

    def in_place(pair, effects, fit, which, others, tangents):
        if which == 1:
            return [Rival("tight_spot", 5.0, fit)]
        alone, beside_all = [("ripple", 10.0), ("hysteresis", 9.9)], [("ripple", 20.0), ("hysteresis", 1.0)]
        return [Rival(name, value, fit) for name, value in (beside_all if others else alone)]

    def kept_out(balance, rivals):
        told = [Rival(r.name, r.evidence - 5.0 * (r.name == "ripple"), r.fit) for r in rivals]
        return sorted(told, key=lambda r: -r.evidence)

    monkeypatch.setattr(selection, "_in_place", in_place)
    monkeypatch.setattr(selection, "with_kept_out", kept_out)
    monkeypatch.setattr(selection, "_size", lambda *_: 1.0)
    monkeypatch.setattr(selection, "Tangents", SimpleNamespace(of=lambda *_: None))
    found = selection._findings(SimpleNamespace(state=balance), None, (), fit)
    assert found[0].rivals[0].name == "ripple" and found[0].probability > 0.99
