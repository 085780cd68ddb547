"""Fusion of the steps of a program along a row of links into loops."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from liaisons.chains.rows import Carry, Each, RowProgram, Sum, key, keys, scalars, substituted
from liaisons.expressions import operation_codes

_CHEAP = {ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE}
_CHEAP |= {ca.OP_ASSIGN, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}


@dataclass(frozen=True, eq=False)
class FusedLoop:
    """One loop over the links: what is carried, and what is calculated at each of them."""

    inward: bool | None  # direction; None: nothing is carried, the links are independent of each other
    carries: list[Carry] = field(default_factory=list)
    rows: list[tuple[str, ca.SX]] = field(default_factory=list)  # names of arrays, and their elements
    sums: list[tuple[ca.SX, ca.SX]] = field(default_factory=list)  # symbols, terms


class LoopFusion:
    """The loops of a program in the order of execution, whose expressions contain no definitions."""

    def __init__(self, program: RowProgram) -> None:
        self.loops: list[FusedLoop] = []
        self.definitions: list[tuple[ca.SX, ca.SX]] = []  # symbols, expressions
        self.neighbours: dict[int, tuple[Carry, int]] = {}  # calculated from the neighbours instead of carried
        self.ends: dict[int, tuple[Carry, int]] = {}  # their values behind the last link
        self._first: dict[int, int] = {}  # the first loop in which a symbol can be used
        local = is_cheap_by_neighbours(program)
        for step in program.steps:
            inlined = step.rewritten(self.inlined)
            match inlined:
                case Each():
                    self.definitions.append((inlined.symbols, inlined.read))
                case Sum():
                    for symbol, term in zip(scalars(inlined.symbols), scalars(inlined.read), strict=True):
                        loop = self.assign_loop(term)
                        loop.sums.append((symbol, term))
                        self._first[key(symbol)] = self.loops.index(loop) + 1
                case Carry() if local:
                    self.neighbours |= {key(x): (inlined, i) for i, x in enumerate(scalars(inlined.symbols))}
                    self.ends |= {key(x): (inlined, i) for i, x in enumerate(scalars(inlined.last))}
                case Carry():
                    self._add_carry(inlined)

    def inlined(self, expression: ca.SX) -> ca.SX:
        """Expression in which definitions are replaced by their expressions."""
        return substituted(expression, self.definitions)

    def assign_loop(self, expression: ca.SX) -> FusedLoop:
        """Return the first loop in which an expression can be calculated, or add and return a new one."""
        needed = keys(expression)
        for loop in self.loops[self._earliest_index(expression) :]:
            if loop.inward is None or any(needed & keys(carry.symbols) for carry in loop.carries):
                return loop
        self.loops.append(FusedLoop(None))
        return self.loops[-1]

    def _add_carry(self, carry: Carry) -> None:
        """Add a carried value to the first loop, inward or outward as it is, in which all that it reads is known."""
        index = self._earliest_index(carry.read)
        while index < len(self.loops) and self.loops[index].inward is not carry.inward:
            index += 1
        if index == len(self.loops):
            self.loops.append(FusedLoop(carry.inward))
        self.loops[index].carries.append(carry)
        self._first |= dict.fromkeys(keys(carry.symbols), index)
        self._first |= dict.fromkeys(keys(carry.last), index + 1)

    def _earliest_index(self, expression: ca.SX) -> int:
        """Index of the first loop in which all symbols of an expression are available."""
        return max((self._first.get(symbol, 0) for symbol in keys(expression)), default=0)


def is_cheap_by_neighbours(program: RowProgram) -> bool:
    """Whether each carried value is a cheap expression of arguments and of values at the neighbouring link."""
    available = {symbol for vector in program.arguments for symbol in keys(vector.entries)}
    definitions: list[tuple[ca.SX, ca.SX]] = []
    for step in program.steps:
        read = substituted(step.read, definitions)
        match step:
            case Each():
                definitions.append((step.symbols, read))
            case Carry() if keys(read) <= available and _is_cheap(read):
                available |= keys(step.symbols)
            case Carry():
                return False
    return True


def _is_cheap(expressions: ca.SX) -> bool:
    """Whether expressions consist of sums, products and quotients."""
    function = ca.Function("expressions", ca.symvar(expressions), [expressions])
    return operation_codes(function) <= _CHEAP
