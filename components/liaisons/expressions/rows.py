"""Calculations along a row of links, described by what happens at one of them.

A program is a list of steps over scalar symbols, of which some stand for one number a link and some for a single one.
From it come a CasADi function (:mod:`liaisons.expressions.row_graphs`), loops in C (:mod:`liaisons.fmu.loops`) and, as
programs again, its derivatives (:mod:`liaisons.expressions.row_derivatives`).  All but the first are no longer, and no
dearer to make, for a longer row.
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
    read: ca.SX  # (r, 1): the expressions that it evaluates

    def rewritten(self, rewrite: Rewrite) -> Self:
        return replace(self, read=rewrite(self.read))

    def picked(self, wanted: set[int]) -> Self:
        places = _places(self.symbols, wanted)
        return replace(self, symbols=self.symbols[places], read=self.read[places])


@final
class Each(_Named):
    """Names for what is the same expression at each link."""


@final
class Sum(_Named):
    """Single numbers: sums of the expressions over all links."""


@dataclass(frozen=True, eq=False)
class Carry:
    """Quantities that are carried from link to link."""

    symbols: ca.SX  # (c, 1) as a link meets them: one number a link
    start: ca.SX  # (c, 1) as the first link meets them, of single numbers
    following: ca.SX  # (c, 1) as the next link meets them
    last: ca.SX  # (c, 1) symbols of what the last link hands on: single numbers
    inward: bool  # whether the first link to be visited is the last of the row

    @property
    def read(self) -> ca.SX:
        """The expressions that it evaluates."""
        return ca.vertcat(self.start, self.following)

    def rewritten(self, rewrite: Rewrite) -> Carry:
        return replace(self, start=rewrite(self.start), following=rewrite(self.following))

    def picked(self, wanted: set[int]) -> Carry:
        """Those that are wanted, and what they follow from."""
        found: set[int] = set()
        ahead = {*_places(self.symbols, wanted), *_places(self.last, wanted)}
        while ahead:
            found |= ahead
            ahead = {*_places(self.symbols, keys(self.following[[*ahead]]))} - found
        places = sorted(found)
        columns = (x[places] for x in (self.symbols, self.start, self.following, self.last))
        return Carry(*columns, inward=self.inward)


Step = Each | Sum | Carry


def carry(symbols: ca.SX, start: ca.SX, following: ca.SX, *, inward: bool = False) -> Carry:
    """A sweep whose last values get names of their own."""
    last = ca.SX.sym("last", symbols.shape[0])
    return Carry(symbols, ca.densify(start), ca.densify(following), last, inward)


@dataclass(frozen=True, eq=False)
class Vector:
    """An argument or a result: variables one after the other, each of them one number or one number a link."""

    entries: ca.SX  # (r, 1): symbols of an argument, expressions of a result
    each: tuple[bool, ...]  # whether it is one number a link

    def offsets(self, n: int) -> list[int]:
        """Where the entries begin for n links, and where the vector ends."""
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
    """The program without what is constant by structure, and without what no result needs."""
    constants: list[tuple[ca.SX, ca.SX]] = []

    def simplified(expression: ca.SX) -> ca.SX:
        return substituted(expression, constants)

    simple: list[Step] = []
    for step in _needed(steps, results):
        simple.append(step.rewritten(simplified))
        found = _constants(simple[-1])
        if found:
            constants += found
            simple[-1] = simple[-1].rewritten(simplified)
    ends = [Vector(simplified(result.entries), result.each) for result in results]
    return RowProgram(name, n, tuple(arguments), tuple(_needed(simple, ends)), tuple(ends))


def _needed(steps: Iterable[Step], results: Sequence[Vector]) -> list[Step]:
    """Without what is not needed."""
    needed = keys(ca.vertcat(*(result.entries for result in results)))
    used: list[Step] = []
    for step in reversed([*steps]):
        picked = step.picked(needed)
        if picked.symbols.numel():
            needed |= keys(picked.read)
            used.append(picked)
    return used[::-1]


def leading(name: str, original: RowProgram, count: int) -> RowProgram:
    """The same without what lies behind the first so many numbers of its only result."""
    (whole,) = original.results
    rows = whole.offsets(original.n).index(count)
    return row_program(
        name, original.n, original.arguments, original.steps, [Vector(whole.entries[:rows], whole.each[:rows])]
    )


def dependencies(original: RowProgram, result: int, argument: int) -> list[set[int]]:
    """For each entry of a result the entries of an argument that it depends on."""
    of: dict[int, set[int]] = {key(x): {i} for i, x in enumerate(scalars(original.arguments[argument].entries))}

    def read(expression: ca.SX) -> set[int]:
        return set().union(*(of.get(symbol, set()) for symbol in keys(expression)))

    for step in original.steps:
        for symbol, expression in zip(scalars(step.symbols), scalars(step.read)[-step.symbols.numel() :], strict=True):
            of[key(symbol)] = read(expression)
        if isinstance(step, Carry):
            symbols = list(zip(*map(scalars, (step.symbols, step.last, step.start, step.following)), strict=True))
            for _ in symbols:  # as often as something can be handed on to another one
                for symbol, last, start, following in symbols:
                    of[key(symbol)] = read(start) | of[key(symbol)] | read(following)
                    of[key(last)] = of[key(symbol)]
    return [read(entry) for entry in scalars(original.results[result].entries)]


def _constants(step: Step) -> list[tuple[ca.SX, ca.SX]]:
    """Symbols that stand for constants; those carried if each link hands on what it meets."""
    if not isinstance(step, Carry):
        values = ca.vertsplit(step.read)
        found = zip(ca.vertsplit(step.symbols), values, strict=True)
        return [(symbol, x) for symbol, x in found if (x.is_constant() if isinstance(step, Each) else x.is_zero())]
    symbols, last = ca.vertsplit(step.symbols), ca.vertsplit(step.last)
    assumed = {i: start for i, start in enumerate(ca.vertsplit(step.start)) if start.is_constant()}
    while True:
        pairs = [(symbols[i], start) for i, start in assumed.items()]
        following = ca.vertsplit(substituted(step.following, pairs))
        wrong = [i for i, start in assumed.items() if not _equal(following[i], start)]
        if not wrong:
            return [*pairs, *((last[i], start) for i, start in assumed.items())]
        for i in wrong:
            del assumed[i]


def _equal(expression: ca.SX, constant: ca.SX) -> bool:
    return expression.is_constant() and float(expression) == float(constant)


def renamed(steps: Sequence[Step], expression: ca.SX) -> tuple[list[Step], ca.SX]:
    """The same steps and an expression that needs them, with symbols of their own."""
    pairs: list[tuple[ca.SX, ca.SX]] = []
    found: list[Step] = []

    def fresh(symbols: ca.SX) -> ca.SX:
        pairs.append((symbols, ca.SX.sym("x", symbols.shape[0])))
        return pairs[-1][1]

    for step in steps:
        named = replace(step, symbols=fresh(step.symbols))
        if isinstance(named, Carry):
            named = replace(named, last=fresh(named.last))
        found.append(named.rewritten(lambda x: substituted(x, pairs)))
    return found, substituted(expression, pairs)


# ---- columns of scalar symbols ------------------------------------------------------------------------------------


def key(symbol: ca.SX) -> int:
    """What tells a scalar symbol from all others."""
    return symbol.element_hash()


def scalars(column: ca.SX) -> list[ca.SX]:
    """The entries of a column."""
    return ca.vertsplit(ca.densify(column)) if column.numel() else []


def _places(symbols: ca.SX, wanted: set[int]) -> list[int]:
    return [i for i, symbol in enumerate(scalars(symbols)) if key(symbol) in wanted]


def keys(expression: ca.SX) -> set[int]:
    """Of the symbols in an expression."""
    return {key(symbol) for symbol in ca.symvar(ca.SX(expression))}


def substituted(expression: ca.SX, pairs: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """A dense expression with columns of expressions in the place of columns of symbols."""
    dense = ca.densify(expression)
    if not pairs or dense.numel() == 0:
        return dense
    symbols, values = (ca.vertcat(*column) for column in zip(*pairs, strict=True))
    return ca.densify(ca.substitute(dense, symbols, values))
