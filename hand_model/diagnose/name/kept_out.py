"""What recordings kept out of the learning say of models that the learning recordings cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .balance import Balance, Fit
from .naming import CLASS_WIDTH, Rival
from .wander import Wander

Array = NDArray[np.float64]


def with_kept_out(balance: Balance, rivals: list[Rival]) -> list[Rival]:
    """Rivals, those that training cannot tell apart with what recordings kept out say of them as trained (prequential
    evidence; Dawid 1984); best first. What one recording had foretells nothing of another."""
    near = [r for r in rivals if r.evidence > rivals[0].evidence - CLASS_WIDTH]
    if len(near) < 2 or balance.train.all() or not all(r.fit.terms[-1].effect.of_the_hand for r in near):
        return rivals
    told = foretold(balance, [r.fit for r in near])
    likeliest = int(np.argmax([r.evidence + t for r, t in zip(near, told, strict=True)]))
    more = [t - told[likeliest] for t in told]
    heard = [replace(r, evidence=r.evidence + m, kept_out=m) for r, m in zip(near, more, strict=True)]
    return sorted([*heard, *rivals[len(near) :]], key=lambda r: -r.evidence)


def foretold(balance: Balance, fits: Sequence[Fit]) -> list[float]:
    """Log likelihood of the recordings kept out under each of several fits, as trained (prequential; Dawid 1984)."""
    each = [_foretold(balance, balance.fit(f.terms)) for f in fits]
    scale = max(min(square for square, _ in each), 1.0)  # a misfit there weighs all down
    return [brought / scale for _, brought in each]


def _foretold(balance: Balance, fit: Fit) -> tuple[float, float]:
    """Of a fit, in the recordings kept out: mean square of residual over noise, and log likelihood."""
    weight = balance.weights(fit.terms) * ~balance.train
    held = weight > 0
    square = float(np.mean(((balance.effort - fit.prediction) * weight)[held] ** 2))
    noise = float(np.sum(np.log(weight[held]))) / balance.inflation
    return square, log_likelihood(balance, fit, balance.wander, weight) + noise


def log_likelihood(balance: Balance, fit: Fit, wander: Wander | None, weight: Array) -> float:
    """Log likelihood of what a fit leaves, of samples with these weights (n,), zero for those that do not count."""
    residual = (balance.effort - fit.prediction) * weight
    if wander is None or not wander.real:
        return -0.5 * float(np.sum(residual**2)) / balance.inflation
    return wander.log_likelihood(residual, weight, balance.inflation)
