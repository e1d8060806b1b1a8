"""Modulating functions: cubic B-splines that vanish at both ends of a stretch (Shinbrot 1957; Preisig & Rippin 1993),
as the banded matrices that they are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEGREE = 3


class Modulating:
    """Splines over begin_s to end_s [s], knots `spacing_s` apart, on a uniform grid of steps no longer than step_s.
    grid (n,) [s]; k splines.

    Products are integrals over the stretch (trapezoidal rule). Whitened: in combinations of the splines that are
    orthonormal on the grid, by the Cholesky factor of their products, which has three diagonals below its own.
    """

    def __init__(self, begin_s: float, end_s: float, spacing_s: float, step_s: float) -> None:
        from scipy.linalg import cholesky_banded

        knots = np.linspace(begin_s, end_s, int((end_s - begin_s) / spacing_s) + 1)
        knots = np.r_[[begin_s] * DEGREE, knots, [end_s] * DEGREE]
        self.grid = np.linspace(begin_s, end_s, int((end_s - begin_s) / step_s) + 2)
        self.weight = np.full(len(self.grid), self.grid[1] - self.grid[0])
        self.weight[[0, -1]] *= 0.5
        self._onto = [_design(self.grid, knots[i : len(knots) - i], DEGREE - i).T for i in range(3)]
        # derivatives of a spline are splines of less degree: by how much its coefficients differ over the width of
        # their knots (de Boor 1978, ch. X)
        self._slopes = [_slopes(knots[i : len(knots) - i], DEGREE - i) for i in range(2)]
        onto = self._onto[0]
        products = onto.multiply(self.weight) @ onto.T
        # of all but the first and the last
        below = [np.r_[products.diagonal(-i)[1:-1], np.zeros(i)] for i in range(DEGREE + 1)]
        self._factor = cholesky_banded(np.array(below), lower=True)

    def products(self, y: Array, derivative: int = 0) -> Array:
        """Integrals (k, ...) of columns y (n, ...) times the splines or their first or second derivative, whitened."""
        found = self._onto[derivative] @ (y.T * self.weight).T
        for slope in self._slopes[:derivative][::-1]:
            found = -np.diff((found.T * slope).T, axis=0, prepend=0.0, append=0.0)
        return self._solved(found[1:-1], "N")

    def slope(self, coefficients: Array) -> Array:
        """First derivative (n,) on the grid of the combination with these coefficients (k,) of the whitened splines."""
        own = np.r_[0.0, self._solved(coefficients, "T"), 0.0]
        return self._onto[1].T @ (self._slopes[0] * np.diff(own))

    def _solved(self, y: Array, transposed: str) -> Array:
        from scipy.linalg.lapack import dtbtrs

        return dtbtrs(self._factor, y.reshape(len(y), -1), uplo="L", trans=transposed)[0].reshape(y.shape)


def _design(at: Array, knots: Array, degree: int) -> Any:
    from scipy.interpolate import BSpline

    return BSpline.design_matrix(at, knots, degree)


def _slopes(knots: Array, degree: int) -> Array:
    """Degree over the width of the knots, of every neighbouring pair of splines."""
    n = len(knots) - degree - 1
    return degree / (knots[degree + 1 : degree + n] - knots[1:n])
