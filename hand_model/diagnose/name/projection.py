"""A design taken out of a balance, once for many candidates: what is left of theirs tells all of a joint fit.

Regression on two sets of columns is regression of the residual of the one on the residual of the other (Frisch & Waugh
1933, Lovell 1963).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .least_squares import from_products

Array = NDArray[np.float64]

DEPENDENT = 1e-7  # of a column's length: less left beside the others, and no coefficient of its own can be told


@dataclass(frozen=True)
class Projection:
    """Weighted, whitened and divided into what the design explains and the rest.

    basis: (n, k) orthonormal columns that span the design. left: (n,) of the effort beside it. weight: (n,) of the
    samples. triangle: (k, k), explained: (k,) such that the coefficients of the design's k acting columns alone solve
    triangle @ x = explained. low, high: (k,) their bounds.
    """

    basis: Array
    left: Array
    weight: Array
    triangle: Array
    explained: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, design: Array, effort: Array, weight: Array, low: Array, high: Array) -> Projection:
        """The projection on a weighted, whitened design (n, k), of an effort (n,) treated alike."""
        norm = np.linalg.norm(design, axis=0)
        acting = norm > 0
        q, r = np.linalg.qr(design[:, acting])
        explained = q.T @ effort
        return cls(q, effort - q @ explained, weight, r, explained, low[acting], high[acting])

    @cached_property
    def square(self) -> float:
        """Sum of squares of what the design leaves of the effort."""
        return float(self.left @ self.left)

    @property
    def regular(self) -> bool:
        """Whether every column of the design says something of its own."""
        return bool(np.all(np.abs(np.diag(self.triangle)) > DEPENDENT * np.linalg.norm(self.triangle, axis=0)))

    def rss(self, columns: Array, low: Array, high: Array, rows: slice = slice(None)) -> float | None:
        """Residual sum of squares of the joint fit of the design and of `columns` (m, j), weighted and whitened, whose
        coefficients are bounded; None where the design's own coefficients would leave their bounds, or a column hardly
        says anything beside it. rows: the m rows outside of which the columns are zero."""
        inside = self.basis[rows].T @ columns
        whole = columns.T @ columns
        gram = whole - inside.T @ inside  # of what is left of them beside the design
        if np.any(gram.diagonal() < DEPENDENT * whole.diagonal()):
            return None
        right = columns.T @ self.left[rows]
        amplitudes = from_products(gram, right, low, high)
        coefficients = np.linalg.solve(self.triangle, self.explained - inside @ amplitudes)
        if np.any(coefficients < self.low) or np.any(coefficients > self.high):
            return None
        return float(self.square - 2 * right @ amplitudes + amplitudes @ gram @ amplitudes)
