"""Sparse linear equations with a fixed pattern: the order of elimination is chosen once, then only numbers change.

Left-looking Gaussian elimination (Davis, Direct Methods for Sparse Linear Systems, 6.2) with the pivots of SuperLU: the
factors of a chain have as many entries as a chain.  ``coupling.c`` eliminates and solves.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ctypes import byref
from heapq import heapify, heappop, heappush
from itertools import accumulate, chain
from typing import Any, final

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from liaisons.base.arrays import as_indices
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.compiled.calls import Indices
from liaisons.cosim.coupling.records import EliminationRecord

_SMALLEST_PIVOT = 1e-3
"""Smallest pivot, relative to its column; below it the order of elimination is chosen anew."""


@final
class Elimination:
    """A matrix with a pattern, and its factors L U.

    :param n: number of rows and of columns.
    :param pattern: row and column of each number of the matrix, each once.
    :ivar values: these numbers.
    :ivar record: the matrix and its factors, for compiled code.
    """

    def __init__(self, n: int, pattern: Sequence[tuple[int, int]]) -> None:
        self.values = np.zeros(len(pattern))
        self.record = EliminationRecord(n=n, smallest_pivot=_SMALLEST_PIVOT)
        numbers: Any = np.arange(len(pattern)) + 1, tuple(zip(*pattern, strict=True))
        self._numbers: Any = csc_array(numbers, (n, n))  # those of values, from 1

    def choose_pivots(self) -> None:
        """Choose the pivots by the present values, and eliminate.

        :raises RuntimeError: if the matrix is singular.
        """
        matrix: Any = self._numbers.astype(float)
        matrix.data = self.values[self._numbers.data - 1]
        factors = splu(matrix)
        row_order, column_order = map(as_indices, (factors.perm_r, factors.perm_c))
        ordered, n = self._numbers[:, np.argsort(column_order)], len(row_order)
        rows = row_order[ordered.indices]
        above, below = _upper_and_lower_rows([part.tolist() for part in np.split(rows, ordered.indptr[1:-1])])
        self.record.ordered = True
        self.record.point(
            values=self.values,
            row_order=row_order,
            column_order=column_order,
            pivots=np.empty(n),
            work=np.empty(n),
            starts=as_indices(ordered.indptr),
            above_starts=_starts(above),
            below_starts=_starts(below),
            rows=rows,
            above_rows=_flat(above),
            below_rows=_flat(below),
            indices=as_indices(ordered.data - 1),
            upper=np.empty(sum(map(len, above))),
            lower=np.empty(sum(map(len, below))),
        )
        library = compiled.step_library(coupled=True)
        assert library is not None
        if not library.eliminate(byref(self.record)):
            raise RuntimeError("Factor is exactly singular")


def _upper_and_lower_rows(columns: Iterable[Sequence[int]]) -> tuple[list[list[int]], list[list[int]]]:
    """Rows of the entries, of each column of U above the diagonal, then of each column of L below it.

    :param columns: rows of the entries of the matrix.
    """
    above: list[list[int]] = []
    below: list[list[int]] = []
    for k, rows in enumerate(columns):
        pattern = set(rows)
        waiting, upper = [row for row in pattern if row < k], []
        heapify(waiting)
        while waiting:
            upper.append(row := heappop(waiting))
            for other in below[row]:
                if other not in pattern:
                    pattern.add(other)
                    if other < k:
                        heappush(waiting, other)
        above.append(upper)
        below.append(sorted(row for row in pattern if row > k))
    return above, below


def _flat(columns: Iterable[Iterable[int]]) -> Indices:
    """The entries of all columns, one column after the other."""
    return np.fromiter(chain.from_iterable(columns), dtype=np.intp)


def _starts(columns: Iterable[Sequence[Any]]) -> Indices:
    """Index of the first entry of each column, and the number of all entries."""
    return np.fromiter(accumulate(map(len, columns), initial=0), dtype=np.intp)
