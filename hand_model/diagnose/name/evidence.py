"""Log evidence of one more term in a balance: what it gains, less what its freedom could gain by chance.

Amplitudes, and shapes that are sizes, carry a prior as wide as the data find likely (empirical Bayes; George & Foster
2000);
other shapes are uniform within the bounds that the effect declares (Laplace's method; Kass & Raftery 1995). Sums of
squares count divided by the correlation time of the noise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...effects.base import Shape
from .balance import Balance, Fit
from .term import DISCRETE, reshaped

SPREAD = 0.3  # mean absolute deviation of the logarithm of a motor's coefficients within one hand


def scale_of(balance: Balance, fit: Fit) -> float:
    """Residual variance over pure error, at least 1: a misfit weighs all candidates down."""
    return max(fit.rss / max(balance.train.sum(), 1), 1.0)


def gain(balance: Balance, fit: Fit, reference: Fit, scale: float = 1.0) -> float:
    """Log likelihood that `fit` has over `reference`."""
    return 0.5 * (reference.rss - fit.rss) / (scale * balance.inflation)


def rough_evidence(balance: Balance, fit: Fit, reference: Fit, scale: float = 1.0) -> float:
    """Gain less the penalty of Schwarz (1978): cheap, to choose whom to look at closely."""
    penalty = 0.5 * parameter_price(balance) / balance.inflation
    return gain(balance, fit, reference, scale) - (fit.size - reference.size) * penalty


def parameter_price(balance: Balance) -> float:
    """What a parameter must take off a sum of squares (Schwarz 1978)."""
    return balance.inflation * float(np.log(max(balance.train.sum() / balance.inflation, 2.0)))


def evidence(balance: Balance, fit: Fit, reference: Fit, which: int = -1, scale: float = 1.0) -> float:
    """Log evidence of the term `which` of a polished fit over `reference`, the fit without it.

    scale: residual variance over pure error of the best model known, at least 1. With `balance.typical` (what the
    hand's other motors are like) a model pays for coefficients unlike theirs.
    """
    brought = gain(balance, fit, reference, scale)
    term = fit.terms[which]
    shapes = [s for s in term.effect.shapes(balance.states) if s.name in term.shape and s.matters(term.shape)]
    count = int(np.any(balance.columns(term.effect, term.shape)[balance.train] != 0, axis=0).sum()) + sum(
        s.size for s in shapes
    )
    if count and brought > 0:
        brought -= 0.5 * count * (1 + np.log(max(2 * brought / count, 1.0)))
    volume = sum(_occam(balance, fit, which, shape, scale) for shape in shapes if not shape.size)
    return float(brought - volume + oddity(balance, reference) - oddity(balance, fit))


def log_prior(fit: Fit, which: int) -> float:
    """Log density of the parameters of a fit's term over that of ordinary ones, as its effect says."""
    term = fit.terms[which]
    return term.effect.log_prior(term.effect.parameters(term.shape, fit.amplitudes[which], fit.declared))


def oddity(balance: Balance, fit: Fit) -> float:
    """Log density lost by declared coefficients unlike those of the hand's other motors (Laplace on their logarithms),
    and by effects' parameters that machines rarely have."""
    lost = -sum(log_prior(fit, which) for which in range(len(fit.terms)))
    for name, typical in balance.typical.items():
        value = max(fit.declared.get(name, typical), 1e-2 * typical)
        lost += abs(float(np.log(value / typical))) / SPREAD
    return lost


def typical_coefficients(others: list[Fit]) -> Mapping[str, float]:
    """Median of each positive motor coefficient over the fits of other motors of the same hand."""
    out = {}
    for name in ("inertia", "viscous", "coulomb"):
        values = [f.declared[name] for f in others if f.declared.get(name, 0.0) > 0]
        if values:
            out[name] = float(np.median(values))
    return out


def _occam(balance: Balance, fit: Fit, which: int, shape: Shape, scale: float) -> float:
    """Log of the prior range of a shape over the width of its likelihood, never below zero."""
    name = shape.name
    if name in DISCRETE:
        return float(np.log(max(len(shape.starts), 1)))
    span = shape.high - shape.low
    value = fit.terms[which].shape[name]
    toward = shape.wider(value)
    step = 0.02 * span
    width = span
    for _ in range(5):
        rise = abs(gain(balance, fit, _moved(balance, fit, which, name, value + toward * step), scale))
        width = step / np.sqrt(max(2 * rise, 1e-6))
        if 0.1 < rise < 8:
            break
        step = float(np.clip(width, 1e-4 * span, 0.45 * span))
    return max(float(np.log(span / (np.sqrt(2 * np.pi) * width))), 0.0)


def _moved(balance: Balance, fit: Fit, which: int, name: str, value: float) -> Fit:
    return balance.fit(reshaped(fit.terms, which, {**fit.terms[which].shape, name: value}), held=False)
