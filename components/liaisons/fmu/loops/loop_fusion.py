"""What of a program along a row of links is calculated together, in one passage from link to link."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from liaisons.expressions.rows import Carry, Each, RowProgram, Sum, key, keys, scalars, substituted

_CHEAP = {ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE}
_CHEAP |= {ca.OP_ASSIGN, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}


@dataclass(frozen=True, eq=False)
class Passage:
    """One passage: what is carried, and what is calculated at each link."""

    inward: bool | None  # None: nothing is carried, the links are independent of each other
    carries: list[Carry] = field(default_factory=list)
    rows: list[tuple[str, ca.SX]] = field(default_factory=list)  # names of arrays, and what fills them
    sums: list[tuple[ca.SX, ca.SX]] = field(default_factory=list)  # symbols, terms


class Passages:
    """The passages of a program, in their order; all expressions without names for others."""

    def __init__(self, program: RowProgram) -> None:
        self.found: list[Passage] = []
        self.definitions: list[tuple[ca.SX, ca.SX]] = []  # names for expressions, and these
        self.neighbours: dict[int, tuple[Carry, int]] = {}  # what is not carried: it can be had from the neighbours
        self.ends: dict[int, tuple[Carry, int]] = {}  # what the last link hands on of it
        self._first: dict[int, int] = {}  # the first passage in which a symbol is known
        neighbourly = _is_neighbourly(program)
        for step in program.steps:
            inlined = step.rewritten(self.inlined)
            match inlined:
                case Each():
                    self.definitions.append((inlined.symbols, inlined.read))
                case Sum():
                    for symbol, term in zip(scalars(inlined.symbols), scalars(inlined.read), strict=True):
                        passage = self.at_links(term)
                        passage.sums.append((symbol, term))
                        self._first[key(symbol)] = self.found.index(passage) + 1
                case Carry() if neighbourly:
                    self.neighbours |= {key(x): (inlined, i) for i, x in enumerate(scalars(inlined.symbols))}
                    self.ends |= {key(x): (inlined, i) for i, x in enumerate(scalars(inlined.last))}
                case Carry():
                    self._carry(inlined)

    def inlined(self, expression: ca.SX) -> ca.SX:
        """Without names for expressions."""
        return substituted(expression, self.definitions)

    def at_links(self, expression: ca.SX) -> Passage:
        """Where to calculate what is not carried: where it is first possible, apart from what is carried if it can."""
        needed = keys(expression)
        for passage in self.found[self._earliest(expression) :]:
            if passage.inward is None or any(needed & keys(carry.symbols) for carry in passage.carries):
                return passage
        self.found.append(Passage(None))
        return self.found[-1]

    def _carry(self, carry: Carry) -> None:
        """Into the first passage in its direction where all that it needs is known, or carried along."""
        places = range(self._earliest(carry.read), len(self.found))
        place = next((i for i in places if self.found[i].inward is carry.inward), len(self.found))
        if place == len(self.found):
            self.found.append(Passage(carry.inward))
        self.found[place].carries.append(carry)
        self._first |= dict.fromkeys(keys(carry.symbols), place)
        self._first |= dict.fromkeys(keys(carry.last), place + 1)

    def _earliest(self, expression: ca.SX) -> int:
        return max((self._first.get(symbol, 0) for symbol in keys(expression)), default=0)


def _is_neighbourly(program: RowProgram) -> bool:
    """Whether nothing has to be carried: it follows from the neighbours by a few products."""
    known = {symbol for vector in program.arguments for symbol in keys(vector.entries)}
    definitions: list[tuple[ca.SX, ca.SX]] = []
    for step in program.steps:
        read = substituted(step.read, definitions)
        match step:
            case Each():
                definitions.append((step.symbols, read))
            case Carry() if keys(read) <= known and _is_cheap(read):
                known |= keys(step.symbols)
            case Carry():
                return False
    return True


def _is_cheap(expressions: ca.SX) -> bool:
    function = ca.Function("expressions", ca.symvar(expressions), [expressions])
    return {function.instruction_id(i) for i in range(function.n_instructions())} <= _CHEAP
