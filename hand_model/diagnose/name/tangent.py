"""What a candidate would explain if the terms beside it turned to it, to first order.

A candidate is scanned with the shapes of the others as they are, which they took beside what it is to replace: bristles
as long as they are beside a Stribeck rise deny a drag. The directions in which their shapes move the prediction, as
further columns, tell what a joint fit would gain (Gauss-Newton; Björck 1996, ch. 9) at the price of one linear fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .balance import Balance, Fit
from .candidates import allowed
from .evidence import evidence, scale_of
from .naming import CLASS_WIDTH, Rival
from .shapes import refit
from .term import reshaped

Array = NDArray[np.float64]

STEP = 0.02  # of a shape's range


@dataclass(frozen=True)
class Tangents:
    """Directions (n, m) in which the shapes of a fit's terms move its prediction, coefficients as they are, and the
    term (m,) that each is of."""

    columns: Array
    owner: NDArray[np.int64]

    @classmethod
    def of(cls, balance: Balance, fit: Fit) -> Tangents:
        """Those of a fit, by a difference toward the wider side of each shape's range."""
        coefficients = np.array([*fit.declared.values(), *(v for a in fit.amplitudes for v in a.values())])
        here, columns, owner = balance.design(fit.terms)[0] @ coefficients, [], []
        for which, term in enumerate(fit.terms):
            for shape in (s for s in term.moving(balance.states) if s.name in term.shape):
                value = term.shape[shape.name]
                moved = value + shape.wider(value) * STEP * (shape.high - shape.low)
                terms = reshaped(fit.terms, which, {**term.shape, shape.name: moved})
                columns.append(balance.design(terms)[0] @ coefficients - here)
                owner.append(which)
        return cls(np.reshape(columns, (-1, len(here))).T, np.array(owner, int))

    def gain(self, balance: Balance, fit: Fit, turning: Sequence[int]) -> float:
        """What the sum of squares of `fit` would fall by if the terms `turning` of these tangents' fit, which it has
        too, turned to the rest of it. Bounds of coefficients are left aside: it says who is to be fitted jointly."""
        turned = self.columns[:, np.isin(self.owner, turning)]
        if not turned.shape[1]:
            return 0.0
        weight = balance.weights(fit.terms) * balance.train
        every = np.concatenate(
            [balance.design(fit.terms)[0], turned, (balance.effort - fit.prediction)[:, None]], axis=1
        )
        whitened = balance.whiten(every * weight[:, None], weight)
        columns, left = whitened[:, :-1], whitened[:, -1]
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        rest = left - columns @ np.linalg.lstsq(columns, left, rcond=1e-9)[0]
        return float(left @ left - rest @ rest)


def turned(
    balance: Balance, rivals: Iterable[Rival], own: Rival, without: Fit, tangents: Tangents, others: Sequence[int]
) -> list[Rival]:
    """The rivals of a term; those that may come near it where the terms `others` turn to them are fitted jointly with
    these. own: the term itself, beside which they have turned; without: the fit of the others alone."""
    scale = scale_of(balance, own.fit)

    def beside_turned(rival: Rival) -> Rival:
        if min(rival.evidence, own.evidence) <= 0:
            return rival
        may = 0.5 * tangents.gain(balance, rival.fit, others) / (scale * balance.inflation)
        if may <= max(own.evidence - rival.evidence - CLASS_WIDTH, 1.0):
            return rival
        fit = refit(balance, rival.fit)
        if not allowed(balance, fit):
            return rival
        jointly = evidence(balance, fit, without, scale=min(scale, scale_of(balance, fit)))
        return max(rival, Rival(rival.name, jointly, fit), key=lambda r: r.evidence)

    return [beside_turned(rival) for rival in rivals]
