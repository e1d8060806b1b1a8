"""Grids of starting shapes: the columns of one effect at many shapes, as one matrix."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPARSE = 0.2  # share of entries that are not zero, below which a matrix is kept sparse: events act in one trial


@dataclass(frozen=True)
class Grid:
    """The shapes from which the search for an effect's shape starts."""

    effect: Any
    shapes: list[dict[str, float]]


@dataclass(frozen=True)
class GridColumns:
    """matrix: (n, c), dense or sparse, of the columns that act at all. shape: (c,) to which shape of the grid each
    belongs.
    length: (c,) Euclidean norms."""

    matrix: Any
    shape: NDArray[np.int64]
    length: Array

    @property
    def bytes(self) -> int:
        """Memory that the matrix takes."""
        return int(self.matrix.nbytes if isinstance(self.matrix, np.ndarray) else 1.5 * self.matrix.data.nbytes)

    def products(self, other: Array) -> Array:
        """matrix^T other, (c,) or (c, k)."""
        return np.asarray(self.matrix.T @ other)

    def within(self, inside: NDArray[np.bool_]) -> GridColumns:
        """The same columns, zero where `inside` (n,) is false."""
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import norm

        if isinstance(self.matrix, np.ndarray):
            matrix = self.matrix * inside[:, None]
            return GridColumns(matrix, self.shape, np.linalg.norm(matrix, axis=0))
        matrix = csc_matrix(
            (self.matrix.data * inside[self.matrix.indices], self.matrix.indices, self.matrix.indptr), self.matrix.shape
        )
        return GridColumns(matrix, self.shape, norm(matrix, axis=0))

    def gram(self, which: NDArray[np.int64]) -> Array:
        """Products (k, k) of some columns with each other."""
        part = self.matrix[:, which]
        part = part if isinstance(part, np.ndarray) else part.toarray()
        return part.T @ part


def stacked(columns: Iterable[Array]) -> GridColumns:
    """One matrix from the columns (n, j) of every shape that act at all (of one shape at least)."""
    from scipy.sparse import csc_matrix, hstack
    from scipy.sparse.linalg import norm

    parts = [part[:, part.any(0)] for part in columns]
    owner = np.repeat(np.arange(len(parts)), [p.shape[1] for p in parts])
    if not len(owner) or sum(np.count_nonzero(p) for p in parts) > SPARSE * len(parts[0]) * len(owner):
        dense = np.concatenate(parts, axis=1)
        return GridColumns(dense, owner, np.linalg.norm(dense, axis=0))
    matrix = hstack([csc_matrix(p) for p in parts if p.size], format="csc")
    return GridColumns(matrix, owner, norm(matrix, axis=0))
