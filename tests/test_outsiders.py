"""Outsiders: what no table of effects holds competes, is told as unexplained and never named; what is known comes
first."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnose import PLANTED, TRUTH, drive, planted
from test_kinematic_stations import MAP, joint

from hand_model.diagnose import Finding
from hand_model.diagnose.assemble import assemble
from hand_model.diagnose.locate.drive import with_required
from hand_model.diagnose.name.entries import channel_of
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.selection import SMALL
from hand_model.diagnose.name.station import Station
from hand_model.effects import catalogue, effect, outsiders
from hand_model.effects.base import DriveState

BY_NAME = {e.name: e for e in outsiders("drive")}


def heard(states: tuple[DriveState, ...]) -> Station:
    total = max(float(s.elapsed_s[-1]) for s in states)
    states = tuple(replace(s, extra={**s.extra, "session_s": np.full(len(s.time_s), total)}) for s in states)
    effects = [e.among(states) for e in (*catalogue("drive"), *outsiders("drive"))]
    return judged("current", "index", "index", None, with_required(states), effects)


def gain(state: DriveState) -> np.ndarray:
    return 0.4 * (state.declared @ TRUTH) * state.elapsed_s / 150.0


def jump(state: DriveState) -> np.ndarray:
    return 12.0 * np.sign(state.velocity) * (state.elapsed_s > 52.0)


def hung(state: DriveState) -> np.ndarray:
    return 13.0 * (state.time_s - state.time_s[0] > 0.4 * np.ptp(state.time_s))


def amplified(state: DriveState) -> np.ndarray:
    return -0.2 * (state.declared @ TRUTH) * (state.time_s - state.time_s[0] > 0.53 * np.ptp(state.time_s))


def tooth(state: DriveState) -> np.ndarray:
    shape = {"form": 1.0, "centre": 45.0, "width": 4.0}
    return BY_NAME["cycle_memory"].columns(state, shape)[:, 0] * 30.0


def grease(state: DriveState) -> np.ndarray:
    return BY_NAME["thixotropy"].columns(state, {"thinning_speed": 18.0, "while": 4.0})[:, 0] * 0.5


@pytest.mark.parametrize(
    ("name", "add"),
    [
        ("gain_change", gain),
        ("friction_jump", jump),
        pytest.param("load_jump", hung, marks=pytest.mark.slow),
        pytest.param("gain_jump", amplified, marks=pytest.mark.slow),
        pytest.param("cycle_memory", tooth, marks=pytest.mark.slow),
        pytest.param("thixotropy", grease, marks=pytest.mark.slow),
    ],
)
def test_an_outsider_is_unexplained_and_said(name: str, add) -> None:
    station = heard(drive(3, add))
    assert not station.kept and [f.term.effect.name for f in station.outsiders] == [name]
    told = assemble([station], [], [])
    assert told.verdict == "unexplained" and not told.findings
    assert told.unexplained[0]["shape"].startswith("no known effect, but index: ")
    assert name not in {r["effect"] for r in told.rejected}


@pytest.mark.parametrize(("name", "shape", "amplitude"), PLANTED, ids=[p[0] for p in PLANTED])
def test_what_is_known_comes_first(name: str, shape: dict[str, float], amplitude: list[float]) -> None:
    station = heard(drive(3, planted(name, shape, amplitude)))
    assert [f.term.effect.name for f in station.kept] == [name] and not station.outsiders
    assert not set(station.kept[0].members) & set(BY_NAME)


def test_no_outsider_is_a_row_of_the_table() -> None:
    assert BY_NAME and not set(BY_NAME) & {e.name for e in catalogue()}
    assert not any(e.listed for e in BY_NAME.values()) and all(e.listed for e in catalogue())


def weighed(
    states: tuple[DriveState, ...],
    poses: list[tuple[float, float] | None],
    load_raw: float = 20.0,
    unseen: tuple[tuple[float, float], ...] = ((9.0, -3.0),),
) -> tuple[DriveState, ...]:
    """The states with a weight of `load_raw` whose poses (along, across) are recorded, or not: then each as the next of
    `unseen`."""
    out, numbers = [], iter(range(len(poses)))
    for state, pose in zip(states, poses, strict=True):
        number = 0 if pose else next(numbers)
        along, across = pose or unseen[number % len(unseen)]
        n = np.ones(len(state.time_s))
        seen = replace(
            state, extra={**state.extra, "gravity_along": along * n, "gravity_across": across * n, "pose_seen": n}
        )
        load = effect("gravity_load").columns(seen, {"sweep": 1.4}) @ np.array([load_raw, 0.0, 0.0, 0.0])
        bare = {**state.extra, "pose_unseen": number * n}
        out.append(replace(seen if pose else replace(state, extra=bare), effort=state.effort + load))
    return tuple(out)


@pytest.mark.parametrize(
    ("load_raw", "noise", "within"), [pytest.param(20.0, 5.0, 0.15, marks=pytest.mark.slow), (1.5, 8.0, 0.9)]
)
def test_a_weight_is_named_where_only_the_recording_kept_out_shows_another_pose(
    load_raw: float, noise: float, within: float
) -> None:
    states = drive(8, noise=noise, trials=5)
    poses = [(9.81, 0.0), None, None, (-8.0, 5.0), None]
    station = heard(weighed(tuple(replace(s, validate=k > 2) for k, s in enumerate(states)), poses, load_raw))
    assert [f.term.effect.name for f in station.kept] == ["gravity_load"]
    size = station.parameters[station.naming.fit.terms.index(station.kept[0].term)]
    assert set(size) == {"sweep", "along", "across", "largest"}
    assert abs(np.hypot(size["along"]["value"], size["across"]["value"]) / load_raw - 1) < within


def test_a_weight_is_named_where_each_recording_without_markers_has_another_pose() -> None:
    states = drive(8, trials=6)
    poses = [(9.81, 0.0), None, None, None, (-8.0, 5.0), (3.0, 9.0)]
    unseen = ((9.0, -3.0), (-9.5, 2.0), (1.0, 9.5))
    station = heard(weighed(tuple(replace(s, validate=k > 4) for k, s in enumerate(states)), poses, unseen=unseen))
    assert [f.term.effect.name for f in station.kept] == ["gravity_load"]
    assert station.kept[0].term.shape["form"] == 1.0 and station.naming.after.p > 0.01
    size = station.parameters[station.naming.fit.terms.index(station.kept[0].term)]
    assert set(size) == {"sweep", "along", "across", "largest"}
    assert abs(np.hypot(size["along"]["value"], size["across"]["value"]) / 20.0 - 1) < 0.15


@pytest.mark.parametrize(
    ("shares", "p", "scattered"),
    [
        ((0.3, 0.3, 0.2, 0.1, 0.1), 1e-4, True),
        ((0.6, 0.1, 0.1, 0.1, 0.1), 1e-4, False),
        ((0.3, 0.3, 0.2, 0.1, 0.1), 0.2, False),
        ((0.4, 0.3, 0.3), 1e-4, False),
    ],
)
def test_many_pieces_that_do_not_do_are_no_explanation(shares: tuple[float, ...], p: float, scattered: bool) -> None:
    station = object.__new__(Station)
    station.naming = SimpleNamespace(after=SimpleNamespace(p=p), found=[SimpleNamespace(share=s) for s in shares])
    assert station._scattered is scattered


@pytest.mark.parametrize(("slips", "named"), [(3, True), (2, False)])
def test_pieces_stand_in_a_finger_of_which_much_else_is_missing(
    slips: int, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Five names that leave something: among so many, there are more than five."""
    station = heard(drive(3, planted(*PLANTED[0])))
    monkeypatch.setattr(Station, "believed", False)
    monkeypatch.setattr(Station, "believed_in_part", True)
    where = {"finger": "index", "joint": None, "actuator": "index", "signal": "markers", "trials": []}
    marks = [
        Finding(
            "marker_slip",
            ("marker_slip",),
            1.0,
            (),
            {**where, "marker": f"M{k}", "share_of_mismatch": 0.1},
            "",
            {},
            {},
            None,
        )
        for k in range(slips)
    ]
    told = assemble([station], [(0.5, f) for f in marks], [])
    assert (PLANTED[0][0] in {f.effect for f in told.findings}) is named
    assert bool(told.channels[0]["effects"]) is named and bool(told.unexplained) is not named


@pytest.mark.parametrize(
    ("count", "p", "explained", "tells", "kept_out", "part"),
    [
        (5, 1e-4, 0.6, True, (1.4, 1.0), True),
        (5, 1e-4, 0.4, True, (1.4, 1.0), False),
        (4, 1e-4, 0.6, True, (1.4, 1.0), True),  # recordings kept out are within their noise
        (4, 1e-4, 0.6, True, (1.4, 1.2), False),
        (4, 1e-4, 0.6, True, (1.05, 1.0), False),  # as they were before
        (5, 0.2, 0.6, True, (1.4, 1.0), False),
        (5, 0.2, 0.6, True, (1.4, 1.2), True),  # the test passes, recordings kept out show that something is left
        (5, 0.2, 0.6, True, (1.4, 1.5), False),  # and get worse
        (5, 1e-4, 0.6, False, (1.4, 1.2), False),
    ],
)
def test_in_part_means_as_many_names_as_may_be_of_more_than_half_of_the_mismatch(
    count: int,
    p: float,
    explained: float,
    tells: bool,
    kept_out: tuple[float, float],
    part: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station = object.__new__(Station)
    friction = SimpleNamespace(term=SimpleNamespace(effect=effect("load_dependent_friction")))
    naming = {
        "before": SimpleNamespace(p=1e-6),
        "after": SimpleNamespace(p=p),
        "found": [friction] * count,
        "wander": None,
        "balance": SimpleNamespace(untouched=True),
    }
    station.naming = SimpleNamespace(**naming)
    monkeypatch.setattr(Station, "_kept_out", kept_out)
    monkeypatch.setattr(Station, "explained", explained)
    monkeypatch.setattr(Station, "_tells", tells)
    assert station.believed_in_part is part


@pytest.mark.parametrize(("standing", "left_over"), [((0.9, 0.05), False), ((0.05, 0.05), True)])
def test_what_is_left_beside_something_larger_that_does_not_stand_is_no_explanation(
    standing: tuple[float, ...], left_over: bool
) -> None:
    station = object.__new__(Station)
    station.proven = tuple(SimpleNamespace(share=s) for s in standing)
    assert station._left_over is left_over


@pytest.mark.parametrize(
    ("periods", "share", "patched"),
    [
        ((30.0,), 0.2, False),
        ((30.0, 15.05, 10.0), 0.2, False),
        ((30.0, 21.0), 0.2, False),
        ((30.0, 26.0, 21.0, 15.0), 0.2, True),
        ((30.0, 26.0, 21.0, 15.0), 0.01, False),  # beside something that holds the rest
    ],
)
def test_many_periods_that_have_nothing_in_common_are_no_explanation(
    periods: tuple[float, ...], share: float, patched: bool
) -> None:
    station, error = object.__new__(Station), effect("encoder_periodic_error")
    station.proven = tuple(
        SimpleNamespace(term=SimpleNamespace(effect=error, shape={"period": p}), share=share) for p in periods
    )
    assert station._patched is patched


@pytest.mark.parametrize(("form", "cut"), [(0.0, np.abs), (1.0, np.positive), (2.0, np.negative)])
def test_the_share_that_a_ceiling_cuts_is_what_the_motion_requires_beyond_it(form: float, cut: np.ufunc) -> None:
    states = with_required(drive(2))
    required = cut(np.concatenate([s.extra["required"][np.isfinite(s.effort)] for s in states]))
    told = {"form": {"value": form}, "limit": {"value": float(np.quantile(required, 0.8))}}
    entry = effect("current_saturation").further(states, told)
    assert abs(entry["share_cut"]["value"] - 0.2) < 0.01


@pytest.mark.parametrize("hz", [pytest.param(1.7, marks=pytest.mark.slow), 5.1])
def test_a_rhythm_in_time_is_no_ripple(hz: float) -> None:
    station = heard(indexed(drive(4, lambda s: 6.0 * np.sin(2 * np.pi * hz * s.time_s + 2.0 * float(s.elapsed_s[0])))))
    assert not station.kept and [f.term.effect.name for f in station.outsiders] == ["vibration"]
    assert station.outsiders[0].term.shape["frequency"] == pytest.approx(hz, rel=0.01)


def indexed(states: tuple[DriveState, ...]) -> tuple[DriveState, ...]:
    return tuple(
        replace(s, extra={**s.extra, "trial_index": np.full(len(s.time_s), float(k))}) for k, s in enumerate(states)
    )


def test_frames_that_were_lost_are_no_drift_of_a_clock() -> None:
    def lost(t: np.ndarray, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        late = 0.12 * (t > 0.2 * t[-1]) - 0.09 * (t > 0.55 * t[-1]) + 0.1 * (t > 0.8 * t[-1])
        return np.polynomial.Polynomial(MAP)(np.interp(t + late, t, x) / 100) - np.polynomial.Polynomial(MAP)(x / 100)

    station = judged(
        "encoder", "index", "index", "proximal", joint(3, add=lost), [*catalogue("encoder"), *outsiders("encoder")]
    )
    assert "clock_wander" in {f.term.effect.name for f in station.outsiders}
    assert "clock_drift" not in {f.term.effect.name for f in station.kept}


@pytest.mark.parametrize("since_s", [12.0, 29.0])
def test_an_encoder_whose_scale_changes_lifts_no_finger(since_s: float) -> None:
    def further(t, x, v):
        later = (t >= since_s) if t[-1] > 25 else np.ones(len(t), bool)  # the second recording comes after it
        return np.polynomial.Polynomial(MAP)(1.025 * x / 100 * later + x / 100 * ~later) - np.polynomial.Polynomial(
            MAP
        )(x / 100)

    station = judged(
        "encoder", "index", "index", "proximal", joint(3, add=further), [*catalogue("encoder"), *outsiders("encoder")]
    )
    assert not station.kept and [f.term.effect.name for f in station.outsiders] == ["scale_change"]
    assert station.outsiders[0].amplitudes["change"] == pytest.approx(0.025, abs=0.005)


@pytest.mark.parametrize("anew", [True, False])
def test_a_segment_that_jumps_against_its_encoder_is_not_lifted(anew: bool) -> None:
    """In each recording anew, or once for all."""

    def jumps(t, x, v):
        first = t[-1] > 25
        return -1.4 * (t >= (14.0 if first else 0.45 * t[-1] if anew else 0.0))

    station = judged(
        "encoder", "index", "index", "proximal", joint(3, add=jumps), [*catalogue("encoder"), *outsiders("encoder")]
    )
    assert not station.kept and "zero_jump" in {f.term.effect.name for f in station.outsiders}
    assert station.outsiders[0].amplitudes["jump_0"] == pytest.approx(-1.4, abs=0.15)
    station.swaying = station.outsiders[0].evidence / 6.0 + 1.0  # cameras that drift may do that
    assert "zero_jump" not in {f.term.effect.name for f in station.outsiders}


@pytest.mark.parametrize("rate", [9e-5, -9e-5])
def test_clocks_that_part_as_crystals_do_are_two_healthy_ones(rate: float) -> None:
    def parted(t, x, v):
        slope = np.polynomial.Polynomial(MAP).deriv()(x / 100) / 100
        return rate * (t - t[-1] / 2) * slope * v * (t[-1] > 25)

    effects = [*catalogue("encoder"), *outsiders("encoder")]
    station = judged("encoder", "index", "index", "proximal", joint(3, add=parted, noise=0.15), effects)
    assert "clock_wander" not in {f.term.effect.name for f in station.outsiders}


@pytest.mark.slow
def test_names_that_leave_what_recordings_kept_out_show_are_not_believed() -> None:
    def at_speed(state):  # a spring that is there at speed only: no row of the table, and no outsider
        return 0.5 * np.maximum(state.position - 50, 0) * (np.abs(state.velocity) > 45) * np.sign(state.velocity)

    assert not judged("current", "index", "index", None, drive(2, at_speed), catalogue("drive")).believed


@pytest.mark.parametrize(("cold", "believed"), [(40.0, True), (6.0, False)])
def test_names_that_leave_nothing_of_what_recordings_kept_out_showed_plainly_are_believed(
    cold: float, believed: bool
) -> None:
    """Whatever repeats beside them: the test hardly sees what changes over a recording."""
    warm = planted("thermal_friction_drift", {"form": 0.0, "warm_up_time": 50.0, "cooling_time": 50.0}, [cold])
    naming = judged("current", "index", "index", None, drive(2, warm), catalogue("drive")).naming
    assert [f.term.effect.name for f in naming.found] == ["thermal_friction_drift"]
    some = replace(naming.after, p=1e-6, excess=0.5 * naming.before.excess)
    assert (
        Station(
            "current", "index", "index", None, replace(naming, before=replace(naming.before, p=1e-9), after=some)
        ).believed
        is believed
    )


def test_a_drifting_clock_is_named_beside_outsiders() -> None:
    station = judged(
        "encoder", "index", "index", "proximal", joint(5, drift=2e-3), [*catalogue("encoder"), *outsiders("encoder")]
    )
    assert [f.term.effect.name for f in station.kept] == ["clock_drift"] and not station.outsiders


@pytest.mark.slow
def test_a_level_that_wanders_names_no_obstacle() -> None:
    rng = np.random.default_rng(2)

    def walk(state: DriveState) -> np.ndarray:
        knots = np.arange(0.0, state.time_s[-1] + 2.0, 2.0)
        return np.interp(state.time_s, knots, 4.0 * rng.normal(size=len(knots)))

    assert not heard(indexed(drive(6, walk))).kept


def test_the_only_effect_needs_no_steady_motion_where_it_is_plain_and_a_faint_one_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # all of it happens at starts and stops
    monkeypatch.setattr("hand_model.diagnose.name.station.sized", lambda *_: False)
    plain = heard(drive(3, planted(*PLANTED[0])))
    assert [f.term.effect.name for f in plain.kept] == [PLANTED[0][0]]
    # of two that explain as much one may hold the half of it, not less
    faint = replace(plain.naming, found=(replace(plain.naming.found[0], share=0.4),) * 2)
    overlooked = Station("current", "index", "index", None, faint)
    assert not overlooked.proven
    assert channel_of(overlooked, overlooked.believed)["effects"] == []  # what does not stand is not told
    assert channel_of(plain, plain.believed)["effects"] == [PLANTED[0][0]]


@pytest.mark.parametrize(
    ("signal", "p", "stands"), [("current", 0.5, True), ("encoder", 0.5, False), ("encoder", 1e-9, True)]
)
def test_what_no_test_sees_must_be_plainer_in_angles_than_in_currents(
    monkeypatch: pytest.MonkeyPatch, signal: str, p: float, stands: bool
) -> None:
    monkeypatch.setattr("hand_model.diagnose.name.station._stands", lambda naming, found, which, least: least < 11.5)
    naming = heard(drive(3, planted(*PLANTED[0]))).naming
    naming = replace(naming, before=replace(naming.before, p=p))
    assert bool(Station(signal, "index", "index", None, naming).proven) is stands


@pytest.mark.parametrize(
    ("count", "p", "left", "overwhelmed"),
    [(5, 1e-9, 0.5, True), (4, 1e-9, 0.5, False), (5, 0.2, 0.5, False), (5, 1e-9, 0.1, False)],
)
def test_five_effects_that_leave_most_of_a_plain_mismatch_are_enough(
    count: int, p: float, left: float, overwhelmed: bool
) -> None:
    naming = heard(drive(3, planted(*PLANTED[0]))).naming
    before, after = replace(naming.before, p=1e-30, excess=100.0), replace(naming.after, p=p, excess=100.0 * left)
    assert replace(naming, before=before, after=after, found=naming.found[:1] * count).overwhelmed is overwhelmed


@pytest.mark.slow
def test_an_outsider_that_no_test_sees_must_be_plainer_than_an_effect() -> None:
    """Faint grease beats the noise as an effect would, and is not said; twice as much is."""
    faint, plain = (heard(drive(2, lambda s, k=k: k * grease(s))) for k in (0.115, 0.2))
    assert faint.naming.before.p > 0.05 and plain.naming.before.p > 0.05
    assert [f.term.effect.name for f in faint.proven] == ["thixotropy"]
    assert not faint.outsiders and not faint.kept and not faint.missing
    assert [f.term.effect.name for f in plain.outsiders] == ["thixotropy"] and plain.missing


def test_a_small_effect_stands_where_the_large_one_does_nothing() -> None:
    """Drag beside a hill of twenty times its mean square."""
    hill, drag = planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 8.0}, [-30.0]), planted(*PLANTED[5])
    both = heard(drive(3, lambda s: hill(s) + drag(s)))
    assert [f.term.effect.name for f in both.kept] == ["detent_load", "quadratic_damping"]
    assert min(f.share for f in both.kept) < SMALL


@pytest.mark.parametrize("lean", [0.15, 0.3])
def test_what_a_hill_of_another_form_leaves_is_no_small_effect(lean: float) -> None:
    def leaning(state: DriveState) -> np.ndarray:
        u = (state.position - 60.0) / 8.0
        return -30.0 * np.exp(-0.5 * (u / (1 + lean * np.tanh(u))) ** 2)

    assert {f.term.effect.name for f in heard(drive(3, leaning)).kept} <= {"detent_load"}


def test_a_motor_does_not_warm_up_within_a_few_strokes() -> None:
    """Of recordings that each begin cold: what is over at once is less likely a warm-up."""
    prior = effect("thermal_friction_drift").log_prior
    each, whole = {"form": 3.0, "ratio": 0.5}, {"form": 0.0, "ratio": 0.5}
    assert prior({**each, "warm_up_time": 5.0}) < prior({**each, "warm_up_time": 8.0}) - 4
    assert prior({**whole, "warm_up_time": 5.0}) == prior({**whole, "warm_up_time": 8.0}) == 0


def test_what_a_long_rest_restored_wears_off_over_strokes_with_short_rests_between() -> None:
    """Friction of a cold start: the next strokes begin where the last one ended."""
    t = np.arange(0, 12, 0.02)
    u = t % 3.0
    position = np.where((t // 3) % 2 == 0, 1.0, 0.0) * 100 * np.clip(u / 2, 0, 1)
    position += np.where((t // 3) % 2 == 1, 1.0, 0.0) * 100 * (1 - np.clip(u / 2, 0, 1))
    velocity = np.gradient(position, t)
    state = DriveState("a", "index", t, position, velocity, 0 * t, 0 * t, np.sign(velocity)[:, None])
    state = replace(state, extra={"moving": (u < 2).astype(float)}, declared_names=("coulomb",))
    worn = np.abs(BY_NAME["dwell_friction"].columns(state, {"distance": 150.0, "healing_time": 300.0})[:, 0])
    begins = [worn[int((3 * k + 0.1) / 0.02)] for k in range(4)]
    np.testing.assert_allclose(np.diff(np.log(begins)), -100 / 150, atol=0.03)
    healed = np.abs(BY_NAME["dwell_friction"].columns(state, {"distance": 20.0, "healing_time": 0.1})[:, 0])
    assert healed[int(3.1 / 0.02)] > 0.6  # each rest restores what each stroke wears off
