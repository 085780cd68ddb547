"""Units through the expressions of a component: like terms in sums, pure numbers in functions, the declared unit.

Symbols have declared units; those of everything else follow along CasADi's graph.  The radian is 1, and so is a bare
number.  Zero, infinity, truth values and operations without a rule fit any unit: they are unknown, not wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi as ca

from liaisons.base import units
from liaisons.base.units import NUMBER, Powers, product, unit_name
from liaisons.errors import ComponentError
from liaisons.expressions.operations import NAMES, interpret

_READABLE = 90
"""Largest number of characters of a term in a message."""


@dataclass(frozen=True, eq=False)
class Declared:
    """An expression with its declared unit, and the name of its owner and itself."""

    label: str  # "Pendulum.potential_energy"
    expression: ca.SX
    unit: str


def check_units(symbols: Mapping[str, tuple[ca.SX, str]], declared: Sequence[Declared]) -> None:
    """Raise an error for the first expression with another unit than declared.

    :param symbols: by name the symbols that occur, with their units; those with ``units.ANY`` are unknown.
    :param declared: scalar expressions, in the order of their dependence.
    :raises ComponentError: with the term, its unit and the expected one.
    """
    if not declared:
        return
    column = ca.vertcat(ca.SX(0, 1), *(symbol for symbol, _ in symbols.values()))
    function = ca.Function("units", [column], [ca.densify(ca.vertcat(*(item.expression for item in declared)))])
    names = [(name, _powers(unit)) for name, (_, unit) in symbols.items()]
    nodes: list[_Node] = []

    def append(code: int, operands: Sequence[_Node] = (), **attributes: Any) -> _Node:
        nodes.append(_Node(len(nodes), code, operands, **attributes))
        return nodes[-1]

    def entry(_: int, row: int) -> _Node:
        name, unit = names[row]
        return append(ca.OP_INPUT, name=name, unit=unit)

    def constant(value: float) -> _Node:
        wrong = "nan is in it: float() and Python's math know no symbols; use ca.sin and so on"
        unit = None if value == 0 or math.isinf(value) else NUMBER
        return append(ca.OP_CONST, constant=value, unit=unit, wrong=wrong if math.isnan(value) else "")

    def operation(code: int, operands: list[_Node]) -> _Node:
        node = append(code, operands)
        node.unit = _derive_unit(node)
        return node

    (results,) = interpret(function, entry=entry, constant=constant, operation=operation)
    any_wrong = any(node.wrong for node in nodes)
    for item, node in zip(declared, results, strict=True):
        expected = _powers(item.unit)
        if any_wrong or (expected is not None and node.unit not in (None, expected)):
            _raise_first_error(item, node, expected)


def _powers(unit: str) -> Powers | None:
    """Powers of base units; None for any unit."""
    return None if unit == units.ANY else units.powers(unit)


@dataclass(eq=False)
class _Node:
    """Node of an expression graph with its unit."""

    number: int  # in the order of evaluation
    code: int  # CasADi's
    operands: Sequence[_Node]
    name: str = ""  # of a symbol
    constant: float | None = None
    unit: Powers | None = None  # None: unknown
    wrong: str = ""  # message about operands whose units cannot be right

    def terms(self) -> Iterator[_Node]:
        """Yield the terms of a sum; any other node itself."""
        if self.code in _SUMS:
            for operand in self.operands:
                yield from operand.terms()
        else:
            yield self

    def subexpressions(self) -> list[_Node]:
        """Node and all nodes below it, in the order of evaluation."""
        seen: set[_Node] = {self}
        waiting: list[_Node] = [self]
        while waiting:
            new = set(waiting.pop().operands) - seen
            seen |= new
            waiting += new
        return sorted(seen, key=lambda node: node.number)

    def text(self) -> str:
        """Expression in the usual notation, cut where it is long."""
        text, _ = self.written(8)
        return text if len(text) <= _READABLE else f"{text[: _READABLE - 4].rstrip()} ..."

    def written(self, depth: int) -> tuple[str, int]:
        """Text of the expression, to a depth of operands, and its precedence as in :data:`_WRITTEN`."""
        if self.name:
            return self.name, 3
        if self.constant is not None:
            return f"{self.constant:g}", 3 if self.constant >= 0 else 0
        if depth == 0:
            return "(...)", 3
        parts = [operand.written(depth - 1) for operand in self.operands]
        if self.code not in _WRITTEN:
            return f"{NAMES[self.code]}({', '.join(text for text, _ in parts)})", 3
        pattern, precedences, precedence = _WRITTEN[self.code]
        texts = (text if own >= least else f"({text})" for (text, own), least in zip(parts, precedences, strict=True))
        return pattern.format(*texts), precedence


def _derive_unit(node: _Node) -> Powers | None:
    """Unit of a node from those of its operands; None if it is unknown.

    Operands that do not fit are noted in ``node.wrong``.
    """
    code, operands = node.code, node.operands
    factors, exponents = [operand.unit for operand in operands], _EXPONENTS.get(code)
    if code in _ALIKE | _COMPARED or code == ca.OP_ATAN2:
        left, right = factors
        if left is not None and right is not None and left != right:
            node.wrong = _unlike_terms_message(node)
        elif code not in _COMPARED:
            return NUMBER if code == ca.OP_ATAN2 else left or right
        return None
    if code in _PURE:
        return _require_pure_number(
            node, operands[0], f"{NAMES[code]}({operands[0].text()}) takes a pure number or an angle"
        )
    if code in (ca.OP_POW, ca.OP_CONSTPOW):
        base, exponent = operands
        if exponent.constant is None:
            message = "under an exponent that is not constant the base must be a pure number"
            pure = _require_pure_number(node, exponent, "an exponent must be a pure number")
            return pure and _require_pure_number(node, base, message)
        factors, exponents = factors[:1], (Fraction(exponent.constant).limit_denominator(1000),)
    if exponents:
        units_known = [(unit, exponent) for unit, exponent in zip(factors, exponents, strict=True) if unit is not None]
        return product(units_known) if len(units_known) == len(factors) else None
    return NUMBER if code == ca.OP_SIGN else factors[_CARRIER[code]] if code in _CARRIER else None


def _require_pure_number(node: _Node, operand: _Node, message: str) -> Powers | None:
    """Unit 1; None, and a note in ``node.wrong``, if the operand has another one."""
    if operand.unit in (None, NUMBER):
        return NUMBER
    node.wrong = f"{message}, but {operand.text()} is {unit_name(operand.unit or NUMBER)}"
    return None


def _raise_first_error(item: Declared, result: _Node, expected: Powers | None) -> None:
    """Raise a ComponentError for the first term of a result that has a wrong unit, or none that is possible."""
    terms = [result] if expected is None else list(result.terms())
    for term in terms:
        if message := next((node.wrong for node in term.subexpressions() if node.wrong), None):
            raise ComponentError(f"{item.label}: {message}")
        if expected is None or term.unit in (None, expected):
            continue
        the_term, missing = "" if len(terms) == 1 else "the term ", product([(expected, 1), (term.unit, -1)])
        raise ComponentError(
            f"{item.label}: {the_term}{term.text()} is {_unit_text(term.unit)} where {item.unit} is expected: "
            f"a factor of {unit_name(missing)} is missing{_constant_hint(term)}"
        )


def _unlike_terms_message(node: _Node) -> str:
    """Message about two terms of a sum that have different units."""
    terms = [term for term in (node.terms() if node.code in _SUMS else node.operands) if term.unit is not None]
    first = terms[0]
    second = next((term for term in terms if term.unit != first.unit), terms[-1])
    one, two = (f"{term.text()} is {_unit_text(term.unit)}" for term in (first, second))
    return f"in {node.text()}, {one} but {two}; they must have one unit{_constant_hint(node)}"


def _constant_hint(node: _Node) -> str:
    """Hint for a message: a number in the expression that may be a quantity; else nothing."""
    constants = [x for part in node.subexpressions() if (x := part.constant)]
    odd = [x for x in constants if not ((2 * x).is_integer() or (1 / x).is_integer())]
    return f"; {odd[0]:g} counts as a pure number, a Parameter has a unit" if odd else ""


def _unit_text(unit: Powers | None) -> str:
    """Unit as messages write it."""
    return "a pure number" if unit == NUMBER else unit_name(unit or NUMBER)


# ---- the rules ---------------------------------------------------------------------------------------------------


_PURE = {
    code
    for code, name in NAMES.items()
    if name.removeprefix("a").removesuffix("h") in ("sin", "cos", "tan")
    or name in ("exp", "log", "log1p", "expm1", "erf", "erfinv")
}
"""Operations on a pure number, or an angle."""

_ALIKE = {ca.OP_ADD, ca.OP_SUB, ca.OP_FMIN, ca.OP_FMAX, ca.OP_FMOD, ca.OP_REMAINDER, ca.OP_HYPOT}
"""Operations on operands of one unit, which the result has, too."""

_COMPARED = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
_CARRIER = dict.fromkeys((ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_COPYSIGN), 0)
_CARRIER[ca.OP_IF_ELSE_ZERO] = 1
"""Index of the operand whose unit is that of the result."""

_EXPONENTS: dict[int, tuple[int | Fraction, ...]] = {
    ca.OP_MUL: (1, 1),
    ca.OP_DIV: (1, -1),
    ca.OP_INV: (-1,),
    ca.OP_SQ: (2,),
    ca.OP_SQRT: (Fraction(1, 2),),
}
"""Exponents of the operands' units in that of the result; unknown for operations without a rule."""

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
