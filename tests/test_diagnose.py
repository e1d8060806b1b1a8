"""Diagnosis: planted effects are named with their parameters, healthy drives stay consistent, noise is what it is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_model.diagnose import Finding, Findings, diagnose
from hand_model.diagnose.locate.motion import estimate_motion, local_quadratic
from hand_model.diagnose.name.balance import Balance
from hand_model.diagnose.name.interval import Reading, _quantile, held_out, parameter_intervals, undisturbed
from hand_model.diagnose.name.judgement import judged
from hand_model.diagnose.name.least_squares import bounded_least_squares
from hand_model.diagnose.name.naming import ALPHA
from hand_model.diagnose.name.selection import name_effects
from hand_model.diagnose.name.shapes import polish
from hand_model.diagnose.name.station import Station
from hand_model.diagnose.name.term import Term, doubled
from hand_model.effects import catalogue, effect
from hand_model.effects.base import DriveState

SHARED = Path(__file__).resolve().parents[2] / "shared" / "sessions"
NAMES = ("inertia", "viscous", "coulomb", "spring", "preload")
TRUTH = np.array([0.012, 0.15, 35.0, 0.22, 9.0])


def drive(seed: int, add=None, noise: float = 5.0, colour: float = 0.0, trials: int = 4) -> tuple[DriveState, ...]:
    """Trapezoidal strokes at five speeds, current by the declared model plus `add(state)`, white or AR(1) noise."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(trials):
        t = np.cumsum(rng.uniform(0.012, 0.024, 1500))
        x, v = _path(t, rng.permutation([17.0, 30.0, 55.0, 80.0, 110.0]))
        moving = np.abs(v) > 1
        declared = np.stack([np.zeros_like(v), v, np.sign(v), x, np.ones_like(v)], axis=-1)
        state = DriveState(
            f"trial_{k}",
            "index",
            t,
            x,
            v,
            np.zeros_like(v),
            np.zeros_like(v),
            declared,
            extra={"elapsed": t + 40.0 * k, "trial_index": np.full(len(t), float(k))},
            declared_names=NAMES,
            validate=k == trials - 1,
        )
        e = rng.normal(0, noise * np.sqrt(1 - colour**2), len(t))
        for i in range(1, len(e)):
            e[i] += colour * e[i - 1]
        effort = declared @ TRUTH + e + (0.0 if add is None else add(state))
        out.append(DriveState(**{**state.__dict__, "effort": np.where(moving, effort, np.nan)}))
    return tuple(out)


def _path(t: np.ndarray, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, v, at, way, k, i = np.zeros(len(t)), np.zeros(len(t)), 0.0, 1, 0, 0
    while i < len(t) - 1:
        speed = speeds[(k // 2) % len(speeds)]
        v[i] = way * speed
        at += v[i] * (t[i + 1] - t[i])
        if not 0 <= at <= 100:
            at, way, k = float(np.clip(at, 0, 100)), -way, k + 1
        i += 1
        x[i] = at
    v[-1] = v[-2]
    return x, v


def planted(name: str, shape: dict[str, float], amplitude: list[float]):
    return lambda state: effect(name).columns(state, shape) @ np.array(amplitude)


PLANTED = [
    ("stribeck_friction", {"stribeck_speed": 20.0}, [20.0]),
    ("position_dependent_friction", {"centre": 45.0, "width": 7.0}, [15.0]),
    ("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-10.0]),
    ("load_dependent_friction", {}, [0.12]),
    ("asymmetric_viscous_friction", {}, [0.06]),
    ("quadratic_damping", {}, [0.0015]),
    ("elastoplastic_hysteresis", {"form": 0.0, "reach": 15.0}, [10.0]),
    ("torque_ripple", {"period": 9.0}, [4.0, 3.0]),
    ("end_stop_contact", {"side": 1.0, "inward": 18.0, "end": 100.0}, [1.5]),
    ("thermal_friction_drift", {"form": 0.0, "warm_up_time": 60.0}, [12.0]),
    ("nonlinear_spring", {}, [2e-4, 1.5e-5]),
    ("nonlinear_spring", {"form": 1.0, "knee": 71.0}, [0.0, 0.7]),  # further out it would be a stop
    ("viscoelastic_spring", {"relaxation_time": 1.0}, [0.2]),
]


@pytest.mark.parametrize("told", [False, True])
def test_a_logged_temperature_explains_a_drift_where_it_follows_it_and_only_there(told: bool) -> None:
    """A sensor on the housing has a time constant of its own, and noise; another one sits where the friction is."""
    rng = np.random.default_rng(8)

    def housing(state: DriveState) -> np.ndarray:
        warming = 1 - np.exp(-state.elapsed_s / 15.0) if not told else np.sin(state.elapsed_s / 30.0) ** 2
        return np.round(24.0 + 6.0 * warming, 1)

    def friction(state: DriveState) -> np.ndarray:
        cold = (30.0 - housing(state)) / 6.0 if told else np.exp(-state.elapsed_s / 90.0)
        return 12.0 * state.direction * cold

    states = tuple(
        replace(s, extra={**s.extra, "temperature": housing(s) + rng.normal(0, 0.05, len(s.time_s))})
        for s in drive(3, friction)
    )
    (found,) = name_effects(states, catalogue("drive")).found
    assert found.term.effect.name == "thermal_friction_drift"
    assert (found.term.shape["form"] == 2.0) == told
    assert found.amplitudes["cold_excess"] == pytest.approx(12.0, rel=0.15)


@pytest.mark.parametrize(("name", "shape", "amplitude"), PLANTED, ids=[p[0] for p in PLANTED])
def test_planted_effect_is_named_alone_with_its_parameters(name, shape, amplitude) -> None:
    naming = name_effects(drive(3, planted(name, shape, amplitude)), catalogue("drive"))
    assert [f.term.effect.name for f in naming.found] == [name]
    entries = parameter_intervals(undisturbed(naming), 0)
    for key, value in shape.items():
        if "ci95" in entries.get(key, {}):
            low, high = entries[key]["ci95"]
            wide = 2 * (high - low)
            assert low - wide <= value <= high + wide, (key, entries[key])
    proof = held_out(undisturbed(naming), 0)
    assert proof["after"] < proof["before"]
    assert proof["after"] < 1.06 * proof["noise_floor"]
    assert proof["held_out"] == ["trial_3"]


def _read_as(form: float, amplitude: float, seed: int) -> list[float]:
    """Interval of the yield load of a gradual build-up read as one of form `form`."""
    balance = Balance(drive(seed, planted("elastoplastic_hysteresis", {"form": 1.0, "reach": 30.0}, [amplitude])))
    fit = polish(balance, balance.fit((Term(effect("elastoplastic_hysteresis"), {"form": form, "reach": 15.0}),)), 0)
    return parameter_intervals(Reading(balance, balance.fit(), fit), 0)["yield_load"]["ci95"]


def test_an_interval_knows_of_the_other_form_as_far_as_it_is_likely() -> None:
    low, high = _read_as(1.0, 12.0, 2)
    assert low < 12.0 < high < low + 3.0  # the strong one is told by its form: no wider than noise makes it
    weak = [_read_as(0.0, 5.0, seed) for seed in range(4)]
    assert sum(low < 5.0 < high for low, high in weak) >= 3  # read as the wrong form, but the right one has a say


def test_an_interval_is_that_of_the_mixture_of_forms() -> None:
    rng = np.random.default_rng(0)
    parts = [(0.2, 9.0, 4.0), (0.8, 3.0, 0.25)]
    drawn = np.where(rng.random(400000) < 0.2, rng.normal(9.0, 2.0, 400000), rng.normal(3.0, 0.5, 400000))
    for at in (0.025, 0.5, 0.975):
        assert abs(_quantile(parts, at) - np.quantile(drawn, at)) < 0.05
    assert abs(_quantile([(1.0, 2.0, 9.0)], 0.975) - (2.0 + 1.96 * 3.0)) < 1e-3
    # parameters that are as good as exact
    assert abs(_quantile([(0.1, 0.418, 0.0), (0.9, 0.408, 1e-30)], 0.975) - 0.418) < 1e-6


def test_a_form_that_does_not_tell_a_parameter_does_not_widen_its_interval_and_a_choice_has_none() -> None:
    balance = Balance(drive(5, planted("stribeck_friction", {"stribeck_speed": 22.0, "form": 0.0}, [20.0])))
    fit = polish(balance, balance.fit((Term(effect("stribeck_friction"), {"stribeck_speed": 22.0, "form": 0.0}),)), 0)
    told = parameter_intervals(Reading(balance, balance.fit(), fit), 0)
    low, high = told["static_excess"]["ci95"]
    assert 0 < low < told["static_excess"]["value"] < high and "ci95" not in told["exponent"]


@pytest.mark.parametrize("share", [0.08, 0.25, 0.45])
def test_readings_cut_at_a_limit_are_named_so_however_many_they_are(share: float) -> None:
    states = drive(3)
    limit = float(np.nanquantile(np.concatenate([np.abs(s.effort) for s in states]), 1 - share))
    naming = name_effects(
        tuple(replace(s, effort=np.clip(s.effort, -limit, limit)) for s in states), catalogue("drive")
    )
    assert [f.term.effect.name for f in naming.found] == ["current_saturation"]
    assert naming.found[0].term.shape["limit"] == pytest.approx(limit, rel=0.02)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.3])
def test_a_reading_that_clips_at_its_lower_end_only_is_told(share: float) -> None:
    states = drive(3)
    limit = float(-np.nanquantile(np.concatenate([s.effort for s in states]), share))
    cut = tuple(replace(s, effort=np.maximum(s.effort, -limit)) for s in states)
    naming = name_effects(cut, catalogue("drive"))
    assert [f.term.effect.name for f in naming.found] == ["current_saturation"]
    assert naming.found[0].term.shape["form"] == 2.0
    assert naming.found[0].term.shape["limit"] == pytest.approx(limit, rel=0.05)


def test_two_effects_are_both_named() -> None:
    one = planted("stribeck_friction", {"stribeck_speed": 20.0}, [20.0])
    two = planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-12.0])
    naming = name_effects(drive(5, lambda s: one(s) + two(s)), catalogue("drive"))
    assert {f.term.effect.name for f in naming.found} == {"stribeck_friction", "detent_load"}


@pytest.mark.parametrize("colour", [pytest.param(0.0, marks=pytest.mark.slow), 0.5])
def test_healthy_drives_stay_consistent(colour: float) -> None:
    alarms = [seed for seed in range(6) if not name_effects(drive(seed, colour=colour), catalogue("drive")).consistent]
    assert not alarms  # nominal rate 0.3 %


def test_noise_and_its_correlation_are_measured_beside_a_misfit() -> None:
    add = planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-12.0])
    white, red = Balance(drive(1, add)), Balance(drive(1, add, colour=0.5))
    assert white.inflation == 1.0 and abs(white.sigma / 5 - 1) < 0.06
    assert 2.0 < red.inflation < 4.2 and abs(red.sigma / 5 - 1) < 0.15  # AR(1), 0.5: (1 + r) / (1 - r) = 3


def test_noise_of_strokes_shorter_than_it_may_last_is_no_level_that_does_not_repeat() -> None:
    """Strokes of a fifth of a second, 240 readings in each, with a level of their own: white noise beside it."""
    rng = np.random.default_rng(9)
    step_s, count = 1 / 1200, 240
    x = np.concatenate([np.linspace(0, 100, count)[:: (-1) ** k] for k in range(60)])
    v = np.gradient(x) / step_s
    declared = np.stack([np.sign(v), x, np.ones_like(v)], axis=-1)
    effort = declared @ [30.0, 0.2, 5.0] + np.repeat(rng.normal(0, 1, 60), count) + rng.normal(0, 1, len(x))
    state = DriveState("t", "index", step_s * np.arange(len(x)), x, v, 0 * v, effort, declared)
    balance = Balance((state,))
    assert balance.inflation < 3.0 and balance.sigma == pytest.approx(1.0, rel=0.25)


def half_untouched(states: tuple[DriveState, ...]) -> tuple[DriveState, ...]:
    return tuple(replace(s, validate=k > 1) for k, s in enumerate(states))


@pytest.mark.parametrize("seed", [21, 24])
def test_a_faint_effect_needs_the_word_of_untouched_recordings(seed: int) -> None:
    faint = half_untouched(drive(seed, planted("load_dependent_friction", {}, [0.014])))
    healthy = half_untouched(drive(seed))
    borne_out, refuted = (
        judged("current", "index", "index", None, states, catalogue("drive"))
        for states in (faint, (*faint[:2], *healthy[2:]))
    )
    assert [f.term.effect.name for f in borne_out.kept] == ["load_dependent_friction"] and borne_out.believed
    assert not refuted.missing


@pytest.mark.parametrize("seed", [pytest.param(22, marks=pytest.mark.slow), 32])
def test_what_half_of_the_recordings_are_too_few_for_all_of_them_tell_and_each_half_bears_out(seed: int) -> None:
    faint, healthy = (
        half_untouched(drive(seed, planted("nonlinear_spring", {"form": 1.0, "knee": 50.0}, [0.0, size])))
        for size in (0.06, 0.0)
    )
    told, *others = (
        judged("current", "index", "index", None, states, catalogue("drive"))
        for states in (faint, (*faint[:2], *healthy[2:]), healthy)
    )
    assert [f.term.effect.name for f in told.kept] == ["nonlinear_spring"] and told.believed
    assert not told.naming.balance.untouched and not any(other.missing for other in others)


def test_what_only_starts_and_stops_tell_is_not_told_by_steady_motion() -> None:
    shape = {"form": 0.0, "reach": 4.0}
    at_starts = unsure_at_ends(drive(5, planted("elastoplastic_hysteresis", shape, [9.0])))
    everywhere = unsure_at_ends(drive(5, planted("torque_ripple", {"period": 9.0}, [4.0, 3.0])))
    for states, name, told in ((at_starts, "elastoplastic_hysteresis", False), (everywhere, "torque_ripple", True)):
        station = judged("current", "index", "index", None, states, (effect(name),))
        assert [f.term.effect.name for f in station.naming.found] == [name]
        assert station.steadily(station.naming.found[0]) == told


@pytest.mark.parametrize(("stiffness", "ripple", "stands"), [(3.0, 2.0, True), (1.0, 6.0, False)])
def test_what_only_starts_and_stops_tell_stands_beside_others_where_it_holds_its_part(
    stiffness: float, ripple: float, stands: bool
) -> None:
    """A stop that begins where motion turns; its size is then read there, too."""
    shape = {"side": 1.0, "inward": 8.0, "end": 100.0}

    def both(state: DriveState) -> np.ndarray:
        return planted("end_stop_contact", shape, [stiffness])(state) + planted(
            "torque_ripple", {"period": 9.0}, [ripple, 0.0]
        )(state)

    states = unsure_at_ends(drive(5, both))
    names = ("end_stop_contact", "torque_ripple")
    station = judged("current", "index", "index", None, states, tuple(effect(name) for name in names))
    assert {f.term.effect.name for f in station.naming.found} == set(names)
    assert {f.term.effect.name for f in station.kept} == (set(names) if stands else {"torque_ripple"})
    for place, figures in station.parameters.items():
        if station.naming.fit.terms[place].effect.name == "end_stop_contact":
            low, high = figures["stiffness"]["ci95"]
            assert low <= stiffness <= high and high - low < stiffness


def unsure_at_ends(states: tuple[DriveState, ...]) -> tuple[DriveState, ...]:
    """The states with the first and last tenth of each stroke as known to 4 raw only."""
    return tuple(replace(s, extra={**s.extra, "sigma": 4.0 * (np.abs(s.position - 50) > 40)}) for s in states)


def test_naming_never_reads_validation_recordings() -> None:
    states = drive(3, planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-12.0]))
    spoiled = (*states[:-1], DriveState(**{**states[-1].__dict__, "effort": states[-1].effort * 0 + 7.0}))
    a, b = Balance(states).fit(), Balance(spoiled)
    b.sigma, b.weight = Balance(states).sigma, Balance(states).weight
    assert a.declared == b.fit().declared


def test_bounded_least_squares_keeps_bounds_and_optimum() -> None:
    rng = np.random.default_rng(0)
    a = rng.normal(size=(200, 4))
    x = bounded_least_squares(a, a @ np.array([1.0, -2.0, 3.0, 0.5]), np.array([0, 0, -np.inf, 0]), np.full(4, np.inf))
    assert x[1] == 0 and (x[[0, 3]] > 0).all()
    gradient = a.T @ (a @ x - a @ np.array([1.0, -2.0, 3.0, 0.5]))
    np.testing.assert_allclose(gradient[[0, 2, 3]], 0, atol=1e-5)
    assert gradient[1] > 0  # pushing against its bound


def test_local_quadratic_is_exact_on_quadratics() -> None:
    t = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.03, 200))
    x, v, a = local_quadratic(t, 3 - 2 * t + 0.7 * t**2, 0.03)
    np.testing.assert_allclose(x, 3 - 2 * t + 0.7 * t**2, atol=1e-5)
    np.testing.assert_allclose(v, -2 + 1.4 * t, atol=1e-4)
    np.testing.assert_allclose(a, 1.4, atol=1e-2)


def test_motion_tells_rest_from_motion() -> None:
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.012, 0.024, 900))
    x = np.clip((t - 4) * 30, 0, 100) + rng.normal(0, 0.09, len(t))
    motion = estimate_motion(t, x)
    assert not motion.moving[t < 3.8].any()
    assert motion.moving[(t > 4.2) & (t < 7.1)].all()
    assert abs(np.median(motion.velocity[(t > 4.3) & (t < 7)]) - 30) < 0.5


def test_findings_are_json_without_nan(tmp_path: Path) -> None:
    finding = Finding(
        "stribeck_friction",
        ("stribeck_friction",),
        0.9,
        (("quadratic_damping", 0.1),),
        {"finger": "index"},
        "text",
        {"static_ratio": {"value": float("nan"), "unit": "1"}},
        {"before": np.float64(2.0)},
    )
    path = Findings("mismatch", {"before": 2.0}, {}, (finding,)).save(tmp_path / "new")
    read = json.loads(path.read_text())
    assert read["format"] == "hand-findings/1" and read["findings"][0]["class"] == ["stribeck_friction"]
    assert read["findings"][0]["parameters"]["static_ratio"]["value"] is None


@pytest.mark.skipif(not SHARED.is_dir(), reason="shared sessions are not here")
@pytest.mark.parametrize("name", ["shown_00", "shown_04"])
def test_shown_sessions(name: str, tmp_path: Path) -> None:
    answer = json.loads((SHARED / name / "answer.json").read_text())["effects"]
    shares: list[float] = []
    findings = diagnose(SHARED / name, output=tmp_path, progress=shares.append)
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] == 1.0
    assert len(shares) > 4
    named = [(f.effect, f.where["finger"], f.where["joint"]) for f in findings.findings]
    assert named == [(e["effect"], e["finger"], e["joint"]) for e in answer if e["effect"] != "none"]
    assert json.loads((tmp_path / "findings.json").read_text())["verdict"] == findings.verdict


@pytest.mark.parametrize("burst", [False, True], ids=["coloured", "bursts"])
def test_lack_of_fit_keeps_its_level_on_dirty_healthy_drives(burst: bool) -> None:
    """Coloured noise that differs over the range, strokes that do not repeat, bursts of outliers: 24 drives, nominal 5
    %."""
    from hand_model.diagnose.name.lack_of_fit import lack_of_fit

    alarms = 0
    for seed in range(24):
        rng = np.random.default_rng(100 + seed)

        def dirt(state: DriveState, rng=rng) -> np.ndarray:
            slow = np.interp(state.time_s, np.arange(0, 60, 0.6), rng.normal(0, 1.2, 100))
            hit = np.zeros(len(state.time_s))
            for at in rng.integers(0, len(hit), 5 if burst else 0):
                hit[at : at + 12] = rng.normal(0, 15)
            return slow * (1 + state.position / 100) + hit

        balance = Balance(drive(seed, dirt, colour=0.4, trials=3))
        alarms += lack_of_fit(balance, balance.fit().prediction, 5, 0.05).p < 0.05
    assert alarms <= 4  # binomial(24, 0.05): more with probability 3 %


def test_lack_of_fit_sees_what_repeats_from_stroke_to_stroke() -> None:
    from hand_model.diagnose.name.lack_of_fit import lack_of_fit

    bump = planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-8.0])
    balance = Balance(drive(2, bump, colour=0.4, trials=3))
    assert lack_of_fit(balance, balance.fit().prediction, 5, 0.003).p < 1e-4


def test_what_effects_explain_of_strokes_is_no_unrest_of_the_model_without_them() -> None:
    """A recording of another level makes its strokes differ from their replicates: that is mismatch, not pure error."""
    from hand_model.diagnose.name.lack_of_fit import lack_of_fit

    states = drive(5, lambda state: np.full(len(state.time_s), 20.0 * state.validate), trials=3)
    balance = Balance(states, everything=True)
    shifted = balance.gather(lambda s: np.full(len(s.time_s), 20.0 * s.validate))
    declared = balance.fit().prediction
    after = lack_of_fit(balance, declared - 20.0 / 3 + shifted, 6, 0.003)
    alone, together = lack_of_fit(balance, declared, 5, 0.003), lack_of_fit(balance, declared, 5, 0.003, after.unrest)
    assert after.unrest < 0.1 * alone.unrest and together.excess > 3 * alone.excess
    assert (together.p, together.unrest) == (alone.p, alone.unrest)  # what is a false alarm is asked as before


def test_what_a_spring_is_bent_by_has_an_interval() -> None:
    naming = name_effects(drive(6, planted("nonlinear_spring", {"form": 0.0}, [2e-4, 1.5e-5])), catalogue("drive"))
    which = next(i for i, t in enumerate(naming.fit.terms) if t.effect.name == "nonlinear_spring")
    bend = parameter_intervals(undisturbed(naming), which)["bend"]
    x = np.linspace(0, 100, 101)
    load = 2e-4 * x**2 + 1.5e-5 * x**3
    truth = 0.5 * float(np.ptp(load - np.polyval(np.polyfit(x, load, 1), x)))
    low, high = bend["ci95"]
    assert bend["unit"] == "raw" and low < truth < high and high - low < truth


def test_held_out_is_empty_where_validation_took_part() -> None:
    add = planted("detent_load", {"form": 0.0, "centre": 60.0, "width": 6.0}, [-10.0])
    plain = name_effects(drive(3, add), catalogue("drive"))
    assert (
        held_out(undisturbed(plain), 0)["held_out"] == ["trial_3"]
        and held_out(undisturbed(plain), 0)["ci95_reduction"][0] > 0
    )
    from dataclasses import replace

    everything = replace(plain, balance=Balance(plain.balance.states, everything=True))
    assert held_out(undisturbed(everything), 0)["held_out"] == []


def test_two_waves_of_nearly_one_period_are_one() -> None:
    ripple, spring = effect("torque_ripple"), effect("nonlinear_spring")

    def waves(*periods: float) -> tuple[Term, ...]:
        return (
            Term(spring, {"form": 0.0, "knee": 40.0}),
            *(Term(ripple, {"period": p, "unseen": 0.0}) for p in periods),
        )

    assert doubled(waves(30.277, 9.9, 30.278), 90.0) and doubled(waves(8.0, 8.1), 100.0)
    assert not doubled(waves(30.0, 15.0, 10.0), 90.0) and not doubled(waves(8.0), 100.0)


def test_a_recording_kept_out_that_is_louder_is_held_against_its_own_noise() -> None:
    """A true effect leaves it no farther above its noise than the others."""
    states = drive(21, planted("torque_ripple", {"period": 9.0}, [2.0, 1.5]), noise=4.0)
    hiss = np.random.default_rng(5).normal(0, 3.0, len(states[-1].effort))
    louder = replace(states[-1], effort=states[-1].effort + hiss)
    station = judged("current", "index", "index", None, (*states[:-1], louder), (effect("torque_ripple"),))
    before, after = station._kept_out
    assert after < 1.05 < before
    assert station.believed and [f.term.effect.name for f in station.kept] == ["torque_ripple"]


@pytest.mark.parametrize(("after", "believed"), [(1.37, False), (1.02, True)])
def test_names_that_leave_a_recording_kept_out_above_its_noise_are_not_believed(
    after: float, believed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither where the test of cells sees nothing: what comes now and then is at no place, speed and direction."""
    states = drive(21, planted("torque_ripple", {"period": 5.0}, [0.75, 0.56]), noise=4.0)
    station = judged("current", "index", "index", None, states, (effect("torque_ripple"),))
    assert station.naming.before.p >= ALPHA and station.proven  # else this test tells nothing
    monkeypatch.setattr(Station, "_kept_out", (1.44, after))
    assert station.believed == believed


def test_what_relaxes_while_a_motion_starts_is_no_spring() -> None:
    """A branch that relaxes within a few samples is viscous friction, told apart only where instants are doubtful."""
    states = drive(1, trials=2)
    step = float(np.median(np.diff(states[0].time_s)))
    (relaxation,) = effect("viscoelastic_spring").shapes(states)
    assert relaxation.low > 14 * step and min(relaxation.starts) > relaxation.low
