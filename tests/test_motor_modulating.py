"""Modulating functions: orthonormal once whitened, and their derivatives stand for those of what they are multiplied
with."""

from __future__ import annotations

import numpy as np

from hand_model.identify.motor.modulating import Modulating

SPLINES = Modulating(0.3, 1.7, 0.05, 1e-3)
T = SPLINES.grid


def test_whitened_splines_are_orthonormal() -> None:
    """White noise on the grid has, as products, the variance that it has there, times the step."""
    k = len(SPLINES.products(T))
    rng = np.random.default_rng(0)
    found = SPLINES.products(rng.normal(size=(len(T), 4000)))
    covariance = found @ found.T / 4000 / (T[1] - T[0])
    assert np.abs(covariance - np.eye(k)).max() < 0.12


def test_derivatives_by_parts() -> None:
    """The splines vanish at both ends: their derivatives times y are they times the derivatives of y, but for the
    sign."""
    y, first, second = (
        np.exp(T) * np.sin(4 * T),
        np.exp(T) * (np.sin(4 * T) + 4 * np.cos(4 * T)),
        np.exp(T) * (8 * np.cos(4 * T) - 15 * np.sin(4 * T)),
    )
    scale = np.abs(SPLINES.products(first)).max()
    # the trapezoidal rule over kinks
    assert np.abs(SPLINES.products(y, 1) + SPLINES.products(first)).max() < 1e-2 * scale
    bent = y - y[0] - (y[-1] - y[0]) * (T - T[0]) / (T[-1] - T[0])
    assert (
        np.abs(SPLINES.products(bent, 2) - SPLINES.products(second)).max()
        < 2e-2 * np.abs(SPLINES.products(second)).max()
    )


def test_slope_of_a_combination() -> None:
    """What vanishes at both ends, as a combination of the splines: its slope."""
    s = (T - T[0]) / (T[-1] - T[0])
    y = s**2 * (1 - s) ** 2
    slope = 2 * s * (1 - s) * (1 - 2 * s) / (T[-1] - T[0])
    assert np.abs(SPLINES.slope(SPLINES.products(y)) - slope).max() < 0.01 * np.abs(slope).max()
