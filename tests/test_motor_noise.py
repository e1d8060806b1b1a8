"""What a motor's intervals are worth when the noise has a memory, or moves differ by more than their samples say."""

from __future__ import annotations

import numpy as np
import pytest

from hand_model.identify.motor.covariance import covariance
from hand_model.identify.motor.memory import ORDER, autocorrelation, freed, predictors


def _wander(rng: np.random.Generator, n: int, keep: float) -> np.ndarray:
    """Unit noise (n,) that keeps a share of itself from sample to sample."""
    x = rng.normal(size=n)
    for i in range(1, n):
        x[i] = keep * x[i - 1] + np.sqrt(1 - keep**2) * x[i]
    return x


def test_noise_is_freed_of_its_memory() -> None:
    """A load that wanders under white noise: what is left is white and as large as before; the channel without memory
    stays as it is."""
    rng = np.random.default_rng(1)
    moves = [
        np.c_[(_wander(rng, 300, 0.9) + rng.normal(size=300)) / np.sqrt(2), rng.normal(size=300)] for _ in range(40)
    ]
    correlation = autocorrelation(moves)
    assert correlation[0, 1] == pytest.approx(0.45, abs=0.05) and abs(correlation[1, 1]) < 0.03
    known = tuple(predictors(c) for c in correlation)
    left = [freed(e.T.ravel(), known).reshape(2, -1).T for e in moves]
    after = autocorrelation(left)
    assert np.abs(after[:, 1 : ORDER + 1]).max() < 0.06
    assert np.std(np.concatenate(left), axis=0) == pytest.approx([1.0, 1.0], abs=0.05)
    assert np.allclose(np.concatenate(left)[:, 1], np.concatenate(moves)[:, 1], atol=0.3)


def test_freeing_is_linear_and_leaves_the_first_sample() -> None:
    known = (predictors(np.array([1.0, 0.6, 0.3, 0.1, 0.0])),)
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 20))
    both = freed(np.c_[a, b], known)
    assert np.allclose(both, np.c_[freed(a, known), freed(b, known)])
    assert np.allclose(freed(a + 2 * b, known), freed(a, known) + 2 * freed(b, known))
    assert both[0, 0] == a[0] and np.array_equal(freed(a, ()), a)


@pytest.mark.parametrize("between", [0.0, 1.0])
def test_intervals_hold_the_truth_with_moves_that_differ(between: float) -> None:
    """A line fitted to moves, each with a slope of its own: nine in ten intervals at least, and without such moves not
    much more than promised."""
    rng = np.random.default_rng(3)
    inside = []
    for _ in range(300):
        x = [rng.normal(size=(30, 2)) * rng.uniform(0.5, 2.0) for _ in range(25)]
        y = [a @ (between * rng.normal(size=2) * 0.5) + rng.normal(size=30) for a in x]
        parts = np.array([a.T @ a for a in x])
        found = np.linalg.solve(parts.sum(axis=0), sum(a.T @ e for a, e in zip(x, y, strict=True)))
        scores = np.array([a.T @ (e - a @ found) for a, e in zip(x, y, strict=True)])
        sd = np.sqrt(np.diag(covariance(parts, np.zeros((2, 2)), scores, scores.sum(axis=0), 1.0)))
        inside.append(np.abs(found) < 1.96 * sd)
    assert 0.92 < np.mean(inside) < 0.985
