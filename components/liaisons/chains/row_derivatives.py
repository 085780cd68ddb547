"""Forward and reverse derivatives of programs along a row of links, as programs whose size is that of the original.

With c carried, c⁺ = F(c, x), adjoints run the other way: λ = F_cᵀ λ⁺ + ∂(all else)/∂c, and x gets F_xᵀ λ⁺.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from liaisons.chains.rows import (
    Carry,
    Each,
    RowProgram,
    Step,
    Sum,
    Vector,
    append_new_symbols,
    carry,
    key,
    row_program,
)


def forward(original: RowProgram) -> RowProgram:
    """Program of directional derivatives: (arguments, results, directions) → derivatives of the results."""
    directions = [_new_symbols(argument) for argument in original.arguments]
    pairs = [(a.entries, d.entries) for a, d in zip(original.arguments, directions, strict=True) if a.entries.numel()]

    def derivative(expressions: ca.SX) -> ca.SX:
        symbols, seeds = (ca.vertcat(*column) for column in zip(*pairs, strict=True))
        return ca.densify(ca.jtimes(expressions, symbols, seeds))

    steps: list[Step] = []
    for step in original.steps:
        symbols = append_new_symbols(step.symbols, pairs)
        match step:
            case Carry():
                start, following = derivative(step.start), derivative(step.following)
                steps += [step, Carry(symbols, start, following, append_new_symbols(step.last, pairs), step.inward)]
            case Each() | Sum():
                steps += [step, replace(step, symbols=symbols, read=derivative(step.read))]
    return row_program(
        f"{original.name}_forward",
        original.n,
        [*original.arguments, *map(_new_symbols, original.results), *directions],
        steps,
        [Vector(derivative(result.entries), result.each) for result in original.results],
    )


def reverse(original: RowProgram) -> RowProgram:
    """Program of adjoint derivatives: (arguments, results, weights) → gradient of the weighted results."""
    weights = [_new_symbols(result) for result in original.results]
    adjoints = _Adjoints()
    for result, weight in zip(original.results, weights, strict=True):
        for single in (True, False):  # what is one number a link, and the rest
            rows = [i for i, each in enumerate(result.each) if each is not single]
            adjoints.accumulate(result.entries[rows], weight.entries[rows], single=single)
    for step in reversed(original.steps):
        adjoints.propagate(step)
    results = [Vector(adjoints.pop(argument.entries, argument.each), argument.each) for argument in original.arguments]
    return row_program(
        f"{original.name}_reverse",
        original.n,
        [*original.arguments, *map(_new_symbols, original.results), *weights],
        [*original.steps, *adjoints.steps],
        results,
    )


class _Adjoints:
    """Adjoints of symbols, accumulated from the expressions that depend on them."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self._at_links: dict[int, ca.SX] = {}
        self._alone: dict[int, ca.SX] = {}

    def accumulate(self, expressions: ca.SX, weights: ca.SX, *, single: bool) -> None:
        """Add what expressions with these adjoints contribute to the adjoints of their symbols.

        :param single: whether the expressions are single numbers, or numbers at each link.
        """
        if expressions.numel() == 0:
            return
        gathered = self._alone if single else self._at_links
        symbols = ca.symvar(expressions)
        if symbols:
            shares = ca.jtimes(expressions, ca.vertcat(*symbols), weights, True)
            for symbol, share in zip(symbols, ca.vertsplit(ca.densify(shares)), strict=True):
                gathered[key(symbol)] = gathered.get(key(symbol), 0) + share

    def pop(self, symbols: ca.SX, each: Sequence[bool]) -> ca.SX:
        """Remove and return the adjoints of symbols; for a single number, append the step that sums over the links."""
        popped = []
        for symbol, of_link in zip(ca.vertsplit(symbols) if symbols.numel() else (), each, strict=True):
            at_links = self._at_links.pop(key(symbol), ca.SX(0))
            if of_link:
                popped.append(at_links)
                continue
            total = ca.SX.sym("total")
            self.steps.append(Sum(total, at_links))
            popped.append(total + self._alone.get(key(symbol), 0))
        return ca.densify(ca.vertcat(*popped)) if popped else ca.SX(0, 1)

    def propagate(self, step: Step) -> None:
        """Propagate adjoints from what a step defines to what it reads."""
        count = step.symbols.shape[0]
        match step:
            case Each():
                self.accumulate(step.read, self._define_weights(self.pop(step.symbols, [True] * count)), single=False)
            case Sum():
                self.accumulate(step.read, self.pop(step.symbols, [False] * count), single=False)
            case Carry():
                own = self.pop(step.symbols, [True] * count)
                start = self.pop(step.last, [False] * count)
                beyond = ca.SX.sym("w", count)
                through = ca.jtimes(step.following, step.symbols, beyond, True)
                carried = carry(beyond, start, through + own, inward=not step.inward)
                self.steps.append(carried)
                self.accumulate(step.following, beyond, single=False)
                for symbol in ca.vertsplit(step.symbols):  # their adjoints go to the next link, not to an earlier step
                    self._at_links.pop(key(symbol), None)
                self.accumulate(step.start, carried.last, single=True)

    def _define_weights(self, weights: ca.SX) -> ca.SX:
        """Append a step that defines weights at each link; return their symbols."""
        names = ca.SX.sym("w", weights.shape[0])
        self.steps.append(Each(names, weights))
        return names


def _new_symbols(vector: Vector) -> Vector:
    """Vector of new symbols in the shape of another one."""
    return Vector(ca.SX.sym("d", vector.entries.shape[0]), vector.each)
