"""Findings of several stations beside each other."""

from __future__ import annotations

import pytest

from hand_model.diagnose.assemble import _shared, _without_shadows, _without_tilts
from hand_model.diagnose.findings import Finding, weighed


def periodic(effect: str, actuator: str, period: float) -> tuple[float, Finding]:
    where = {"finger": actuator, "actuator": actuator, "joint": None, "signal": "current", "marker": None, "trials": []}
    return 1.0, Finding(effect, (effect,), 1.0, (), where, "", {"period": {"value": period, "unit": "%"}}, {}, None)


@pytest.mark.parametrize(("period", "motor", "stays"), [(10.8, "index", False), (3.62, "index", False), (8.1, "index", True),
                                                        (3.62, "ring", True), (21.6, "index", True)])
def test_a_ripple_at_a_harmonic_of_the_same_encoders_error_is_its_shadow(period: float, motor: str, stays: bool) -> None:
    error, ripple = periodic("encoder_periodic_error", "index", 10.79), periodic("torque_ripple", motor, period)
    assert _without_shadows([error, ripple]) == ([error, ripple] if stays else [error])


def test_a_better_sensor_alone_does_not_put_an_effect_first() -> None:
    strong, faint = 12.0, 1.5  # per cent of what the channel tells
    assert weighed(strong * 0.1, 10.0) > weighed(faint * 1.0, 100.0)
    assert weighed(strong * 0.1, 10.0) == pytest.approx((strong * 0.1 * strong * 0.01) ** 0.5)


def test_without_an_encoder_error_every_ripple_stays() -> None:
    ripples = [periodic("torque_ripple", "index", 5.0), periodic("torque_ripple", "index", 10.0)]
    assert _without_shadows(ripples) == ripples


def test_a_small_load_beside_an_encoder_error_of_the_same_motor_is_its_shadow_and_a_large_one_is_none() -> None:
    error, (_, load) = periodic("encoder_periodic_error", "index", 15.1), periodic("detent_load", "index", 1.0)
    assert _without_shadows([error, (0.2, load)]) == [error]
    assert _without_shadows([error, (0.8, load)]) == [error, (0.8, load)]
    assert _without_shadows([error, (0.08, periodic("detent_load", "ring", 1.0)[1])])[1:]


def test_a_trifle_in_the_angles_of_a_finger_whose_joint_wobbles_is_no_finding_and_another_finger_s_is() -> None:
    wobble, (_, lead) = periodic("joint_wobble", "index", 1.0), periodic("spring_decoupling", "index", 1.0)
    drift, other = periodic("clock_drift", "index", 1.0), periodic("spring_decoupling", "ring", 1.0)[1]
    assert _without_tilts([wobble, (0.1, lead)]) == [wobble]
    assert len(_without_tilts([wobble, (0.4, lead), (0.1, drift[1]), (0.1, other)])) == 4


def with_share(weight: float, effect: str, finger: str, signal: str, share: float) -> tuple[float, Finding]:
    where = {"finger": finger, "actuator": finger, "joint": None, "signal": signal, "marker": None, "trials": [], "share_of_mismatch": share}
    return weight, Finding(effect, (effect,), 1.0, (), where, "", {}, {}, None)


def test_shares_of_the_mismatch_are_ranked_as_the_findings_and_are_those_of_the_whole_session() -> None:
    ranked = [with_share(1e9, "command_as_measurement", "ring", "current", 1.0), with_share(2.0, "detent_load", "index", "current", 0.7),
              with_share(1.0, "marker_slip", "index", "markers", 1.0)]
    shares = [f.where["share_of_mismatch"] for f in _shared(ranked)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == shares[1] == pytest.approx(4 * shares[2])
    assert sum(shares) == pytest.approx((4 * 1.0 + 4 * 0.7 + 1 * 1.0) / 9)
    alone = _shared([with_share(2.0, "detent_load", "index", "current", 0.7)])
    assert alone[0].where["share_of_mismatch"] == pytest.approx(0.7)
