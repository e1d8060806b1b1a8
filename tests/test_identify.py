"""Session to hand: clocks, maps, frames, probe, and whole recordings of the twin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_model.errors import IdentificationError
from hand_model.hand import load_hand
from hand_model.identify import identify, identify_all
from hand_model.identify.clock import align
from hand_model.identify.frames import palm_frame, palm_rotation
from hand_model.identify.mapping import counts_at
from hand_model.identify.polynomial import cycles, fit_polynomial, monotonic_polynomial
from hand_model.identify.probe import calibrated_probe
from hand_model.rotation import angle_between
from hand_model.session import read_session
from hand_model.twin import Plan, bebionic, record

SMALL = Plan(flexion=("full", "fast"), validation=("full",), excitations=0)


def two_clocks(offset_s: float, rate: float, noise_rad: float = 0.01, seed: int = 0):
    """A proximal angle at 100 Hz and counts at about 55 Hz on another clock, of the same repeated motion."""
    rng = np.random.default_rng(seed)

    def drive(t):
        return np.clip(0.55 - 0.6 * np.cos(2 * np.pi * t / 7.3), 0, 1) * (0.6 + 0.4 * np.sin(t / 5) ** 2) * (t > 1.2)

    t = np.arange(0, 40, 0.01)
    s = np.cumsum(rng.uniform(0.011, 0.025, 2150))
    q = 1.3 * drive(t) + 0.1 * drive(t) ** 2 + rng.normal(0, noise_rad, len(t))
    counts = np.round(12100 + 5800 * drive(s) + rng.normal(0, 3.5, len(s)))
    return t, q, offset_s + rate * s, counts


@pytest.mark.parametrize("rate", [1.0, 0.9985, 1.0021])
def test_clock_offset_and_rate(rate):
    t, q, log_time, counts = two_clocks(1000.3, rate)
    clock = align(t, q, log_time, counts)
    expected = 1000.3 + rate * t
    assert np.abs(clock.log_time(t) - expected).max() < 1.5e-3
    assert (clock.rate == 1.0) == (rate == 1.0)
    assert clock.offset_sd_s < 1e-3


def test_clock_starting_elsewhere():
    t, q, log_time, counts = two_clocks(500.0, 1.0)
    late = log_time > log_time[0] + 6
    assert align(t, q, log_time[late], counts[late]).offset_s == pytest.approx(500.0, abs=1e-3)


def test_recordings_that_never_correlate_are_refused():
    t, q, log_time, counts = two_clocks(0.0, 1.0)
    rng = np.random.default_rng(1)
    with pytest.raises(IdentificationError, match="trial_7.*never correlate"):
        align(t, q, log_time, np.cumsum(rng.normal(0, 40, len(counts))), "trial_7")
    with pytest.raises(IdentificationError, match="nothing moves"):
        align(t, q, log_time, np.full(len(counts), 7.0))


def test_order_is_what_held_out_cycles_support():
    rng = np.random.default_rng(2)
    u = np.tile(np.concatenate([np.linspace(0, 1, 300), np.linspace(1, 0, 300)]), 6)
    group = cycles(u)
    assert len(np.unique(group)) >= 6
    line, cubic = 1.2 * u, 0.5 * u + 0.9 * u**2 - 0.3 * u**3
    assert fit_polynomial(u, line + rng.normal(0, 0.01, len(u)), group, (1, 2, 3)).order == 1
    found = fit_polynomial(u, cubic + rng.normal(0, 0.01, len(u)), group, (1, 2, 3))
    assert found.order == 3
    assert found.rmse[3] == pytest.approx(0.01, rel=0.05) and found.rmse[1] > 0.03
    np.testing.assert_allclose(found.coefficients, [0, 0.5, 0.9, -0.3], atol=0.01)


def test_a_linkage_never_turns_back():
    x = np.linspace(0, 1.3, 200)
    y = 0.9 * np.maximum(x - 0.4, 0) ** 2
    free = np.polynomial.Polynomial.fit(x, y, 4).deriv()(x)
    held = np.polynomial.Polynomial(monotonic_polynomial(x, y, 4))
    assert free.min() < 0 and held.deriv()(x).min() > -1e-9
    assert np.sqrt(np.mean((held(x) - y) ** 2)) < 0.02
    falling = np.polynomial.Polynomial(monotonic_polynomial(x, -y, 4))
    np.testing.assert_allclose(falling(x), -held(x), atol=1e-7)


def test_counts_are_not_invented_across_gaps():
    s = np.arange(0, 10, 0.02)
    c = 100 * s
    c[200:300] = np.nan
    at = counts_at(s, c, np.array([-1.0, 1.005, 5.0, 9.0, 11.0]))
    np.testing.assert_allclose(at[[1, 3]], [100.5, 900.0])
    assert np.isnan(at[[0, 2, 4]]).all()


def test_palm_frame_is_that_of_the_thesis_and_mirrors():
    o, m, lat = np.array([0.0, 0, 0]), np.array([0.05, -0.024, 0]), np.array([0.047, 0.024, 0])
    left = palm_rotation(o, m, lat, "left")
    np.testing.assert_allclose(left[:, 2], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(left.T @ left, np.eye(3), atol=1e-12)
    mirror = np.array([1.0, -1.0, 1.0])
    right = palm_rotation(o, m * mirror, lat * mirror, "right")
    np.testing.assert_allclose(np.diag(mirror) @ left @ np.diag(mirror), right, atol=1e-12)
    with pytest.raises(IdentificationError, match="one line"):
        palm_frame([o, m, 2 * m], "left")


def worst_errors(hand, answer):
    axis, centre = [], []
    for finger in hand.fingers:
        truth = answer.table["kinematics"][finger.name]
        for joint, a, c in zip(finger.joints, truth["axes"], truth["centres"], strict=True):
            a = np.array(a) / np.linalg.norm(a)
            axis.append(np.rad2deg(angle_between(joint.axis_palm, a)))
            arm = joint.centre_palm - np.array(c)
            centre.append(np.linalg.norm(arm - a * (arm @ a)))
    return max(axis), max(centre)


@pytest.mark.parametrize("side", ["left", "right"])
def test_clean_laboratory_gives_the_hand_back(tmp_path, side):
    truth = bebionic(side, 3, ["index", "thumb_1"]).quiet()
    answer = record(truth, tmp_path / "s", 3, plan=SMALL)
    hand = identify(tmp_path / "s")
    axis_deg, centre_m = worst_errors(hand, answer)
    assert axis_deg < 0.01 and centre_m < 1e-5  # float32 in the C3D files
    hand.save(tmp_path / "a.hand")
    load_hand(tmp_path / "a.hand").save(tmp_path / "b.hand")
    assert (tmp_path / "a.hand").read_bytes() == (tmp_path / "b.hand").read_bytes()


def test_dirty_laboratory_stays_within_its_own_uncertainty(tmp_path):
    truth = bebionic("left", 4, ["ring", "thumb_0"])
    truth = replace(
        truth, mocap=replace(truth.mocap, noise_m=4e-4, ghosts_per_minute=4, ghost_label_share=0.5, swaps_per_minute=2)
    )
    answer = record(truth, tmp_path / "s", 4, plan=SMALL)
    found = identify_all(tmp_path / "s")
    assert found.hand.noise_m == pytest.approx(4e-4, rel=0.03)
    for finger in found.hand.fingers:
        table = answer.table["kinematics"][finger.name]
        for joint, a, c in zip(finger.joints, table["axes"], table["centres"], strict=True):
            off = np.concatenate([joint.axis_palm - np.array(a) / np.linalg.norm(a), joint.centre_palm - np.array(c)])
            sd = (
                np.sqrt(np.linalg.eigvalsh(joint.covariance[:3, :3])[-1]),
                np.sqrt(np.linalg.eigvalsh(joint.covariance[3:, 3:])[-1]),
            )
            assert np.linalg.norm(off[:3]) < 4 * sd[0] and np.linalg.norm(off[3:]) < 4 * sd[1]


def test_same_recording_gives_the_same_bytes(tmp_path):
    record(bebionic("right", 5, ["middle"]), tmp_path / "s", 5, plan=SMALL)
    identify(tmp_path / "s").save(tmp_path / "a.hand")
    identify(tmp_path / "s").save(tmp_path / "b.hand")
    assert (tmp_path / "a.hand").read_bytes() == (tmp_path / "b.hand").read_bytes()


def test_unknown_probe_tip_is_found_from_pivoting(tmp_path):
    truth = bebionic("left", 6, ["index"])
    record(truth, tmp_path / "s", 6, plan=replace(SMALL, pivot=True))
    session = read_session(tmp_path / "s")
    assert session.probe is not None and session.probe.position_probe is None
    probe = calibrated_probe(session)
    truth_positions = np.stack([truth.probe[label] for label in probe.labels])
    assert np.abs(np.linalg.norm(probe.position_probe, axis=1) - np.linalg.norm(truth_positions, axis=1)).max() < 5e-4


@pytest.mark.slow
def test_a_finger_that_hardly_moves_is_called_undetermined(tmp_path):
    truth = bebionic("left", 7, ["index"])
    truth = replace(truth, mocap=replace(truth.mocap, noise_m=3e-4))
    finger = truth.fingers[0]
    stiff = replace(finger, proximal_rad=finger.proximal_rad * 0.03, distal_rad=finger.distal_rad)
    record(replace(truth, fingers=(stiff,)), tmp_path / "s", 7, plan=SMALL)
    hand = identify(tmp_path / "s")
    assert all(joint.degenerate for joint in hand.fingers[0].joints)
    assert any("does not determine the axis" in note for note in hand.notes)
    record(truth, tmp_path / "t", 7, plan=SMALL)
    assert not any(joint.degenerate for joint in identify(tmp_path / "t").fingers[0].joints)
