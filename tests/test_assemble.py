"""Findings of several stations beside each other."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hand_model.diagnose.assemble import (
    COMPARED,
    _beneath,
    _countable,
    _counted,
    _echoes,
    _leave_something,
    _of_hinges,
    _one_clock,
    _shared,
    _shown_in,
    _sure_sizes,
    _without_shadows,
    assemble,
)
from hand_model.diagnose.doubtful import refuted, without_refuted
from hand_model.diagnose.findings import Finding, of_one_whole, weighed
from hand_model.diagnose.hearing import _without_settled_sags
from hand_model.diagnose.locate.answers import Answers
from hand_model.diagnose.locate.command import CommandFacts
from hand_model.diagnose.locate.displacement import NO_HINGE
from hand_model.diagnose.locate.preload import COMPARISON
from hand_model.diagnose.locate.strokes import Loss
from hand_model.diagnose.magnitude import magnitude
from hand_model.effects import effect, outsiders


def periodic(effect: str, actuator: str, period: float) -> tuple[float, Finding]:
    where = {"finger": actuator, "actuator": actuator, "joint": None, "signal": "current", "marker": None, "trials": []}
    return 1.0, Finding(effect, (effect,), 1.0, (), where, "", {"period": {"value": period, "unit": "%"}}, {}, None)


@pytest.mark.parametrize(
    ("period", "motor", "stays"),
    [(10.8, "index", False), (3.62, "index", False), (8.1, "index", True), (3.62, "ring", True), (21.6, "index", True)],
)
def test_a_ripple_at_a_harmonic_of_the_same_encoders_error_is_its_shadow(
    period: float, motor: str, stays: bool
) -> None:
    error, ripple = periodic("encoder_periodic_error", "index", 10.79), periodic("torque_ripple", motor, period)
    assert _without_shadows([error, ripple], []) == ([error, ripple] if stays else [error])


@pytest.mark.parametrize(("amplitude", "stays"), [(9.5, True), (0.3, False)])
def test_a_ripple_larger_than_an_encoders_error_makes_is_no_shadow_of_it(amplitude: float, stays: bool) -> None:
    def sized(effect: str, amplitude: float) -> tuple[float, Finding]:
        weight, finding = periodic(effect, "index", 11.0)
        return weight, replace(
            finding, parameters={**finding.parameters, "amplitude": {"value": amplitude, "unit": ""}}
        )

    # half of 0.2 % at 45 %/s makes 0.1 (0.2 + 0.2 w + 0.015 w^2) raw, w = 2 pi 45 / 11 /s: 1.5
    velocity = np.full(9, 45.0)
    declared = {"spring": 0.2, "viscous": 0.2, "inertia": 0.015}
    balance = SimpleNamespace(gather=lambda read: read(SimpleNamespace(velocity=velocity)))
    naming = SimpleNamespace(balance=balance, fit=SimpleNamespace(declared=declared))
    station = SimpleNamespace(signal="current", finger="index", actuator="index", naming=naming)
    error, ripple = sized("encoder_periodic_error", 0.2), sized("torque_ripple", amplitude)
    assert _echoes(ripple[1], error[1], [station]) is not stays


def test_a_better_sensor_alone_does_not_put_an_effect_first() -> None:
    strong, faint = 12.0, 1.5  # per cent of what the channel tells
    assert weighed(strong * 0.1, 10.0) > weighed(faint * 1.0, 100.0)
    assert weighed(strong * 0.1, 10.0) == pytest.approx((strong * 0.1 * strong * 0.01) ** 0.5)


def test_without_an_encoder_error_every_ripple_stays() -> None:
    ripples = [periodic("torque_ripple", "index", 5.0), periodic("torque_ripple", "index", 10.0)]
    assert _without_shadows(ripples, []) == ripples


def test_a_small_load_beside_an_encoder_error_of_the_same_motor_is_its_shadow_and_a_large_one_is_none() -> None:
    error, (_, load) = periodic("encoder_periodic_error", "index", 15.1), periodic("detent_load", "index", 1.0)
    small, large = (replace(load, parameters={"load": {"value": value, "unit": "raw"}}) for value in (0.1, 10.0))
    assert _without_shadows([error, (0.2, small)], []) == [error]
    assert _without_shadows([error, (0.2, large)], []) == [error, (0.2, large)]  # for one of its kind
    assert _without_shadows([error, (0.8, load)], []) == [error, (0.8, load)]
    assert _without_shadows([error, (0.08, periodic("detent_load", "ring", 1.0)[1])], [])[1:]


def with_share(weight: float, effect: str, finger: str, signal: str, share: float) -> tuple[float, Finding]:
    where = {
        "finger": finger,
        "actuator": finger,
        "joint": None,
        "signal": signal,
        "marker": None,
        "trials": [],
        "share_of_mismatch": share,
    }
    return weight, Finding(effect, (effect,), 1.0, (), where, "", {}, {}, None)


def test_shares_of_the_mismatch_are_ranked_as_the_findings_and_are_those_of_the_whole_session() -> None:
    ranked = [
        with_share(1e9, "command_as_measurement", "ring", "current", 1.0),
        with_share(2.0, "detent_load", "index", "current", 0.7),
        with_share(1.0, "marker_slip", "index", "markers", 1.0),
    ]
    shares = [f.where["share_of_mismatch"] for f in _shared(ranked)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == shares[1] == pytest.approx(4 * shares[2])
    assert sum(shares) == pytest.approx((4 * 1.0 + 4 * 0.7 + 1 * 1.0) / 9)
    alone = _shared([with_share(2.0, "detent_load", "index", "current", 0.7)])
    assert alone[0].where["share_of_mismatch"] == pytest.approx(0.7)


FIT = {"metric": "current_rmse", "unit": "raw", "before": 2.0, "after": 1.0, "noise_floor": 1.0, "held_out": []}


def finding(effect: str, finger: str, signal: str, **parameters: float) -> Finding:
    where = {
        "finger": finger,
        "joint": None,
        "actuator": finger,
        "signal": signal,
        "marker": None,
        "trials": [],
        "region": None,
        "share_of_mismatch": 1.0,
    }
    return Finding(
        effect, (effect,), 1.0, (), where, "", {k: {"value": v, "unit": "1"} for k, v in parameters.items()}, FIT
    )


def names(*weighted: tuple[float, Finding]) -> list[str]:
    return [f.effect for f in assemble([], list(weighted), []).findings]


def test_a_slip_of_a_tenth_comes_after_a_plain_friction_however_sharp_the_cameras_are() -> None:
    slip, drag = (
        finding("marker_slip", "index", "markers", distance=2e-4),
        finding("load_dependent_friction", "index", "current", load_coefficient=0.4),
    )
    assert names((0.2, slip), (0.1, drag)) == ["load_dependent_friction", "marker_slip"]
    full = finding("marker_slip", "index", "markers", distance=2e-3)
    assert names((2.0, full), (0.1, drag)) == ["marker_slip", "load_dependent_friction"]


def test_one_effect_of_one_drive_is_one_finding() -> None:
    speed, torque = (
        finding("drive_sag", "index", "command", sag=0.002),
        finding("drive_sag", "index", "current", torque_loss=0.3),
    )
    findings = assemble([], [(0.1, speed), (0.3, torque)], []).findings
    assert [f.where["signal"] for f in findings] == ["current"]
    assert names((0.1, speed), (0.3, finding("drive_sag", "ring", "current", torque_loss=0.3))) == [
        "drive_sag",
        "drive_sag",
    ]


def test_a_trifle_beside_a_large_effect_is_no_finding_but_is_said() -> None:
    main, trifle = (
        finding("clock_drift", "index", "log", rate_minus_one=2e-3),
        finding("current_channel_delay", "index", "current", delay=0.004),
    )
    found = assemble([], [(1.0, main), (0.01, trifle)], [])
    assert [f.effect for f in found.findings] == ["clock_drift"]
    assert [r["effect"] for r in found.rejected] == ["current_channel_delay"] and "trifle" in found.rejected[0][
        "reason"
    ]
    for delay, named in ((0.004, []), (0.06, ["current_channel_delay"])):  # and of another, which may be healthy
        elsewhere = finding("current_channel_delay", "ring", "current", delay=delay)
        assert names((1.0, main), (0.01, elsewhere)) == ["clock_drift", *named]
    assert names((1.0, main), (0.01, finding("current_channel_delay", "index", "current", delay=0.06))) == [
        "clock_drift",
        "current_channel_delay",
    ]


@pytest.mark.parametrize(("rate", "verdict"), [(0.9e-4, "consistent"), (-0.9e-4, "consistent"), (-2e-4, "mismatch")])
def test_clocks_that_part_as_two_healthy_crystals_do_are_no_fault(rate: float, verdict: str) -> None:
    found = assemble([], [(1.0, finding("clock_drift", "index", "log", rate_minus_one=rate))], [])
    assert found.verdict == verdict
    assert [r["effect"] for r in found.rejected] == (["clock_drift"] if verdict == "consistent" else [])


def test_what_one_recording_had_is_no_form_of_what_a_hand_always_has() -> None:
    main = finding("elastoplastic_hysteresis", "index", "current", yield_load=30.0)
    small = {"begin": 90.0, "stiffness": 0.01}
    passing, lasting = (finding(name, "index", "current", **small) for name in ("external_contact", "end_stop_contact"))
    assert names((1.0, main), (0.01, passing)) == ["elastoplastic_hysteresis", "external_contact"]
    assert names((1.0, main), (0.01, lasting)) == ["elastoplastic_hysteresis"]
    swapped = finding("marker_swap", "index", "markers", lasting=0.04)  # which no file of `effects` describes
    assert names((1.0, main), (0.01, swapped)) == ["elastoplastic_hysteresis"]


def told(after: float, fall: list[float]) -> Finding:
    """A give after whose compiled files an error of 0.12 is another, by the noise of 0.1."""
    fit = {"before": 0.12, "after": after, "ci95_reduction": fall, "noise_floor": 0.1, "held_out": ["log/b.csv"]}
    return replace(finding("series_elasticity", "index", "encoder", form=0.0, compliance=0.01), fit={**FIT, **fit})


def test_what_recordings_kept_out_refute_is_unexplained() -> None:
    drag, worse = finding("quadratic_damping", "ring", "current", drag=0.01), told(0.46, [-0.62, -0.03])
    found = assemble([], [(1.0, drag)], [])
    rest = without_refuted(replace(found, findings=(drag, told(0.1, [0.01, 0.03]))))
    assert [f.effect for f in rest.findings] == ["quadratic_damping", "series_elasticity"] and not rest.unexplained
    for fit_of in (told(0.13, [-0.03, 0.01]), told(0.104, [-0.03, -0.01])):  # not for sure, or within the noise
        assert not refuted(fit_of)
    both = without_refuted(replace(rest, findings=(drag, worse)))
    assert [f.effect for f in both.findings] == ["quadratic_damping"] and both.verdict == "mismatch"
    alone = without_refuted(replace(rest, findings=(worse,)))
    assert alone.verdict == "unexplained" and "series elasticity" in alone.unexplained[0]["shape"]
    assert alone.rejected[-1]["effect"] == "series_elasticity"
    assert names((1.0, drag), (0.5, worse)) == ["quadratic_damping"]  # nor does it stand among others before


def test_exchanged_labels_make_no_trifle_of_what_a_current_shows() -> None:
    main, small = (
        finding("marker_swap", "index", "markers", lasting=4.0),
        finding("current_channel_delay", "index", "current", delay=0.004),
    )
    assert {f.effect for f in assemble([], [(1.0, main), (0.01, small)], []).findings} == {
        "marker_swap",
        "current_channel_delay",
    }


def test_where_no_finger_is_a_hinge_to_the_cameras_angles_tell_nothing() -> None:
    bent = [
        {"where": {"finger": f}, "shape": f"{NO_HINGE}: the markers leave it", "share_of_mismatch": 1.0}
        for f in ("index", "ring")
    ]
    ranked = [
        with_share(1.0, "linkage_backlash", "index", "markers", 1.0),
        with_share(0.5, "joint_wobble", "ring", "markers", 1.0),
        with_share(0.5, "stribeck_friction", "index", "current", 1.0),
        with_share(0.5, "linkage_backlash", "little", "markers", 1.0),
    ]
    assert _of_hinges(ranked, bent) == ranked[2:]
    # one finger has none: whether its angles tell anything, what they leave says
    assert _of_hinges(ranked, bent[:1]) == ranked


@pytest.mark.parametrize(
    ("finger", "signal", "p", "explained", "other", "doubtful"),
    [
        ("index", "markers", 1e-9, 0.8, 0.5, True),
        ("index", "encoder", 1e-9, 0.8, 0.5, True),
        ("index", "markers", 0.2, 0.8, 0.5, False),
        ("index", "markers", 0.2, 0.8, 1e-9, True),
        ("index", "markers", 1e-9, 0.99, 0.5, False),  # a play of which the test sees a hundredth still
        ("index", "markers", 1e-9, 0.99, 1e-9, True),
        ("index", "current", 1e-9, 0.8, 0.5, False),
        ("ring", "markers", 0.2, 0.8, 1e-9, False),
    ],
)
def test_angles_of_markers_that_leave_segments_or_hinge_need_names_that_leave_nothing(
    finger: str, signal: str, p: float, explained: float, other: float, doubtful: bool
) -> None:
    """At no station of that finger's angles: other is the p of the index's other one."""

    def station(finger: str, signal: str, p: float, explained: float = 0.8) -> SimpleNamespace:
        naming = SimpleNamespace(after=SimpleNamespace(p=p))
        return SimpleNamespace(finger=finger, signal=signal, naming=naming, explained=explained)

    asked = station(finger, signal, p, explained)
    every = [asked, station("index", "encoder", other), station("index", "current", 1e-9)]
    assert _leave_something(asked, every) is doubtful


@pytest.mark.parametrize(
    ("loose", "soft", "left", "counts"),
    [
        ((), (), True, {"clock_drift", "drive_backlash"}),
        (("index",), (), False, {"clock_drift", "drive_backlash"}),
        (("index",), (), True, {"clock_drift"}),
        (("index",), ("index",), True, None),
    ],
)
def test_beside_markers_that_leave_their_hinge_with_the_angle_a_clock_still_drifts(
    monkeypatch: pytest.MonkeyPatch, loose: tuple[str, ...], soft: tuple[str, ...], left: bool, counts: set[str] | None
) -> None:
    monkeypatch.setattr("hand_model.diagnose.assemble._leave_something", lambda *_: left)
    kept = tuple(SimpleNamespace(term=SimpleNamespace(effect=effect(n))) for n in ("clock_drift", "drive_backlash"))
    told = _countable(SimpleNamespace(finger="index", kept=kept), [], loose, soft)
    assert (told and {f.term.effect.name for f in told}) == counts


@pytest.mark.parametrize(
    ("named", "figures", "believed", "stays"),
    [
        ("drive_sag", {}, True, False),
        ("current_saturation", {}, True, False),
        ("drive_sag", {}, False, True),
        ("stribeck_friction", {}, True, True),
        ("load_dependent_friction", {"load_coefficient": {"value": 0.4}}, True, False),
        ("load_dependent_friction", {"load_coefficient": {"value": 0.05}}, True, True),
    ],
)
def test_a_loss_of_speed_is_named_once_and_not_where_the_current_is_cut_or_friction_grows_with_the_load(
    named: str, figures: dict[str, dict[str, float]], believed: bool, stays: bool
) -> None:
    term = SimpleNamespace(effect=effect(named), shape={"limit": 60.0})
    naming = SimpleNamespace(fit=SimpleNamespace(terms=(term,)))
    kept = [SimpleNamespace(term=term)]
    facts = {"index": CommandFacts(Answers(np.zeros(0), np.zeros(0), 0.018), Loss(), Loss())}
    station = SimpleNamespace(actuator="index", believed=believed, kept=kept, naming=naming, parameters={0: figures})
    mine, other = (
        (1.0, finding("drive_sag", "index", "command", sag=0.1)),
        (1.0, finding("drive_sag", "ring", "command", sag=0.1)),
    )
    late = (1.0, finding("command_delay", "index", "command", delay=0.05))
    assert _without_settled_sags([mine, other, late], [station], facts) == ([mine] if stays else []) + [other, late]


def test_a_log_whose_clock_jumps_in_one_finger_drifts_in_none() -> None:
    drifts = [(1.0, finding("clock_drift", name, "log", rate_minus_one=3e-3)) for name in ("index", "ring")]
    late = (2.0, finding("current_channel_delay", "ring", "current", delay=0.05))
    wander, vibration = (
        SimpleNamespace(term=SimpleNamespace(effect=next(e for e in outsiders(station) if e.name == name)))
        for station, name in (("encoder", "clock_wander"), ("drive", "vibration"))
    )
    assert [f.effect for _, f in _one_clock([*drifts, late], [vibration])] == ["current_channel_delay", "clock_drift"]
    assert _one_clock([*drifts, late], [vibration, wander]) == [late]


def test_a_session_without_a_balance_claims_no_figures() -> None:
    found = assemble([], [], [])
    assert found.verdict == "consistent"
    assert found.lack_of_fit == {"before": None, "after": None, "limit": None}
    assert found.protocol == {"repeats": 0, "rate_hz": None, "speeds": 0, "isolable": [], "not_isolable": []}


@pytest.mark.parametrize(("engine", "first"), [(COMPARISON, "marker_slip"), ("another", "asymmetric_friction")])
def test_what_only_other_motors_tell_ranks_behind_what_the_recordings_show(engine: str, first: str) -> None:
    found = [
        (1.0, finding("asymmetric_friction", "index", "current")),
        (0.5, finding("marker_slip", "index", "markers")),
    ]
    found[0] = (1.0, replace(found[0][1], fit={"engine": engine}))
    assert assemble([], found, []).findings[0].effect == first


@pytest.mark.parametrize(("p", "least"), [(0.5, 0.15), (0.005, 0.05), (0.0025, 0.05), (1e-5, 0.0)])
@pytest.mark.parametrize(("signal", "steady"), [("current", True), ("current", False), ("encoder", True)])
def test_the_less_a_test_sees_the_larger_must_a_finding_be_for_its_kind(
    p: float, least: float, signal: str, steady: bool
) -> None:
    """One of fifteen channels falls below a three hundredth by chance. What a motor's steady motion tells is no error of
    how it is read."""
    station = SimpleNamespace(
        naming=SimpleNamespace(before=SimpleNamespace(p=p)), signal=signal, steadily=lambda _: steady
    )
    faint, plain = (SimpleNamespace(evidence=value) for value in (20.0, 40.0))
    assert _beneath(station, faint) == (0.0 if signal == "current" and steady else least)
    assert _beneath(station, plain) == (0.0 if signal == "current" and steady else min(least, 0.05))


@pytest.mark.parametrize(("probability", "stands"), [(0.98, False), (0.999, True)])
@pytest.mark.parametrize("others", [(), ("marker_slip",)])
def test_what_only_other_motors_tell_must_be_sure(probability: float, stands: bool, others: tuple[str, ...]) -> None:
    """Of 260 healthy hands three had a motor that was unlike the others by chance, at 0.97 to 0.99."""
    odd = replace(finding("asymmetric_friction", "index", "current"), fit={"engine": COMPARISON})
    found = [(0.5, finding(name, "index", "markers")) for name in others]
    result = assemble([], [*found, (1.0, replace(odd, probability=probability))], [])
    assert [f.effect for f in result.findings] == [*others, *(["asymmetric_friction"] if stands else [])]
    assert any("only the hand's other motors" in r["reason"] for r in result.rejected) != stands


@pytest.mark.parametrize(("engine", "accounts"), [("strokes", 0), ("another", 1)])
def test_what_a_limit_of_the_drive_cuts_is_told_by_its_strokes_alone(
    monkeypatch: pytest.MonkeyPatch, engine: str, accounts: int
) -> None:
    """Slowed down, a motor never needs more."""
    monkeypatch.setattr("hand_model.diagnose.assemble.channel_figures", lambda states, *told, stiffness: len(told))
    monkeypatch.setattr(
        "hand_model.diagnose.assemble._showing",
        lambda *_: SimpleNamespace(naming=SimpleNamespace(balance=SimpleNamespace(states=()))),
    )
    monkeypatch.setattr("hand_model.diagnose.assemble._accounts", lambda *_: ({},))
    monkeypatch.setattr("hand_model.diagnose.assemble._stiffness", lambda _: 0.0)
    ceiling = replace(finding("current_saturation", "index", "current"), fit={"engine": engine})
    assert _shown_in(ceiling, []) == accounts


def test_what_only_other_drives_size_hardly_counts_in_the_ranking() -> None:
    own = Finding("gravity_load", ("gravity_load",), 1.0, (), {"finger": "index"}, "", {}, {"engine": "mujoco"}, None)
    station = SimpleNamespace(compared=("gravity_load",), names=lambda finding: finding.where["finger"] == "index")
    assert _counted(own, [station]) == COMPARED
    assert _counted(replace(own, where={"finger": "ring"}), [station]) == 1.0
    assert _counted(replace(own, effect="detent_load"), [station]) == 1.0
    assert _counted(replace(own, fit={"engine": COMPARISON}), []) == COMPARED


@pytest.mark.parametrize(("least", "share"), [(0.0, 0.25), (0.9, 0.9)])
def test_a_finding_ranks_by_its_figures_or_by_what_recordings_kept_out_bear_out_of_it(
    least: float, share: float
) -> None:
    """A rise of friction that is higher where it is narrower: each figure alone is hardly known."""
    figures = {
        "static_excess": {"value": 0.4, "ci95": [0.1, 0.7]},
        "stribeck_speed": {"value": 10.0, "ci95": [10.0, 10.0]},
    }
    # the error of recordings kept out falls by `least` squared of its fall for sure
    after, before = 1.0, 2.0
    fall = before - (before**2 - least**2 * (before**2 - after**2)) ** 0.5
    fit = {"before": before, "after": after, "ci95_reduction": [fall, 2.0]}
    where = {"finger": "index", "actuator": "index", "joint": None, "signal": "current", "marker": None, "trials": []}
    found = Finding("stribeck_friction", ("stribeck_friction",), 1.0, (), where, "", figures, fit, None)
    whole = magnitude("stribeck_friction", {"static_excess": 0.4, "stribeck_speed": 10.0})
    assert _sure_sizes(found, None)[0] == pytest.approx(share * whole)
    stop = {"begin": {"value": 80.0}, "stiffness": {"value": 0.01, "ci95": [0.0025, 0.0175]}}
    ended = replace(found, effect="end_stop_contact", parameters=stop)
    of_stop = magnitude("end_stop_contact", {"begin": 80.0, "stiffness": 0.01})
    assert _sure_sizes(ended, None)[0] == pytest.approx(0.25 * of_stop)


def test_the_lack_of_fit_is_that_of_the_markers_where_these_alone_lack_something() -> None:
    fit = {"metric": "marker_rmse", "unit": "m", "before": 2.4e-4, "after": 1.1e-4, "noise_floor": 1e-4}
    wobble = replace(finding("joint_wobble", "index", "markers", amplitude=0.02), fit=fit)
    lack = assemble([], [(0.3, wobble)], []).lack_of_fit
    assert lack["before"] == pytest.approx(2.4**2) and lack["after"] == pytest.approx(1.1**2)


def test_findings_and_what_is_unexplained_are_parts_of_one_mismatch() -> None:
    slips = [finding("marker_slip", name, "markers", distance=1e-3) for name in ("index", "ring")]
    other = {"where": {"finger": "middle"}, "share_of_mismatch": 0.5, "shape": "varies with speed"}
    shared, left = of_one_whole(slips, [other])
    assert [f.where["share_of_mismatch"] for f in shared] == pytest.approx([0.4, 0.4])
    assert left[0]["share_of_mismatch"] == pytest.approx(0.2)
    assert of_one_whole(slips[:1], []) == ((slips[0],), ())
