"""Encoder and linkage stations: planted effects are named with their size, healthy joints stay consistent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hand_model.diagnose.locate.decoupled import TRIFLE, pulls
from hand_model.diagnose.locate.excursions import with_excursions
from hand_model.diagnose.locate.swaps import swaps as swaps_found
from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.evidence import gain
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.selection import name_effects
from hand_model.diagnose.name.shapes import polish, scan
from hand_model.diagnose.name.station import Station, bring_together
from hand_model.effects import catalogue, effect, outsiders
from hand_model.effects.backlash import GRADUAL
from hand_model.effects.base import DriveState
from hand_model.effects.driven import driven, play, soft_play
from hand_model.effects.law import Moment
from hand_model.effects.path import dahl, lowpass
from hand_model.identify.chain import Chain, ChainData, Pose
from hand_model.identify.repair import Swap, repair_labels
from hand_model.session import Mocap

MAP = np.array([0.0, 62.0, 30.0, -12.0])  # deg over the share of the driver's range


def strokes(speeds: tuple[float, ...], rest_s: float = 0.5, rate_hz: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Position [0..100] of full strokes there and back at each speed, and its velocity, rests between."""
    velocity = [np.zeros(int(rest_s * rate_hz))]
    for speed in speeds:
        for way in (1, -1):
            velocity += [np.full(round(100 / speed * rate_hz), way * speed), np.zeros(int(rest_s * rate_hz))]
    v = np.concatenate(velocity)
    return np.clip(np.cumsum(v) / rate_hz, 0, 100), v


def joint(seed: int, move=None, add=None, noise: float = 0.6, drift: float = 0.0) -> tuple[DriveState, ...]:
    """Two recordings of an angle behind a map, the second for validation. move(x): what drives the map; add(t, x): on
    the angle."""
    rng = np.random.default_rng(seed)
    out = []
    for k, speeds in enumerate([(100.0, 45.0, 27.0, 70.0, 15.0), (45.0, 27.0, 70.0)]):
        x, v = strokes(speeds)
        t = np.arange(len(x)) / 100.0
        late = np.interp(t + drift * (t - t.mean()), t, x)
        u = (late if move is None else move(late)) / 100
        angle = np.polynomial.Polynomial(MAP)(u) + (0.0 if add is None else add(t, x, v))
        load = 15.0 + 0.2 * x + 35.0 * np.tanh(v) + 0.15 * v + rng.normal(0, 1.5, len(x))
        slope = np.polynomial.Polynomial(MAP).deriv()(x / 100) / 100
        offset = np.zeros((len(x), 2))
        offset[:, k] = slope * v
        declared = np.concatenate([np.stack([(x / 100) ** i for i in range(4)], axis=-1), offset], axis=1)
        extra = {
            "trial_index": np.full(len(x), float(k)),
            "scale": np.full(len(x), 100.0),
            "slope": slope,
            "load": load,
            "drag": 0.15 * v,
        }
        out.append(
            DriveState(
                f"log/{k}.csv",
                "index",
                t,
                x,
                v,
                0 * v,
                angle + rng.normal(0, noise, len(x)),
                declared,
                "%",
                "deg",
                extra,
                ("power_0", "power_1", "power_2", "power_3", "offset_0", "offset_1"),
                validate=k == 1,
            )
        )
    return with_excursions(out)


def named(states: tuple[DriveState, ...], station: str) -> dict[str, dict[str, float]]:
    naming = name_effects(states, catalogue(station))
    return {f.term.effect.name: {**f.term.shape, **f.amplitudes} for f in naming.found}


def test_play_follows_its_definition() -> None:
    t = np.linspace(0, 20, 4000)
    path = 30 * np.sin(t) + 12 * np.sin(2.7 * t + 1)
    gap, at, want = 3.0, path[0] + 1.5, []
    for x in path:
        at = min(max(at, x - gap / 2), x + gap / 2)
        want.append(at)
    np.testing.assert_allclose(play(path, gap, threshold=0.0), want, atol=1e-9)
    assert np.abs(soft_play(path, gap, 0.5) - path).max() <= 0.75 * gap + 1e-9


def test_changes_of_the_driver_follow_one_another() -> None:
    state = joint(0)[0]
    first = driven(state, lambda x: np.minimum(x, 60.0))
    both = driven(replace(state, declared=first), lambda x: np.maximum(x, 20.0))
    np.testing.assert_allclose(both[:, 2], (np.clip(state.position, 20, 60) / 100) ** 2)
    np.testing.assert_array_equal(both[:, 4:], state.declared[:, 4:])


@pytest.mark.parametrize("station", ["encoder", "linkage"])
def test_healthy_joints_are_consistent(station: str) -> None:
    for seed in range(5):
        assert name_effects(joint(seed), catalogue(station)).consistent


@pytest.mark.parametrize(("station", "name"), [("encoder", "drive_backlash"), ("linkage", "linkage_backlash")])
def test_lost_motion_at_what_follows_is_lost_motion_too(station: str, name: str) -> None:
    gap_deg = 2.4

    def lag(t, x, v):
        angle = np.polynomial.Polynomial(MAP)(x / 100)
        return play(angle, gap_deg) - angle

    found = named(joint(3, add=lag), station)
    assert set(found) == {name}
    slope = (np.polynomial.Polynomial(MAP)(1.0) - np.polynomial.Polynomial(MAP)(0.0)) / 100
    assert found[name]["gap"] * slope == pytest.approx(gap_deg, rel=0.1)


@pytest.mark.parametrize(("station", "name"), [("encoder", "drive_backlash"), ("linkage", "linkage_backlash")])
def test_lost_motion_is_named_with_its_full_width(station: str, name: str) -> None:
    found = named(joint(1, move=lambda x: play(x, 1.5)), station)
    assert list(found) == [name]
    assert found[name]["gap"] == pytest.approx(1.5, rel=0.1)


@pytest.mark.parametrize(("station", "name"), [("encoder", "series_elasticity"), ("linkage", "linkage_compliance")])
def test_give_that_grows_with_load_is_no_lost_motion(station: str, name: str) -> None:
    # While the drive rests the load falls, and what gives moves without it: lost motion does not.
    states = joint(2, add=lambda t, x, v: -0.03 * (15.0 + 0.2 * x + 35.0 * np.tanh(v) + 0.15 * v))
    found = named(states, station)
    assert list(found) == [name]


@pytest.mark.parametrize("lag_s", [0.1, 0.3])
def test_a_give_that_follows_its_load_late_is_no_play(lag_s: float) -> None:
    """A damper beside the spring (Kelvin-Voigt) rounds a reversal in time, not in travel."""

    def given(t, x, v):
        return lowpass(t, -0.03 * (15.0 + 0.2 * x + 35.0 * np.tanh(v) + 0.15 * v), lag_s)

    effects = [*catalogue("linkage"), *outsiders("linkage")]
    station = judged("markers", "index", "index", "distal", joint(2, add=given), effects)
    assert station.believed and [f.term.effect.name for f in station.kept] == ["linkage_compliance"]
    (figures,) = (station.parameters[station.naming.fit.terms.index(f.term)] for f in station.kept)
    assert figures["lag"]["value"] == pytest.approx(lag_s, rel=0.2)
    assert figures["compliance"]["value"] == pytest.approx(0.03, rel=0.2)


@pytest.mark.parametrize(("station", "name"), [("encoder", "series_elasticity"), ("linkage", "linkage_compliance")])
def test_a_give_that_stiffens_is_no_play(station: str, name: str) -> None:
    """As tendons and cables do: far from rest it hardly moves more, as a play does, near it a give."""

    def given(t, x, v):
        return -0.06 * 30.0 * np.tanh((15.0 + 0.2 * x + 35.0 * np.tanh(v) + 0.15 * v) / 30.0)

    station = judged("markers", "index", "index", "distal", joint(2, add=given), catalogue(station))
    assert station.believed and [f.term.effect.name for f in station.kept] == [name]
    (figures,) = (station.parameters[station.naming.fit.terms.index(f.term)] for f in station.kept)
    assert figures["stiff"]["value"] == pytest.approx(30.0, rel=0.2)
    assert figures["compliance"]["value"] == pytest.approx(0.06, rel=0.2)


@pytest.mark.parametrize(("beyond", "over"), [(30.0, 15.0), (46.0, 15.0), (65.0, 8.0)])
def test_a_finger_that_its_weight_tips_over_has_left_its_drive(beyond: float, over: float) -> None:
    """Neither an error that repeats along the range nor a play: it runs ahead beyond a place, whichever way it goes."""
    states = joint(2, add=lambda t, x, v: 4.0 * np.clip((x - beyond) / over, 0.0, 1.0))
    station = judged("encoder", "index", "index", "proximal", states, [*catalogue("encoder"), *outsiders("encoder")])
    assert station.believed and [f.term.effect.name for f in station.kept] == ["spring_decoupling"]
    (figures,) = (station.parameters[station.naming.fit.terms.index(f.term)] for f in station.kept)
    assert figures["lead"]["value"] == pytest.approx(4.0, rel=0.15)
    assert figures["beyond"]["value"] == pytest.approx(beyond, abs=2.0)


def test_the_law_of_a_late_give_is_its_column() -> None:
    (state, *_) = joint(2)
    shape, give = {"form": 3.0, "lag": 0.2}, effect("linkage_compliance")
    law = give.law({**shape, "compliance": 0.05})
    steps = np.r_[0.0, np.diff(state.time_s)]
    moments = zip(state.time_s, steps, state.extra["load"], strict=True)
    moved = [np.rad2deg(law(Moment(t, step, 0.0, 0.0, 0.0, 0.0, load, 0.0, 0.0))) for t, step, load in moments]
    assert moved == pytest.approx(
        0.05 * give.columns(state, shape)[:, 0], abs=0.02 * 0.05 * np.ptp(state.extra["load"])
    )


@pytest.mark.parametrize(
    ("friction", "drag", "kept"),
    [(6.0, 0.25, ["linkage_compliance"]), (17.5, 0.0, ["linkage_compliance"]), (0.0, 0.4, [])],
)
def test_what_gives_may_carry_another_share_of_the_drag_than_of_the_friction(
    friction: float, drag: float, kept: list[str]
) -> None:
    """A segment that is only late gives nothing."""
    states = joint(2, add=lambda t, x, v: -0.08 * (friction * np.tanh(v) + drag * v))
    states = tuple(replace(s, declared=s.declared[:, :4], declared_names=s.declared_names[:4]) for s in states)
    effects = [*catalogue("linkage"), *outsiders("linkage")]
    station = judged("markers", "index", "index", "distal", states, effects)
    assert station.believed and [f.term.effect.name for f in station.kept] == kept
    assert [f.term.effect.name for f in station.outsiders] == ([] if kept else ["linkage_lag"])


def test_a_play_and_as_much_give_are_both_named_and_little_give_is_the_plays_form() -> None:
    states = joint(
        1,
        move=lambda x: play(x, 2.5),
        add=lambda t, x, v: -0.03 * (15.0 + 0.2 * x + 35.0 * np.tanh(v) + 0.15 * v),
        noise=0.2,
    )
    station = judged("encoder", "index", "index", "proximal", states, catalogue("encoder"))
    assert {f.term.effect.name for f in station.kept} == {"drive_backlash", "series_elasticity"}

    def of(name: str, size: float) -> SimpleNamespace:
        return SimpleNamespace(term=SimpleNamespace(effect=effect(name)), size=size, share=size)

    def forms(*proven: SimpleNamespace, hides: bool = False) -> tuple[SimpleNamespace, ...]:
        return Station.forms.fget(SimpleNamespace(proven=proven, _hides=lambda whole, other: hides))

    play_, little, other = of("drive_backlash", 3.0), of("series_elasticity", 0.9), of("encoder_periodic_error", 0.1)
    more = of("series_elasticity", 1.1)
    assert forms(play_, little, other) == (little,) and forms(play_, more, other) == ()
    assert forms(play_, more, other, hides=True) == (more,)


@pytest.mark.parametrize(("gap", "drag", "hidden"), [(2.5, 0.05, True), (4.5, 0.05, False), (2.5, 0.0, False)])
def test_what_yields_to_drag_may_hide_a_play_that_friction_would_open(gap: float, drag: float, hidden: bool) -> None:
    """35 raw of friction both ways move it by 3.5 deg, were all of it to pass through what gives."""
    states = joint(1, move=lambda x: x, add=lambda t, x, v: 0 * v)
    give, form = effect("series_elasticity"), 5.0 if drag else 1.0
    parameters = {"form": form, "compliance": 0.001, "drag_compliance": drag}
    assert give.hides(states, parameters, {"gap": gap, "form": 0.0}) is hidden
    assert not give.hides(states, parameters, {"compliance": 0.01, "form": 1.0})


@pytest.mark.parametrize(("station", "name"), [("encoder", "drive_backlash"), ("linkage", "linkage_backlash")])
def test_a_gap_that_is_crossed_gradually_is_no_give(station: str, name: str) -> None:
    """Two thirds of it within a way of its own, as long as that is: no load does so."""
    states = joint(3, move=lambda x: x - 0.5 * 1.8 * dahl(x, 5.0), noise=0.2)
    (found,) = judged("markers", "index", "index", "distal", states, catalogue(station)).kept
    shape = found.term.shape
    assert found.term.effect.name == name and shape["form"] == GRADUAL
    assert shape["gap"] == pytest.approx(1.8, rel=0.1) and shape["reach"] == pytest.approx(5.0, rel=0.25)
    said = effect(name).sentence({}, effect(name).parameters(shape, {}, {}))
    assert "gradually" in said and "give" not in said
    plain = effect(name).parameters({**shape, "form": 0.0}, {}, {})
    assert "reach" not in plain and "gradually" not in effect(name).sentence({}, plain)


def test_a_play_that_a_smaller_give_nearly_stands_in_for_is_named_beside_it() -> None:
    """Whatever either takes alone: of one family the larger one stands; another that takes as little does not."""

    def of(name: str, size: float, share: float) -> SimpleNamespace:
        return SimpleNamespace(term=SimpleNamespace(effect=effect(name)), size=size, share=share)

    give, play_, other = (
        of("linkage_compliance", 0.8, 0.9),
        of("linkage_backlash", 1.6, 0.02),
        of("distal_stop", 1.6, 0.02),
    )
    small = of("linkage_backlash", 0.7, 0.02)
    for proven, kept in (((give, play_, other), (give, play_)), ((give, small), (give,))):
        naming = SimpleNamespace(balance=SimpleNamespace(sigma=1.0))
        station = SimpleNamespace(proven=proven, forms=(), naming=naming, tilt=0.0, _large=(give,), _told_elsewhere=())
        assert Station._beside.fget(station) == kept


def test_deadband_and_stop_are_told_apart_and_placed() -> None:
    deadband = named(joint(3, move=lambda x: np.maximum(x, 9.0)), "linkage")
    assert list(deadband) == ["coupling_deadband"]
    assert deadband["coupling_deadband"]["until"] == pytest.approx(9.0, abs=0.7)
    stop = named(joint(3, move=lambda x: np.minimum(x, 88.0)), "linkage")
    assert list(stop) == ["distal_stop"]
    assert stop["distal_stop"]["from"] == pytest.approx(88.0, abs=0.7)


@pytest.mark.parametrize("width", [1.4, 2.1, 3.2, 5.0, 11.0])
@pytest.mark.parametrize("noise", [0.2, 0.6])
def test_a_bound_is_looked_for_the_closer_the_nearer_it_is_to_the_end(width: float, noise: float) -> None:
    """A start that misses a bound by as much as it is wide looks worse than none, and would never be optimised."""
    bounds = {
        "distal_stop": lambda x: np.minimum(x, 100 - width),
        "coupling_deadband": lambda x: np.maximum(x, width),
    }
    for name, move in bounds.items():
        balance = Balance(joint(3, move=move, noise=noise))
        start = scan(balance, effect(name), ())
        none, best = balance.fit(), polish(balance, start, 0)
        assert gain(balance, start, none) > 0.9 * gain(balance, best, none) > 50


@pytest.mark.parametrize("passing", [0.0, 0.2])
def test_a_stop_says_where_the_segment_stands_that_it_stops(passing: float) -> None:
    states = joint(3, move=lambda x: np.where(x > 80.0, 80.0 + passing * (x - 80.0), x))
    told = {"from": {"value": 80.0, "ci95": [79.5, 80.5]}, "passing": {"value": passing}}
    stops_at = effect("distal_stop").further(states, told)["stops_at"]
    assert stops_at["value"] == pytest.approx(float(np.polynomial.Polynomial(MAP)(0.8)), abs=0.6)
    assert stops_at["ci95"][0] < stops_at["value"] < stops_at["ci95"][1]
    assert effect("distal_stop").further(states, {**told, "from": {"value": 200.0}}) == {}


def test_a_lifted_finger_is_decoupled_and_its_whiles_are_found() -> None:
    begins = np.array([2.3, 8.1, 14.2])

    def lift(t, x, v):
        phase = (t[:, None] - begins) / 0.7
        return (((phase > 0) & (phase < 1)) * 3.0 * np.sin(np.pi * phase) ** 2).sum(1)

    states = joint(4, add=lift)
    assert list(named(states, "encoder")) == ["spring_decoupling"]
    spans = effect("spring_decoupling").region(states, {"form": 0.0, "below": 1.0})["time"]
    for begin in begins:
        assert any(a < begin + 0.35 < b for a, b in spans["log/0.csv"])


@pytest.mark.parametrize("corner", [0.2, 3.5])
def test_a_finger_goes_slack_within_a_corner_and_leads_nowhere(corner: float) -> None:
    """Below 20 % it stays behind; that a sharp corner misses is no finger that tips over further on, nor an encoder's
    error."""
    states = joint(6, add=lambda t, x, v: 0.12 * corner * np.logaddexp(0.0, (20.0 - x) / corner))
    found = named(states, "encoder")
    assert list(found) == ["spring_decoupling"]
    values = found["spring_decoupling"]
    assert values["form"] == 1.0 and values["lead"] == pytest.approx(0.12, rel=0.3)
    assert values["below"] == pytest.approx(20.0, abs=1.5 * max(corner, 1.0))


@pytest.mark.parametrize("lag_s", [0.03, 0.15])
def test_a_finger_that_opens_later_than_its_motor_is_told_by_how_much(lag_s: float) -> None:
    """Closing it is pushed; a clock or a delay would move it both ways, and a play would not grow with speed."""

    def late(t, x, v):
        left, out = 0.0, []
        for way, step in zip(np.diff(x, prepend=x[0]), np.diff(t, prepend=t[0]), strict=True):
            left = max(left * np.exp(-step / lag_s) - way, 0.0)
            out.append(left)
        return 0.8 * np.array(out)

    found = named(joint(5, add=late), "encoder")
    assert list(found) == ["spring_decoupling"] and found["spring_decoupling"]["form"] == 3.0
    # how late it is, is how far it stays behind at a speed: of a short time the two that make it up are hardly told
    late_s = found["spring_decoupling"]["lag"] * found["spring_decoupling"]["lead"]
    assert late_s == pytest.approx(lag_s, rel=0.3)
    region = effect("spring_decoupling").region((), {"form": 3.0, "lag": lag_s})
    assert region is None


def test_a_reading_at_the_wrong_time_lifts_no_finger() -> None:
    def late(t, x, v):
        return 4.0 * ((t > 8.13) & (t < 8.22))

    assert not any(s.extra["ahead"].any() for s in joint(4, add=late))


def test_nothing_runs_ahead_in_noise() -> None:
    assert all((s.extra["ahead"] == 0).all() for seed in range(6) for s in joint(seed))


@pytest.mark.parametrize("covered", [0.0, 2.0])
def test_a_driver_is_as_quiet_as_its_encoder_where_nothing_is_expected_yet(covered: float) -> None:
    """The encoder's station does not tell of the rest before a first motion; what it expects later is no jump."""
    from hand_model.diagnose.locate.driver_angle import LogAtFrames, driver_angle, foresee, lasting

    x, v = strokes((45.0, 27.0), rest_s=2.0)
    t = np.arange(len(x)) / 100.0
    truth = np.polynomial.Polynomial(MAP)(x / 100) + 0.8 * np.sin(x / 20)  # no cubic
    log = LogAtFrames(x, v, 0 * v, (), np.ones(len(x), bool))
    told = (t >= covered) & (x > 0.05 * np.ptp(x) * (covered > 0))
    seen = truth + np.random.default_rng(4).normal(0, 1.0, len(x))
    foreseen = foresee(t, seen, log, (t[told], truth[told]))
    driver, *_ = driver_angle(t, seen, foreseen, lasting([(t, foreseen)]))
    assert np.std((driver - truth)[t > 2.5]) < 0.1  # of 1 deg a frame


def test_clock_drift_is_named_with_its_rate() -> None:
    found = named(joint(5, drift=2e-3), "encoder")
    assert list(found) == ["clock_drift"]
    assert abs(found["clock_drift"]["drift"]) == pytest.approx(2e-3, rel=0.15)


def test_exchanged_labels_of_a_symmetrical_cluster_are_put_right() -> None:
    t = np.linspace(0, 10, 1000)
    base = np.array([[0, 0, 0], [60, 0, 0], [0, 40, 0], [80, 0, 20], [95, 7.5, 20], [95, -7.5, 20]]) * 1e-3
    truth = (
        base
        + 0.02 * np.stack([np.sin(t), np.cos(t), 0 * t], axis=-1)[:, None]
        + np.random.default_rng(0).normal(0, 1e-4, (1000, 6, 3))
    )
    wrong = truth.copy()
    wrong[300:700, [4, 5]] = truth[300:700, [5, 4]]
    fixed, swaps = repair_labels(ChainData(wrong, np.array([0, 0, 0, 1, 1, 1]), tuple("abcdef")))
    np.testing.assert_array_equal(fixed.position_world, truth)
    assert [(s.labels, s.start, s.stop) for s in swaps] == [(("e", "f"), 300, 699)]
    untouched, none = repair_labels(ChainData(truth, np.array([0, 0, 0, 1, 1, 1]), tuple("abcdef")))
    assert none == ()
    np.testing.assert_array_equal(untouched.position_world, truth)


def exchanging(*swaps_of_recordings: tuple[Swap, ...]) -> SimpleNamespace:
    """A finger of three markers at rest, 20 mm apart, all of which are seen, in recordings of 5 s with these
    exchanges."""
    place = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.02, 0.02, 0.0]])
    chain = Chain(place, np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)))
    labels = ("a", "b", "c")

    def record(number: int, swaps: tuple[Swap, ...]) -> SimpleNamespace:
        right = np.tile(place, (500, 1, 1)) + np.random.default_rng(number).normal(0, 1e-4, (500, 3, 3))
        recorded = right.copy()
        for swap in swaps:
            span, (i, j) = slice(swap.start, swap.stop + 1), (labels.index(name) for name in swap.labels)
            recorded[span, [i, j]] = right[span, [j, i]]
        return SimpleNamespace(
            mocap=Mocap(labels, np.arange(500) / 100, recorded, 100.0, Path("t.c3d")),
            swaps=swaps,
            trial=SimpleNamespace(name=f"t{number}"),
            data=ChainData(right, np.ones(3, int), labels),
            angle_rad=np.zeros((500, 1)),
            pose=Pose(np.tile(np.eye(3), (500, 1, 1)), np.zeros((500, 3)), np.zeros((500, 1))),
        )

    segment = SimpleNamespace(name="distal", markers=("a", "b", "c"))
    records = tuple(record(i, swaps) for i, swaps in enumerate(swaps_of_recordings))
    finger = SimpleNamespace(name="index", segments=(segment,))
    return SimpleNamespace(records=records, finger=finger, chain=chain, noise_m=1e-4)


def test_labels_that_flicker_are_no_exchange() -> None:
    lasting = Swap(("a", "b"), 100, 140)
    flicker = tuple(Swap(("a", "b"), f, f + 1) for f in range(200, 300, 5))
    for swaps, count in (((lasting,), 1), ((lasting, *flicker), 0)):
        assert len(swaps_found(exchanging(swaps))) == count


def test_an_exchange_is_told_by_its_own_recording_and_while() -> None:
    angles = exchanging((Swap(("a", "b"), 40, 60),), (Swap(("a", "b"), 300, 420), Swap(("a", "b"), 460, 480)))
    ((_, finding),) = swaps_found(angles)
    read = {name: entry["value"] for name, entry in finding.parameters.items()}
    assert read == pytest.approx({"begin": 3.0, "end": 4.2, "lasting": 0.2 + 1.2 + 0.2})
    assert finding.where["trials"] == ["t0", "t1"] and all(
        text in finding.statement for text in ("0.4 to 0.6 s of t0", "3.0 to 4.2 s of t1", "4.6 to 4.8 s of t1")
    )
    angles.records[1].data.position_world[421:460, 0] = np.nan  # between the two a marker is lost: one while
    ((_, finding),) = swaps_found(angles)
    assert finding.parameters["end"]["value"] == pytest.approx(4.8)


def test_putting_labels_right_takes_their_error_away() -> None:
    ((_, finding),) = swaps_found(exchanging((Swap(("a", "b"), 100, 199),)))  # a fifth of the time, 20 mm apart along x
    assert finding.fit["before"] == pytest.approx(0.02 * np.sqrt(0.2 / 3), rel=0.01)
    assert finding.fit["after"] == pytest.approx(1e-4, rel=0.1)


def test_the_current_of_whiles_in_which_the_finger_has_left_its_drive_is_not_judged() -> None:
    from types import SimpleNamespace

    from hand_model.diagnose.locate.decoupled import without_excursions
    from hand_model.effects.base import DriveState

    t = np.arange(0, 40, 0.01)
    x = 50 - 50 * np.cos(2 * np.pi * 0.15 * t * (1 + 0.01 * t))

    def state(time_s: np.ndarray, **extra) -> DriveState:
        one = np.ones((len(time_s), 1))
        return DriveState(
            "trial", "index", time_s, np.interp(time_s, t, x), one[:, 0], one[:, 0], one[:, 0], one, extra=extra
        )

    late_s, lifted = 3.0, (t > 20.0) & (t < 20.5)
    angle = np.deg2rad(0.8 * x)[:, None]
    angles = SimpleNamespace(
        records=[
            SimpleNamespace(
                trial=SimpleNamespace(name="trial"), mocap=SimpleNamespace(time_s=t + late_s), angle_rad=angle
            )
        ]
    )
    ahead = DriveState(**{**vars(state(t)), "time_s": t + late_s, "extra": {"ahead": lifted.astype(float)}})
    (judged,) = without_excursions((state(t),), (ahead,), angles)
    free = np.isnan(judged.effort)
    assert free[lifted].all() and not free[(t < 19.5) | (t > 21.0)].any()
    assert np.isfinite(without_excursions((state(t),), (state(t),), angles)[0].effort).all()


def test_a_drifting_clock_lifts_no_finger() -> None:
    for drift in (1.5e-3, -3e-3):
        states = joint(9, drift=drift)
        assert not any(np.any(s.extra["ahead"] > 0) for s in states)


def held(begin_s: float, end_s: float, lift_deg: float):
    """A finger held ahead of its drive for a while, as if somebody pushed: it can only be ahead."""
    return lambda t, x, v: np.maximum(
        lift_deg * np.clip(np.minimum(t - begin_s, end_s - t) / 0.4, 0, 1) - np.polynomial.Polynomial(MAP)(x / 100), 0.0
    )


@pytest.mark.parametrize("lasting_s", [2.0, 7.0])
def test_a_finger_held_ahead_however_long_is_named_and_comes_back_without_a_jump(lasting_s: float) -> None:
    states = joint(3, add=held(8.5, 8.5 + lasting_s, 60.0))
    assert set(named(states, "encoder")) == {"spring_decoupling"}
    for state in states:
        ahead = state.extra["ahead"]
        assert state.validate or np.any(ahead > 5.0) and np.abs(np.diff(ahead)).max() < 5.0  # of up to 60, at 100 Hz


@pytest.mark.parametrize(("size_deg", "memory_s"), [(0.3, 1.0), (0.6, 4.0), (1.2, 1.0)])
def test_an_angle_that_wanders_both_ways_is_lifted_by_nobody(size_deg: float, memory_s: float) -> None:
    keep = np.exp(-0.01 / memory_s)
    for seed in range(3):
        rng = np.random.default_rng(100 + seed)

        def wander(t, x, v, rng=rng):
            level = [rng.normal()]
            for _ in t[1:]:
                level.append(keep * level[-1] + np.sqrt(1 - keep**2) * rng.normal())
            return size_deg * np.array(level)

        assert not any(np.any(s.extra["ahead"] > 0) for s in joint(seed, add=wander))


def test_what_follows_a_lifted_joint_is_not_judged_while_it_is_lifted() -> None:
    from hand_model.diagnose.locate.decoupled import beside_excursions

    ahead = joint(3, add=held(8.5, 10.5, 60.0))
    state, other = beside_excursions(joint(4), ahead)
    during = ahead[0].extra["ahead"] > 0
    assert during.any() and np.isnan(state.effort[during]).all()
    assert (
        np.isfinite(state.effort[(state.time_s < 7.0) | (state.time_s > 12.0)]).all()
        and np.isfinite(other.effort).all()
    )


def test_a_drive_is_judged_from_a_little_beyond_where_its_finger_stays_behind() -> None:
    from drive_motion import state

    from hand_model.diagnose.locate.decoupled import while_driven

    (left,) = while_driven([state()], 20.0)
    kept = left.position[np.isfinite(left.effort)]
    assert 22.0 < kept.min() < 26.0


def test_a_drive_has_an_unknown_share_of_its_spring_while_its_finger_comes_open_late() -> None:
    """That share is no friction that grows with load: along a stroke the two are the same, and it stands already. Where
    the current shows none, there is nothing that a friction could make up for."""
    from drive_motion import state

    from hand_model.diagnose.locate.decoupled import RELEASED, while_returning

    moved = state()
    plain = replace(moved, extra={**moved.extra, "load": 9.0 + 0.2 * moved.position})
    behind = moved.velocity < -2.0
    assert while_returning([plain], 0.05) == (plain,)
    off = replace(plain, effort=plain.effort - 0.1 * np.where(behind, moved.position, 0.0))
    (left,) = while_returning([off], 0.05)
    assert left.declared_names == (*plain.declared_names, RELEASED)
    column = left.declared[:, -1]
    np.testing.assert_array_equal(left.declared[:, :-1], plain.declared)
    np.testing.assert_array_equal(column[(moved.velocity > 5.0) & (moved.position > 60.0)], 0.0)
    assert np.mean(column[behind] == moved.position[behind]) > 0.85
    for known, told in ((off, True), (left, False)):
        known = replace(known, effort=plain.effort - 0.1 * column)
        names = [f.term.effect.name for f in name_effects((known,), catalogue("drive")).found]
        assert ("load_dependent_friction" in names) is told


@pytest.mark.parametrize("met", [True, False])
def test_a_segment_held_back_for_a_while_gives_no_more_than_others(met: bool) -> None:
    """An obstacle bends the linkage while it is there: no compliance, and where the current shows it nothing else."""
    from hand_model.diagnose.assemble import assemble
    from hand_model.diagnose.findings import Finding

    def held_back(t, x, v):
        share = (t - t[0]) / np.ptp(t)
        return -0.1 * np.maximum(x - 50.0, 0.0) * ((share > 0.2) & (share < 0.8))

    effects = [*catalogue("linkage"), *outsiders("linkage")]
    station = judged("markers", "index", "index", "distal", joint(5, add=held_back), effects)
    assert station.believed and not station.kept
    assert {f.term.effect.name for f in station.outsiders} == {"obstructed"}
    where = dict.fromkeys(("joint", "actuator", "marker"), None) | {"finger": "index", "signal": "current"}
    where |= {"share_of_mismatch": 1.0, "trials": []}
    contact = Finding("external_contact", ("external_contact",), 1.0, (), where, "", {}, {}, None)
    findings = assemble([station], [(1.0, contact)] if met else [], [])
    assert [f.effect for f in findings.findings] == ["external_contact"] * met
    assert any("holds the distal segment back" in e["shape"] for e in findings.unexplained) is not met


@pytest.mark.parametrize("met", [True, False])
def test_what_is_smaller_than_the_trace_of_an_obstacle_stands_where_that_does_not_act(met: bool) -> None:
    """Whether the current shows the obstacle or not: what is plain before and after it is no form of it."""

    def held_back_with_a_dead_band(t, x, v):
        share = (t - t[0]) / np.ptp(t)
        return -0.1 * np.maximum(x - 50.0, 0.0) * ((share > 0.2) & (share < 0.8)) + 0.3 * np.maximum(8.0 - x, 0.0)

    effects = [*catalogue("linkage"), *outsiders("linkage")]
    states = joint(5, add=held_back_with_a_dead_band)
    station = judged("markers", "index", "index", "distal", states, effects)
    named = SimpleNamespace(term=SimpleNamespace(effect=effect("external_contact" if met else "detent_load")))
    bring_together([station, SimpleNamespace(finger="index", believed=True, kept=(named,))])
    assert station.believed
    assert [f.term.effect.name for f in station.kept] == ["coupling_deadband"]
    assert [f.term.effect.name for f in station.outsiders] == ([] if met else ["obstructed"])


def test_what_shows_only_while_an_obstacle_acts_falls_with_it() -> None:
    def held_back(t, x, v):
        share = (t - t[0]) / np.ptp(t)
        while_there = (share > 0.2) & (share < 0.8)
        return while_there * (-0.1 * np.maximum(x - 50.0, 0.0) + 0.3 * np.maximum(8.0 - x, 0.0))

    effects = [*catalogue("linkage"), *outsiders("linkage")]
    station = judged("markers", "index", "index", "distal", joint(5, add=held_back), effects)
    assert "obstructed" in {f.term.effect.name for f in station.outsiders}
    assert not station.kept


def test_a_departure_within_the_tilt_of_a_joint_that_is_no_hinge_does_not_stand_and_a_clock_does() -> None:
    def bumped(t, x, v):
        return 0.35 * np.sin(2 * np.pi * x / 31.0)

    effects = [*catalogue("encoder"), *outsiders("encoder")]
    station = judged("encoder", "index", "index", "proximal", joint(6, add=bumped, drift=2e-3), effects)
    assert {f.term.effect.name for f in station.kept} == {"encoder_periodic_error", "clock_drift"}
    station.tilt = 0.2  # [deg]
    assert {f.term.effect.name for f in station.kept} == {"encoder_periodic_error", "clock_drift"}
    station.tilt = 0.3
    assert {f.term.effect.name for f in station.kept} == {"clock_drift"}


@pytest.mark.parametrize(("lead", "pulled"), [(0.2, True), (0.08, True), (0.025, False)])
def test_a_finger_that_stays_bent_takes_its_spring_off_the_drive_unless_it_is_a_trifle(
    lead: float, pulled: bool
) -> None:
    """At its full, at two fifths and at a tenth of what a worn spring does."""

    def stays(t, x, v):
        return lead * np.maximum(20.0 - x, 0.0)

    station = judged("encoder", "index", "index", "proximal", joint(4, add=stays, noise=0.2), catalogue("encoder"))
    assert [f.term.effect.name for f in station.kept] == ["spring_decoupling"]
    assert pulls(station, TRIFLE) is pulled


@pytest.mark.parametrize(("p", "share", "stands"), [(1.0, 0.4, False), (1.0, 0.6, True), (1e-4, 0.4, True)])
def test_what_holds_less_than_something_no_table_names_stands_only_where_a_test_sees_it(
    p: float, share: float, stands: bool
) -> None:
    def of(held: float, **kind: object) -> SimpleNamespace:
        kind = {
            "listed": True,
            "name": "series_elasticity",
            "drifting": False,
            "of_the_hand": True,
            "covers": (),
            **kind,
        }
        return SimpleNamespace(term=SimpleNamespace(effect=SimpleNamespace(**kind)), size=1.0, share=held)

    give, strange = of(share), of(1 - share, listed=False, name="clock_wander")
    naming = SimpleNamespace(before=SimpleNamespace(p=p))
    station = SimpleNamespace(_unlisted=(strange,), _beside=(give, strange), naming=naming, wander=0.0)
    assert (give in Station.kept.fget(station)) is stands
