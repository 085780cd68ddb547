"""Programs along a row of links as CasADi functions, at a cost that is linear in the number of links.

The graph of a sweep grows with the logarithm of the number of links: a sweep over many links is ten sweeps over a tenth
of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import casadi as ca

from liaisons.expressions.operations import instructions
from liaisons.expressions.rows import Carry, Each, RowProgram, Sum, Vector, key, keys, scalars

_BRANCHES = 10


def graph(program: RowProgram) -> ca.Function:
    """The function that a program describes."""
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
                row.define(scalars(step.symbols), row.at_links(step.read))
            case Sum():
                row.define(scalars(step.symbols), [ca.sum1(terms) for terms in row.at_links(step.read)])
            case Carry():
                row.carry(step)
    return ca.Function(program.name, arguments, [row.column(result) for result in program.results])


class _Row:
    """What is known of n links: columns, and single numbers, by the symbols that stand for them."""

    def __init__(self, n: int) -> None:
        self._n = n
        self._known: dict[int, ca.MX] = {}

    def define(self, symbols: Sequence[ca.SX], values: Sequence[ca.MX]) -> None:
        self._known |= {key(symbol): value for symbol, value in zip(symbols, values, strict=True)}

    def evaluated(self, expressions: ca.SX) -> list[ca.MX]:
        """Expressions with what is known in the place of symbols, operation by operation."""
        symbols = ca.symvar(expressions)
        function = ca.Function("expressions", symbols, [ca.cse(expressions)])
        work: dict[int, ca.MX] = {}
        found = [ca.MX()] * expressions.numel()
        for code, read, write, constant in instructions(function):
            match code:
                case ca.OP_OUTPUT:
                    found[write[1]] = work[read[0]]
                case ca.OP_INPUT:
                    work[write[0]] = self._known[key(symbols[read[0]])]
                case ca.OP_CONST:
                    work[write[0]] = ca.MX(constant)
                case _ if len(read) == 1:
                    work[write[0]] = ca.MX.unary(code, work[read[0]])
                case _:
                    work[write[0]] = ca.MX.binary(code, work[read[0]], work[read[1]])
        return found

    def at_links(self, expressions: ca.SX) -> list[ca.MX]:
        """Expressions of one link for all links, (n, 1) each."""
        return [self._for_each(values) for values in self.evaluated(expressions)]

    def column(self, vector: Vector) -> ca.MX:
        """A result."""
        values = self.evaluated(ca.densify(vector.entries))
        parts = [self._for_each(x) if each else x for x, each in zip(values, vector.each, strict=True)]
        return ca.densify(ca.vertcat(*parts)) if parts else ca.MX(0, 1)

    def carry(self, step: Carry) -> None:
        """Define what the links meet, and what the last one hands on."""
        start = self.evaluated(step.start)
        if keys(step.symbols) & keys(step.following):
            met, last = self._carried(step, start)
        else:  # what a link hands on does not depend on what it was handed: no link has to wait for another
            handed = self.at_links(step.following)
            met = [_moved(values, edge, step.inward) for values, edge in zip(handed, start, strict=True)]
            last = [values[0 if step.inward else -1] for values in handed]
        self.define(scalars(step.symbols), met)
        self.define(scalars(step.last), last)

    def _carried(self, step: Carry, start: Sequence[ca.MX]) -> tuple[list[ca.MX], list[ca.MX]]:
        carried = scalars(step.symbols)
        own, count = keys(step.symbols), len(carried)
        others = [symbol for symbol in ca.symvar(step.following) if key(symbol) not in own]
        each, single = (
            [x for x in others if (self._known[key(x)].shape[0] == self._n) is is_each] for is_each in (True, False)
        )
        link = ca.Function("link", [*carried, *each, *single], [*scalars(ca.cse(step.following)), *carried])
        known = [*(self._known[key(x)].T for x in each), *(self._known[key(x)] for x in single)]
        values = list(_tree(link, self._n, count, len(each), step.inward).call([*start, *known]))
        return [value.T for value in values[count:]], values[:count]

    def _for_each(self, values: ca.MX) -> ca.MX:
        return values if values.shape[0] == self._n else values * ca.MX.ones(self._n)


def _moved(handed: ca.MX, start: ca.MX, inward: bool) -> ca.MX:
    """What each link meets, where this is what each hands on."""
    return ca.vertcat(handed[1:, :], start) if inward else ca.vertcat(start, handed[:-1, :])


def _tree(link: ca.Function, n: int, carried: int, each: int, inward: bool) -> ca.Function:
    """(carried, columns of n links, shared) → (carried after them, as they met it): ten branches a level."""

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
        handed, shared = arguments[:carried], arguments[carried + each :]
        split = [ca.horzsplit(column, ends) for column in arguments[carried : carried + each]]
        results: list[list[ca.MX]] = [[] for _ in parts]
        for i in reversed(range(len(parts))) if inward else range(len(parts)):
            values = list(parts[i].call([*handed, *(column[i] for column in split), *shared]))
            handed, results[i] = values[:carried], values[carried:]
        joined = [ca.horzcat(*pieces) for pieces in zip(*results, strict=True)]
        return ca.Function(f"links_{n}", arguments, [*handed, *joined])

    return branch(n)
