"""Sparse linear equations whose pattern stays: the order of elimination is chosen once, then only numbers change.

Gaussian elimination, each column from those before it (Davis, Direct Methods for Sparse Linear Systems, 6.2); SuperLU
chooses the pivots.  A chain stays a chain: what there is to do grows with its length.  ``coupling.c`` makes the same
operations in the same order.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ctypes import byref, c_void_p
from heapq import heapify, heappop, heappush
from itertools import accumulate, chain
from typing import Any, final

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.coupling.records import EliminationRecord
from liaisons.cosim.coupling.signals import Indices, Vector

_SMALLEST_PIVOT = 1e-3
"""Of the largest number below it in its column; with less, the order of elimination is chosen anew."""


@final
class Elimination:
    """A matrix with a pattern, and its factors L U.

    :param n: number of rows and of columns.
    :param pattern: row and column of each number of the matrix, each once.
    :ivar values: these numbers, to be set before :meth:`factorize`.
    """

    def __init__(self, n: int, pattern: Sequence[tuple[int, int]]) -> None:
        self.values = np.zeros(len(pattern))
        self.record = EliminationRecord(n=n, smallest_pivot=_SMALLEST_PIVOT)
        self._n = n
        self._columns: list[list[tuple[int, int]]] = [[] for _ in range(n)]  # of each number its row and its place
        for place, (row, column) in enumerate(pattern):
            self._columns[column].append((row, place))

    def factorize(self) -> None:
        """Eliminate.

        :raises RuntimeError: if the matrix is singular.
        """
        if not (self.record.ordered and self._eliminated()):
            self.order()

    def order(self) -> None:
        """Eliminate by other pivots.

        :raises RuntimeError: if the matrix is singular.
        """
        self._choose()
        if not self._eliminated():
            raise RuntimeError("Factor is exactly singular")

    def solve(self, right: Vector) -> Vector:
        """The solution with the factors that were calculated last."""
        if (library := compiled.steps()) is not None:
            solution = np.empty(self._n)
            library.solve(byref(self.record), c_void_p(right.ctypes.data), c_void_p(solution.ctypes.data))
            return solution
        work = [0.0] * self._n
        for row, number in zip(self._row_turns.tolist(), right.tolist(), strict=True):
            work[row] = number
        for turn, column in enumerate(self._lower):
            for row, factor in column:
                work[row] -= factor * work[turn]
        for turn in reversed(range(self._n)):
            work[turn] /= self._pivots[turn]
            for row, factor in self._upper[turn]:
                work[row] -= factor * work[turn]
        return np.array([work[turn] for turn in self._column_turns.tolist()])

    def _choose(self) -> None:
        """Choose pivots, and find what becomes of the pattern."""
        places = [place for column in self._columns for _, place in column]
        parts: Any = self.values[places], [row for c in self._columns for row, _ in c], _starts(self._columns)
        found = splu(csc_array(parts, (self._n, self._n)))
        self._row_turns, self._column_turns = (np.array(turns, dtype=np.intp) for turns in (found.perm_r, found.perm_c))
        turns = self._row_turns.tolist()
        columns = [self._columns[column] for column in np.argsort(self._column_turns).tolist()]
        self._given = [[(turns[row], place) for row, place in column] for column in columns]
        self._above: list[list[int]] = []
        self._below: list[list[int]] = []
        for turn, column in enumerate(self._given):
            pattern = {row for row, _ in column}
            waiting, above = [row for row in pattern if row < turn], []
            heapify(waiting)
            while waiting:
                above.append(row := heappop(waiting))
                for other in self._below[row]:
                    if other not in pattern:
                        pattern.add(other)
                        if other < turn:
                            heappush(waiting, other)
            self._above.append(above)
            self._below.append(sorted(row for row in pattern if row > turn))
        self.record.ordered = True
        if compiled.steps() is not None:
            self._tell()

    def _tell(self) -> None:
        """Let compiled code know where everything is."""
        self.record.point(
            values=self.values,
            row_turns=self._row_turns,
            column_turns=self._column_turns,
            pivots=np.empty(self._n),
            work=np.empty(self._n),
            given_starts=_starts(self._given),
            above_starts=_starts(self._above),
            below_starts=_starts(self._below),
            given_rows=_flat((row for row, _ in column) for column in self._given),
            above_rows=_flat(self._above),
            below_rows=_flat(self._below),
            places=_flat((place for _, place in column) for column in self._given),
            upper=np.empty(sum(map(len, self._above))),
            lower=np.empty(sum(map(len, self._below))),
        )

    def _eliminated(self) -> bool:
        """Calculate the factors; False if a pivot is too small."""
        if (library := compiled.steps()) is not None:
            return bool(library.eliminate(byref(self.record)))
        values, work = self.values.tolist(), [0.0] * self._n
        self._pivots: list[float] = []
        self._lower: list[list[tuple[int, float]]] = []
        self._upper: list[list[tuple[int, float]]] = []
        for turn, (given, above, below) in enumerate(zip(self._given, self._above, self._below, strict=True)):
            for row in (*above, turn, *below):
                work[row] = 0.0
            for row, place in given:
                work[row] = values[place]
            for row in above:
                for other, factor in self._lower[row]:
                    work[other] -= factor * work[row]
            pivot, largest = work[turn], max((abs(work[row]) for row in below), default=0.0)
            if not (abs(pivot) > 0 and abs(pivot) >= _SMALLEST_PIVOT * largest):
                return False
            self._pivots.append(pivot)
            self._upper.append([(row, work[row]) for row in above])
            self._lower.append([(row, work[row] / pivot) for row in below])
        return True


def _flat(columns: Iterable[Iterable[int]]) -> Indices:
    return np.fromiter(chain.from_iterable(columns), dtype=np.intp)


def _starts(columns: Iterable[Sequence[Any]]) -> Indices:
    """Where each column begins if they stand one behind the other, and where the last one ends."""
    return np.fromiter(accumulate(map(len, columns), initial=0), dtype=np.intp)
