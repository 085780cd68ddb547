"""Programs along a row of links as CasADi functions, at a cost that is linear in the number of links.

The graph of a scan grows with the logarithm of the number of links: a scan of many links is ten scans of a tenth each.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import casadi as ca

from liaisons.chains.rows import Carry, Each, RowProgram, Sum, Vector, key, keys, scalars
from liaisons.expressions import interpret, perform

_BRANCHES = 10


def row_function(program: RowProgram) -> ca.Function:
    """CasADi function of a program."""
    row = _Row(program.n)
    arguments = []
    needed = keys(ca.vertcat(*(part.read for part in program.steps), *(part.entries for part in program.results)))
    for vector in program.arguments:
        ends = vector.offsets(program.n)
        arguments.append(ca.MX.sym("a", ends[-1]))
        if needed & keys(vector.entries):
            row.define(scalars(vector.entries), ca.vertsplit(arguments[-1], ends))
    for step in program.steps:
        match step:
            case Each():
                row.define(scalars(step.symbols), row.link_columns(step.read))
            case Sum():
                row.define(scalars(step.symbols), [ca.sum1(terms) for terms in row.link_columns(step.read)])
            case Carry():
                row.define_carried(step)
    return ca.Function(program.name, arguments, [row.column(result) for result in program.results])


class _Row:
    """Values of symbols: columns of n links, and single numbers."""

    def __init__(self, n: int) -> None:
        self._n = n
        self._values: dict[int, ca.MX] = {}

    def define(self, symbols: Sequence[ca.SX], values: Sequence[ca.MX]) -> None:
        """Store the values of symbols."""
        self._values |= {key(symbol): value for symbol, value in zip(symbols, values, strict=True)}

    def evaluated(self, expressions: ca.SX) -> list[ca.MX]:
        """Values of expressions, calculated operation by operation from those of symbols."""
        symbols = ca.symvar(expressions)
        function = ca.Function("expressions", symbols, [ca.cse(expressions)])

        (values,) = interpret(
            function,
            entry=lambda i, _: self._values[key(symbols[i])],
            constant=ca.MX,
            operation=perform,
        )
        return values

    def link_columns(self, expressions: ca.SX) -> list[ca.MX]:
        """Values of expressions at all links, (n, 1) each."""
        return [self._as_column(values) for values in self.evaluated(expressions)]

    def column(self, vector: Vector) -> ca.MX:
        """Values of a vector, one below the other."""
        values = self.evaluated(ca.densify(vector.entries))
        parts = [self._as_column(x) if each else x for x, each in zip(values, vector.each, strict=True)]
        return ca.densify(ca.vertcat(*parts)) if parts else ca.MX(0, 1)

    def define_carried(self, step: Carry) -> None:
        """Store the values of a scan at the links, and behind the last one."""
        start = self.evaluated(step.start)
        if keys(step.symbols) & keys(step.following):
            columns, last = self._scan_values(step, start)
        else:  # no recurrence: the values of all links at once, moved by one link
            following = self.link_columns(step.following)
            columns = [
                _shifted_by_one_link(values, edge, step.inward) for values, edge in zip(following, start, strict=True)
            ]
            last = [values[0 if step.inward else -1] for values in following]
        self.define(scalars(step.symbols), columns)
        self.define(scalars(step.last), last)

    def _scan_values(self, step: Carry, start: Sequence[ca.MX]) -> tuple[list[ca.MX], list[ca.MX]]:
        """Values of a scan at the links (n, 1), and behind the last one (1, 1)."""
        carried = scalars(step.symbols)
        own, count = keys(step.symbols), len(carried)
        read = [symbol for symbol in ca.symvar(step.following) if key(symbol) not in own]
        each, single = (
            [x for x in read if (self._values[key(x)].shape[0] == self._n) is is_each] for is_each in (True, False)
        )
        link = ca.Function("link", [*carried, *each, *single], [*scalars(ca.cse(step.following)), *carried])
        inputs = [*(self._values[key(x)].T for x in each), *(self._values[key(x)] for x in single)]
        values = list(_scan_tree(link, self._n, count, len(each), step.inward).call([*start, *inputs]))
        return [value.T for value in values[count:]], values[:count]

    def _as_column(self, values: ca.MX) -> ca.MX:
        """Single number as one at each link (n, 1); a column as it is."""
        return values if values.shape[0] == self._n else values * ca.MX.ones(self._n)


def _shifted_by_one_link(following: ca.MX, start: ca.MX, inward: bool) -> ca.MX:
    """Values at each link, from those that each link hands on and that at the first one."""
    return ca.vertcat(following[1:, :], start) if inward else ca.vertcat(start, following[:-1, :])


def _scan_tree(link: ca.Function, n: int, carried: int, each: int, inward: bool) -> ca.Function:
    """Function of a scan over n links, a tree with ten branches at each level.

    Of (start values, rows of n links, shared numbers) → (values behind the last link, rows of values at the links).
    """

    @cache
    def branch(n: int) -> ca.Function:
        if n == 1:
            return link
        size = 1
        while size * _BRANCHES < n:
            size *= _BRANCHES
        ends = [*range(0, n, size), n]
        parts = [branch(end - start) for start, end in pairwise(ends)]
        widths = [1] * carried + [n] * each + [1] * (link.n_in() - carried - each)
        arguments = [ca.MX.sym(link.name_in(i), 1, width) for i, width in enumerate(widths)]
        values, shared = arguments[:carried], arguments[carried + each :]
        split = [ca.horzsplit(column, ends) for column in arguments[carried : carried + each]]
        results: list[list[ca.MX]] = [[] for _ in parts]
        for i in reversed(range(len(parts))) if inward else range(len(parts)):
            called = list(parts[i].call([*values, *(column[i] for column in split), *shared]))
            values, results[i] = called[:carried], called[carried:]
        joined = [ca.horzcat(*pieces) for pieces in zip(*results, strict=True)]
        return ca.Function(f"links_{n}", arguments, [*values, *joined])

    return branch(n)
