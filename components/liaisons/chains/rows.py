"""Calculations along a row of links, described by one link.

A program is a list of steps (map, sum, scan) over scalar symbols, each one number a link or a single number.
:mod:`liaisons.chains.row_functions` makes a CasADi function of it, :mod:`liaisons.chains.loops` loops in C, and
:mod:`liaisons.chains.row_derivatives` programs of its derivatives.  The size of all but the first, and the time to
make them, do not depend on the number of links.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Self, final

import casadi as ca

Rewrite = Callable[[ca.SX], ca.SX]


@dataclass(frozen=True, eq=False)
class _Named:
    """Names for expressions of one link; abstract."""

    symbols: ca.SX  # (r, 1)
    read: ca.SX  # (r, 1): expressions

    def rewritten(self, rewrite: Rewrite) -> Self:
        """Step with its expressions rewritten."""
        return replace(self, read=rewrite(self.read))

    def restricted_to(self, needed: set[int]) -> Self:
        """Step with those of its rows that define needed symbols, by their keys."""
        rows = _row_indices(self.symbols, needed)
        return replace(self, symbols=self.symbols[rows], read=self.read[rows])


@final
class Each(_Named):
    """Map: names for one expression at each link."""


@final
class Sum(_Named):
    """Sum: single numbers, each the sum of an expression over all links."""


@dataclass(frozen=True, eq=False)
class Carry:
    """Scan: quantities that are carried from link to link."""

    symbols: ca.SX  # (c, 1) values at a link: one number a link
    start: ca.SX  # (c, 1) values at the first link, of single numbers
    following: ca.SX  # (c, 1) values at the next link
    last: ca.SX  # (c, 1) symbols of the values behind the last link: single numbers
    inward: bool  # from the last link of the row to the first

    @property
    def read(self) -> ca.SX:
        """Start values, then values at the next link (2 c, 1)."""
        return ca.vertcat(self.start, self.following)

    def rewritten(self, rewrite: Rewrite) -> Carry:
        """Scan with its expressions rewritten."""
        return replace(self, start=rewrite(self.start), following=rewrite(self.following))

    def restricted_to(self, needed: set[int]) -> Carry:
        """Carry of the symbols with these keys, and of all that they depend on."""
        reached: set[int] = set()
        new = {*_row_indices(self.symbols, needed), *_row_indices(self.last, needed)}
        while new:
            reached |= new
            new = {*_row_indices(self.symbols, keys(self.following[[*new]]))} - reached
        rows = sorted(reached)
        columns = (x[rows] for x in (self.symbols, self.start, self.following, self.last))
        return Carry(*columns, inward=self.inward)


Step = Each | Sum | Carry


def carry(symbols: ca.SX, start: ca.SX, following: ca.SX, *, inward: bool = False) -> Carry:
    """Scan with new symbols for its last values."""
    last = ca.SX.sym("last", symbols.shape[0])
    return Carry(symbols, ca.densify(start), ca.densify(following), last, inward)


@dataclass(frozen=True, eq=False)
class Vector:
    """Argument or result: variables one after the other, each a single number or one number a link."""

    entries: ca.SX  # (r, 1): symbols of an argument, expressions of a result
    each: tuple[bool, ...]  # whether it is one number a link

    def offsets(self, n: int) -> list[int]:
        """Index of each entry for n links, and the length of the vector."""
        return [0, *accumulate(n if each else 1 for each in self.each)]


@dataclass(frozen=True, eq=False)
class RowProgram:
    """A function of vectors that belong to n links.

    :param steps: each needs arguments and what the steps before it define.
    """

    name: str
    n: int
    arguments: tuple[Vector, ...]
    steps: tuple[Step, ...]
    results: tuple[Vector, ...]


def row_program(
    name: str, n: int, arguments: Sequence[Vector], steps: Iterable[Step], results: Sequence[Vector]
) -> RowProgram:
    """Program with structural constants propagated and dead code removed."""
    constants: list[tuple[ca.SX, ca.SX]] = []

    def simplified(expression: ca.SX) -> ca.SX:
        return substituted(expression, constants)

    simple: list[Step] = []
    for step in _needed_steps(steps, results):
        simple.append(step.rewritten(simplified))
        if new := _constant_symbols(simple[-1]):
            constants += new
            simple[-1] = simple[-1].rewritten(simplified)
    ends = [Vector(simplified(result.entries), result.each) for result in results]
    return RowProgram(name, n, tuple(arguments), tuple(_needed_steps(simple, ends)), tuple(ends))


def _needed_steps(steps: Iterable[Step], results: Sequence[Vector]) -> list[Step]:
    """Steps that the results depend on."""
    needed = keys(ca.vertcat(*(result.entries for result in results)))
    used: list[Step] = []
    for step in reversed([*steps]):
        picked = step.restricted_to(needed)
        if picked.symbols.numel():
            needed |= keys(picked.read)
            used.append(picked)
    return used[::-1]


def leading_results(name: str, original: RowProgram, count: int) -> RowProgram:
    """Program of the first ``count`` numbers of its only result."""
    (whole,) = original.results
    rows = whole.offsets(original.n).index(count)
    return row_program(
        name, original.n, original.arguments, original.steps, [Vector(whole.entries[:rows], whole.each[:rows])]
    )


def _constant_symbols(step: Step) -> list[tuple[ca.SX, ca.SX]]:
    """Pairs of a symbol that is constant, and its value; carried ones are constant if no link changes them."""
    if not isinstance(step, Carry):
        pairs = zip(ca.vertsplit(step.symbols), ca.vertsplit(step.read), strict=True)
        return [(symbol, x) for symbol, x in pairs if (x.is_constant() if isinstance(step, Each) else x.is_zero())]
    symbols, last = ca.vertsplit(step.symbols), ca.vertsplit(step.last)
    assumed = {i: start for i, start in enumerate(ca.vertsplit(step.start)) if start.is_constant()}
    while True:
        pairs = [(symbols[i], start) for i, start in assumed.items()]
        following = ca.vertsplit(substituted(step.following, pairs))
        wrong = [
            i
            for i, start in assumed.items()
            if not (following[i].is_constant() and float(following[i]) == float(start))
        ]
        if not wrong:
            return [*pairs, *((last[i], start) for i, start in assumed.items())]
        for i in wrong:
            del assumed[i]


def append_new_symbols(symbols: ca.SX, pairs: list[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Append a pair of these symbols and as many new ones; return the new ones."""
    pairs.append((symbols, ca.SX.sym("x", symbols.shape[0])))
    return pairs[-1][1]


def renamed_steps(steps: Sequence[Step], expression: ca.SX) -> tuple[list[Step], ca.SX]:
    """Steps, and an expression that needs them, with new symbols for all that the steps define."""
    pairs: list[tuple[ca.SX, ca.SX]] = []
    copies: list[Step] = []

    for step in steps:
        named = replace(step, symbols=append_new_symbols(step.symbols, pairs))
        if isinstance(named, Carry):
            named = replace(named, last=append_new_symbols(named.last, pairs))
        copies.append(named.rewritten(lambda x: substituted(x, pairs)))
    return copies, substituted(expression, pairs)


# ---- columns of scalar symbols ------------------------------------------------------------------------------------


def key(symbol: ca.SX) -> int:
    """Hashable identity of a scalar symbol."""
    return symbol.element_hash()


def scalars(column: ca.SX) -> list[ca.SX]:
    """Entries of a column."""
    return ca.vertsplit(ca.densify(column)) if column.numel() else []


def _row_indices(symbols: ca.SX, needed: set[int]) -> list[int]:
    """Indices of the symbols that are needed."""
    return [i for i, symbol in enumerate(scalars(symbols)) if key(symbol) in needed]


def keys(expression: ca.SX) -> set[int]:
    """Keys of the symbols in an expression."""
    return {key(symbol) for symbol in ca.symvar(ca.SX(expression))}


def substituted(expression: ca.SX, pairs: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Dense expression with columns of symbols replaced by columns of expressions."""
    dense = ca.densify(expression)
    if not pairs or dense.numel() == 0:
        return dense
    symbols, values = (ca.vertcat(*column) for column in zip(*pairs, strict=True))
    return ca.densify(ca.substitute(dense, symbols, values))
