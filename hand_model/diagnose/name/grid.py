"""Grids of starting shapes: the columns of one effect at many shapes, as one matrix."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPARSE = 0.2  # share of entries that are not zero, below which a matrix is kept sparse: events act in one trial


@dataclass(frozen=True)
class Grid:
    """The shapes from which the search for an effect's shape starts, and how many parameters each has beside its
    amplitudes (s,)."""

    effect: Any
    shapes: list[dict[str, float]]
    freedom: NDArray[np.int64]


@dataclass(frozen=True)
class GridColumns:
    """matrix: (n, c), dense or sparse, of the columns that act at all. shape: (c,) to which shape of the grid each
    belongs. length: (c,) Euclidean norms. inside: (n,) rows that take part, None for all."""

    matrix: Any
    shape: NDArray[np.int64]
    length: Array
    inside: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, matrix: Any, shape: NDArray[np.int64], inside: NDArray[np.bool_] | None = None) -> GridColumns:
        """The columns of a matrix with their norms over the rows `inside`."""
        return cls(matrix, shape, _lengths(matrix, inside), inside)

    @property
    def bytes(self) -> int:
        """Memory that the matrix takes."""
        return int(self.matrix.nbytes if isinstance(self.matrix, np.ndarray) else 1.5 * self.matrix.data.nbytes)

    def products(self, other: Array) -> Array:
        """matrix^T other, (c,) or (c, k)."""
        return np.asarray(self.matrix.T @ (other if self.inside is None else (other.T * self.inside).T))

    def within(self, inside: NDArray[np.bool_]) -> GridColumns:
        """The same columns, of which only the rows `inside` (n,) take part."""
        return GridColumns.of(self.matrix, self.shape, inside)

    def gram(self, which: NDArray[np.int64]) -> Array:
        """Products (k, k) of some columns with each other."""
        part = self.matrix[:, which]
        part = part if isinstance(part, np.ndarray) else part.toarray()
        part = part if self.inside is None else part[self.inside]
        return part.T @ part


def _lengths(matrix: Any, inside: NDArray[np.bool_] | None) -> Array:
    """Norms (c,) of columns over some rows, in one pass without a copy."""
    if not isinstance(matrix, np.ndarray):
        rows = np.ones(matrix.shape[0]) if inside is None else inside.astype(float)
        return np.sqrt(np.asarray(matrix.multiply(matrix).T @ rows))
    if inside is None:
        return np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    return np.sqrt(np.einsum("ij,ij,i->j", matrix, matrix, inside.astype(float)))


def stacked(chunks: Iterable[Sequence[Array]]) -> GridColumns:
    """One matrix from the columns (n, j) of every shape that act at all (of one shape at least), in chunks of shapes."""
    from scipy.sparse import csc_matrix, hstack

    widths, kept, sparse = list[int](), list[Any](), True
    for chunk in chunks:
        parts = [part[:, part.any(0)] for part in chunk]
        widths += [part.shape[1] for part in parts]
        matrix = np.concatenate(parts, axis=1)
        thin = np.count_nonzero(matrix) <= SPARSE * matrix.size
        sparse = sparse and thin
        kept.append(csc_matrix(matrix) if thin else matrix)
    owner = np.repeat(np.arange(len(widths)), widths)
    if len(owner) and sparse:
        return GridColumns.of(hstack(kept, format="csc"), owner)
    dense = [m if isinstance(m, np.ndarray) else m.toarray() for m in kept]
    return GridColumns.of(np.concatenate(dense, axis=1), owner)
