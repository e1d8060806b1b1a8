"""Path operators: strokes, hysteresis and filters against what they are by definition."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from drive_motion import state

from hand_model.effects import effect
from hand_model.effects.path import dahl, jenkins, lowpass, strokes, travelled


def test_strokes_cover_every_sample_once_and_ignore_noise() -> None:
    s = state()
    noisy = s.position + np.random.default_rng(1).normal(0, 0.1, len(s.position))
    cut = strokes(noisy)
    assert cut[0][0] == 0 and cut[-1][1] == len(noisy)
    assert all(a[1] == b[0] for a, b in itertools.pairwise(cut))
    turns = np.sum(np.diff(np.sign(s.velocity[s.velocity != 0])) != 0)
    assert len(cut) == turns + 1


def test_travelled_restarts_at_reversals_and_never_falls_within_a_stroke() -> None:
    x = state().position
    for a, b, _ in strokes(x):
        d = travelled(x)[a:b]
        assert d[0] == 0 and (np.diff(d) >= 0).all()


def test_dahl_solves_its_differential_equation() -> None:
    x = np.concatenate([np.linspace(0, 20, 4000), np.linspace(20, 5, 3000)])
    z = dahl(x, 3.0, threshold=0.5)
    dx, dz = np.diff(x), np.diff(z)
    inside = np.abs(dx) > 0
    middle = 0.5 * (z[1:] + z[:-1])
    np.testing.assert_allclose(dz[inside], ((1 - middle * np.sign(dx)) / 3.0 * dx)[inside], atol=2e-5)
    assert np.abs(z).max() <= 1


def test_damped_bristles_follow_the_state_of_lugre() -> None:
    s, presliding = state(6000), effect("presliding_friction")
    z, damped = (
        presliding.declared(s, {"bristle_length": 8.0, "bristle_time": time, "form": 0.0})[:, 2] for time in (0.0, 0.05)
    )
    rate = np.gradient(z, s.time_s)
    assert np.corrcoef(damped - z, 0.05 * rate)[0, 1] > 0.99
    assert np.ptp(damped - z) == pytest.approx(np.ptp(0.05 * rate), rel=0.1)


@pytest.mark.parametrize("length", [0.6, 1.2, 4.0])
def test_bristles_that_damp_a_motor_critically_are_damped_in_full(length: float) -> None:
    """As they do in simulators (Canudas de Wit et al. 1995): a motor of 0.012 raw s^2/% with friction of 35 raw. What is
    damped a hundred times more gives nothing at all."""
    time = 2 * np.sqrt(0.012 * length / 35.0)
    shape = {"bristle_length": length, "bristle_time": time, "form": 0.0}
    told = effect("presliding_friction").parameters
    assert told(shape, {}, {})["bristle_time"] == pytest.approx(time)
    assert told({**shape, "bristle_time": 100 * time}, {}, {})["bristle_time"] < 3 * time


def test_jenkins_is_elastic_then_yields() -> None:
    x = np.concatenate([np.linspace(0, 10, 500), np.linspace(10, 0, 500)])
    z = jenkins(x, 2.0, threshold=0.1)
    np.testing.assert_allclose(z[:100], x[:100] / 2.0, atol=1e-9)
    assert z[499] == 1 and z[-1] == -1


@pytest.mark.parametrize(("count", "constant_s"), [(1, 0.1), (2, 0.1), (700, 0.03), (700, 1.0), (700, 1e-9)])
def test_lowpass_of_uneven_samples_goes_from_one_to_the_next(count, constant_s) -> None:
    rng = np.random.default_rng(0)
    time_s = np.cumsum(rng.uniform(0.002, 0.03, count))
    values = np.cumsum(rng.normal(size=count))
    wanted = [values[0]]
    for i in range(1, count):
        kept = np.exp(-(time_s[i] - time_s[i - 1]) / constant_s)
        wanted.append(0.5 * (values[i] + values[i - 1]) * (1 - kept) + kept * wanted[-1])
    np.testing.assert_allclose(lowpass(time_s, values, constant_s), wanted, rtol=1e-12, atol=1e-12)


def test_lowpass_of_a_step_is_exponential() -> None:
    t = np.linspace(0, 3, 3001)
    y = lowpass(t, (t > 1e-4).astype(float), 0.5)
    np.testing.assert_allclose(y, 1 - np.exp(-t / 0.5), atol=2e-3)
