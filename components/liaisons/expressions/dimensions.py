"""Units through the expressions of a component: like terms in sums, pure numbers in functions, the declared unit.

The units of the symbols are declared; those of everything else follow along CasADi's graph.  The radian is 1, and so is
a bare number.  Zero, infinity, truth values and what is not known to the rules fit any unit: they are unknown, not
wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.expressions.operations import instructions
from liaisons.units import NUMBER, Powers, product, written

_READABLE = 90
"""So many characters of a term are printed."""


@dataclass(frozen=True, eq=False)
class Declared:
    """An expression, whose it is, and its unit."""

    label: str  # "Pendulum.potential_energy"
    expression: ca.SX
    unit: str


def check_units(symbols: Mapping[str, tuple[ca.SX, str]], declared: Sequence[Declared]) -> None:
    """Refuse expressions whose units cannot be right; the first of them that is wrong is reported.

    :param symbols: by name the symbols that occur, with their units; those with ``units.ANY`` are unknown.
    :param declared: scalar expressions, those that others are made of first.
    :raises ComponentError: with the term, its unit and the one that is expected.
    """
    if not declared:
        return
    column = ca.vertcat(ca.SX(0, 1), *(symbol for symbol, _ in symbols.values()))
    function = ca.Function("units", [column], [ca.densify(ca.vertcat(*(item.expression for item in declared)))])
    graph = _Graph()
    results = graph.read(function, [(name, _known(unit)) for name, (_, unit) in symbols.items()])
    for item, node in zip(declared, results, strict=True):
        expected = _known(item.unit)
        if graph.wrong or (expected is not None and graph.units[node] not in (None, expected)):
            graph.report(item.label, node, expected, item.unit)


def _known(unit: str) -> Powers | None:
    return None if unit == units.ANY else units.powers(unit)


@dataclass
class _Graph:
    """Nodes in the order of evaluation: operation, operands, and the unit; None: unknown."""

    codes: list[int] = field(default_factory=list)
    operands: list[tuple[int, ...]] = field(default_factory=list)
    units: list[Powers | None] = field(default_factory=list)
    constants: dict[int, float] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    wrong: dict[int, str] = field(default_factory=dict)

    def read(self, function: ca.Function, symbols: Sequence[tuple[str, Powers | None]]) -> list[int]:
        """Read a scalar program of one input; the nodes of its results."""
        work: dict[int, int] = {}
        results = [0] * function.numel_out(0)
        for code, read, write, value in instructions(function):
            if code == ca.OP_OUTPUT:
                results[write[1]] = work[read[0]]
                continue
            node = len(self.codes)
            self.codes.append(code)
            self.operands.append(() if code in (ca.OP_INPUT, ca.OP_CONST) else tuple(work[slot] for slot in read))
            work[write[0]] = node
            if code == ca.OP_INPUT:
                self.names[node], unit = symbols[read[1]]
            elif code == ca.OP_CONST:
                self.constants[node] = value
                unit = None if value == 0 or math.isinf(value) else NUMBER
                if math.isnan(value):
                    self.wrong[node] = "nan is in it: float() and Python's math know no symbols; use ca.sin and so on"
            else:
                unit = self._unit(node, code)
            self.units.append(unit)
        return results

    def _unit(self, node: int, code: int) -> Powers | None:
        """That of the result from those of the operands; None also where these cannot be right, which is noted."""
        operands = self.operands[node]
        taken, exponents = [self.units[operand] for operand in operands], _EXPONENTS.get(code)
        if code in _ALIKE | _COMPARED or code == ca.OP_ATAN2:
            left, right = taken
            if left is not None and right is not None and left != right:
                self.wrong[node] = self._unlike(node)
            elif code not in _COMPARED:
                return NUMBER if code == ca.OP_ATAN2 else left or right
            return None
        if code in _PURE:
            what = f"{_PURE[code]}({self.text(operands[0])}) takes a pure number or an angle"
            return self._pure(node, operands[0], what)
        if code in (ca.OP_POW, ca.OP_CONSTPOW):
            base, exponent = operands
            if exponent not in self.constants:
                what = "under an exponent that is not constant the base must be a pure number"
                pure = self._pure(node, exponent, "an exponent must be a pure number")
                return pure and self._pure(node, base, what)
            taken, exponents = taken[:1], (Fraction(self.constants[exponent]).limit_denominator(1000),)
        if exponents:
            factors = [(unit, exponent) for unit, exponent in zip(taken, exponents, strict=True) if unit is not None]
            return product(factors) if len(factors) == len(taken) else None
        return NUMBER if code == ca.OP_SIGN else taken[_KEPT[code]] if code in _KEPT else None

    def _pure(self, node: int, operand: int, what: str) -> Powers | None:
        unit = self.units[operand]
        if unit in (None, NUMBER):
            return NUMBER
        self.wrong[node] = f"{what}, but {self.text(operand)} is {written(unit or NUMBER)}"
        return None

    # ---- what to say ------------------------------------------------------------------------------------------

    def report(self, label: str, result: int, expected: Powers | None, unit: str | None) -> None:
        """Raise what is wrong about a result, if anything is."""
        terms = [result] if expected is None else list(self._terms(result))
        for term in terms:
            wrong = next((node for node in self._below(term) if node in self.wrong), None)
            if wrong is not None:
                raise ComponentError(f"{label}: {self.wrong[wrong]}")
            found = self.units[term]
            if expected is None or found in (None, expected):
                continue
            what, missing = "" if len(terms) == 1 else "the term ", product([(expected, 1), (found, -1)])
            raise ComponentError(
                f"{label}: {what}{self.text(term)} is {_called(found)} where {unit} is expected: "
                f"a factor of {written(missing)} is missing{self._bare(term)}"
            )

    def _unlike(self, node: int) -> str:
        """Of the terms of a sum two that do not fit each other."""
        compared = self._terms(node) if self.codes[node] in _SUMS else self.operands[node]
        terms = [term for term in compared if self.units[term] is not None]
        first = terms[0]
        other = next((term for term in terms if self.units[term] != self.units[first]), terms[-1])
        one, two = (f"{self.text(term)} is {_called(self.units[term])}" for term in (first, other))
        return f"in {self.text(node)}, {one} but {two}; they must have one unit{self._bare(node)}"

    def _bare(self, node: int) -> str:
        """A hint where a number stands in the place of a quantity."""
        numbers = [self.constants[n] for n in self._below(node) if n in self.constants]
        odd = [n for n in numbers if n != 0 and not ((2 * n).is_integer() or (1 / n).is_integer())]
        return f"; {odd[0]:g} counts as a pure number, a Parameter has a unit" if odd else ""

    def _terms(self, node: int) -> Iterator[int]:
        """The terms of a sum; anything else is its own and only term."""
        if self.codes[node] in _SUMS:
            for operand in self.operands[node]:
                yield from self._terms(operand)
        else:
            yield node

    def _below(self, node: int) -> Iterator[int]:
        """A node and all that it is made of, each once, what is evaluated first being first."""
        seen, waiting = {node}, [node]
        while waiting:
            for operand in self.operands[waiting.pop()]:
                if operand not in seen:
                    seen.add(operand)
                    waiting.append(operand)
        return iter(sorted(seen))

    def text(self, node: int) -> str:
        """An expression as one writes it, cut where it is long."""
        text, _ = self._text(node, 8)
        return text if len(text) <= _READABLE else f"{text[: _READABLE - 4].rstrip()} ..."

    def _text(self, node: int, depth: int) -> tuple[str, int]:
        """Text and precedence, as in :data:`_WRITTEN`."""
        if node in self.names:
            return self.names[node], 3
        if node in self.constants:
            return f"{self.constants[node]:g}", 3 if self.constants[node] >= 0 else 0
        if depth == 0:
            return "(...)", 3
        code = self.codes[node]
        parts = [self._text(operand, depth - 1) for operand in self.operands[node]]
        if code not in _WRITTEN:
            return f"{_NAMES.get(code, 'call')}({', '.join(text for text, _ in parts)})", 3
        pattern, wanted, precedence = _WRITTEN[code]
        texts = (text if own >= least else f"({text})" for (text, own), least in zip(parts, wanted, strict=True))
        return pattern.format(*texts), precedence


def _called(unit: Powers | None) -> str:
    return "a pure number" if unit == NUMBER else written(unit or NUMBER)


# ---- the rules ---------------------------------------------------------------------------------------------------


def _named(*codes: str) -> Iterator[tuple[int, str]]:
    return ((getattr(ca, f"OP_{code}"), code.lower()) for code in codes)


_NAMES = dict(_named("FMIN", "FMAX", "FMOD", "REMAINDER", "HYPOT", "ATAN2", "SQRT", "SIGN", "NOT", "AND", "OR"))
_NAMES |= dict(_named("COPYSIGN", "FABS", "FLOOR", "CEIL")) | {ca.OP_IF_ELSE_ZERO: "if_else"}
_PURE = dict(_named("EXP", "LOG", "LOG1P", "EXPM1", "ERF", "ERFINV", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN"))
_PURE |= dict(_named("SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH"))
_NAMES |= _PURE
"""How the operations are called that are calls."""

_ALIKE = {ca.OP_ADD, ca.OP_SUB, ca.OP_FMIN, ca.OP_FMAX, ca.OP_FMOD, ca.OP_REMAINDER, ca.OP_HYPOT}
"""Operations whose operands have one unit, which is that of the result."""

_COMPARED = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
_KEPT = dict.fromkeys((ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_COPYSIGN), 0)
_KEPT[ca.OP_IF_ELSE_ZERO] = 1
"""Which operand has the unit of the result."""

_EXPONENTS: dict[int, tuple[int | Fraction, ...]] = {
    ca.OP_MUL: (1, 1),
    ca.OP_DIV: (1, -1),
    ca.OP_INV: (-1,),
    ca.OP_SQ: (2,),
    ca.OP_SQRT: (Fraction(1, 2),),
}
"""The unit of the result as a product of powers of those of the operands; of what is nowhere here it is unknown."""

_WRITTEN: dict[int, tuple[str, tuple[int, ...], int]] = {
    ca.OP_ADD: ("{} + {}", (0, 0), 0),
    ca.OP_SUB: ("{} - {}", (0, 1), 0),
    ca.OP_NEG: ("-{}", (1,), 0),
    ca.OP_TWICE: ("2*{}", (1,), 1),
    ca.OP_MUL: ("{}*{}", (1, 1), 1),
    ca.OP_DIV: ("{}/{}", (1, 2), 1),
    ca.OP_INV: ("1/{}", (2,), 1),
    ca.OP_SQ: ("{}^2", (3,), 2),
    ca.OP_POW: ("{}^{}", (3, 3), 2),
    ca.OP_CONSTPOW: ("{}^{}", (3, 3), 2),
    ca.OP_LT: ("({} < {})", (0, 0), 3),
    ca.OP_LE: ("({} <= {})", (0, 0), 3),
    ca.OP_EQ: ("({} == {})", (0, 0), 3),
    ca.OP_NE: ("({} != {})", (0, 0), 3),
}
"""How operations are written that are no calls: the operands, their least precedence, and the precedence of the whole:
0 sum, 1 product, 2 power, 3 what needs no brackets."""
_SUMS = frozenset({ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE})
