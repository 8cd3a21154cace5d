"""SciPy's sparse matrices, multiplied by traced values entry by entry."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filippov.trace.array import TracedArray, plain

__all__ = ["SparseMatrix", "is_sparse"]


def is_sparse(value: Any) -> bool:
    """Whether an object is a sparse matrix or array of SciPy."""
    sparse = sys.modules.get("scipy.sparse")
    return sparse is not None and sparse.issparse(value)


class SparseMatrix:
    """A sparse matrix of plain numbers, whose product with traced values has a term for each entry.

    Parameters
    ----------
    matrix : sparse matrix or array
        Anything else than a product with it is SciPy's own.
    """

    __array_ufunc__ = None  # x @ A is asked here too

    def __init__(self, matrix: Any) -> None:
        self.matrix = matrix
        self._rows: Any = None

    def __matmul__(self, other: Any) -> Any:
        if not isinstance(other, np.ndarray) or other.dtype != object:
            return self.matrix @ other
        operand = plain(other)
        if operand.ndim > 2 or operand.shape[0] != self.matrix.shape[1]:
            raise ValueError(
                f"matmul: a matrix of shape {self.matrix.shape} and an operand of shape {operand.shape}"
            )
        columns = operand.reshape(operand.shape[0], -1)
        result = np.stack([self._times(column) for column in columns.T], axis=1)
        return result.reshape((self.matrix.shape[0], *operand.shape[1:])).view(TracedArray)

    def __rmatmul__(self, other: Any) -> Any:
        return (self.T @ np.asarray(other).T).T

    def __mul__(self, other: Any) -> Any:
        # Of a matrix, not of an array, `*` is the product of matrices.
        is_matrix = not type(self.matrix).__name__.endswith("array")
        if isinstance(other, np.ndarray) and other.dtype == object and is_matrix:
            return self @ other
        made = self.matrix * other
        return SparseMatrix(made) if is_sparse(made) else made

    def __rmul__(self, other: Any) -> Any:
        return self.__mul__(other)

    def dot(self, other: Any) -> Any:
        """Return the product ``A @ other``."""
        return self @ other

    @property
    def T(self) -> SparseMatrix:
        """The transposed matrix."""
        return SparseMatrix(self.matrix.T)

    def __neg__(self) -> SparseMatrix:
        return SparseMatrix(-self.matrix)

    def __add__(self, other: Any) -> Any:
        made = self.matrix + getattr(other, "matrix", other)
        return SparseMatrix(made) if is_sparse(made) else made

    def __sub__(self, other: Any) -> Any:
        made = self.matrix - getattr(other, "matrix", other)
        return SparseMatrix(made) if is_sparse(made) else made

    def __getattr__(self, name: str) -> Any:
        return getattr(self.matrix, name)

    def _times(self, column: NDArray[Any]) -> NDArray[Any]:
        if self._rows is None:
            rows = self.matrix.tocsr()
            self._rows = (rows.indptr.tolist(), rows.indices.tolist(), rows.data.tolist())
        ends, indices, entries = self._rows
        values = column.tolist()
        result = np.zeros(len(ends) - 1, dtype=object)
        for row in range(len(result)):
            own = range(ends[row], ends[row + 1])
            terms = [
                values[indices[k]] if entries[k] == 1.0 else entries[k] * values[indices[k]] for k in own
            ]
            result[row] = sum(terms[1:], terms[0]) if terms else 0.0
        return result
