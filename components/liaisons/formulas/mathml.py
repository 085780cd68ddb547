"""Formulas in MathML Core."""

from __future__ import annotations

import re
from itertools import pairwise

from liaisons.formulas.notation import Notation
from liaisons.formulas.terms import (
    Addition,
    Application,
    Name,
    Negative,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Term,
    summands,
)

_PLUS, _MINUS = "<mo>+</mo>", "<mo>−</mo>"
_TIMES, _APPLY, _SPACE = "<mo>&#x2062;</mo>", "<mo>&#x2061;</mo>", '<mspace width="0.2em"></mspace>'
_RELATIONS = {"lt": "&lt;", "le": "≤", "eq": "=", "ne": "≠"}
_AROUND = {"abs": "||", **dict.fromkeys(_RELATIONS, "[]")}
_SPELLED = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln"}
_TAG = re.compile(r"<[^>]+>|&#x206[12];")
# A word, which is a name of several letters, at the end of a factor or at its beginning.
_WORD_LAST = re.compile(r"<mi>\w\w+</mi>(?:</\w+>|<mo>[˙¨]</mo>)*$")
_WORD_FIRST = re.compile(r"(?:<\w+[^>]*>)*<mi>\w\w+</mi>")


def terms(term: Term, notation: Notation) -> tuple[str, ...]:
    """Each term of a sum with its sign, so that a line may break before it."""
    return tuple(
        _MINUS + _factor(t.term, notation, Addition)
        if isinstance(t, Negative)
        else (_PLUS if i else "") + _row(t, notation)
        for i, t in enumerate(summands(term))
    )


def width(term: Term, notation: Notation) -> int:
    """Count of characters."""
    return len(_TAG.sub("", _row(term, notation)))


def _row(term: Term, notation: Notation) -> str:  # noqa: PLR0911 - one for each kind
    match term:
        case Number(value):
            return _number(value)
        case Name(name):
            return notation[name]
        case Addition() | Negative():
            return "".join(terms(term, notation))
        case Product(factors):
            return _joined([_factor(factor, notation, Addition, Product) for factor in factors])
        case Quotient(above, below):
            return f"<mfrac><mrow>{_row(above, notation)}</mrow><mrow>{_row(below, notation)}</mrow></mfrac>"
        case Root(inside):
            return f"<msqrt>{_row(inside, notation)}</msqrt>"
        case Power(base, exponent):
            return _power(base, exponent, notation)
        case Application(function, arguments):
            return _application(function, arguments, notation)


def _factor(term: Term, notation: Notation, *bracketed: type[Term]) -> str:
    """A term, in brackets if it is of these kinds."""
    row = _row(term, notation)
    return _bracketed(row) if isinstance(term, bracketed) else row


def _bracketed(row: str) -> str:
    return f"<mrow><mo>(</mo>{row}<mo>)</mo></mrow>"


def _power(base: Term, exponent: Term, notation: Notation) -> str:
    above = _row(exponent, notation)
    if not isinstance(exponent, Number | Quotient):
        above = f"<mrow>{above}</mrow>"
    if isinstance(base, Application) and base.function in ("sin", "cos") and exponent == Number(2):
        return _called(f"<msup><mi>{base.function}</mi>{above}</msup>", base.arguments, notation)
    below = _row(base, notation)
    return f"<msup>{below if isinstance(base, Name) else _bracketed(below)}{above}</msup>"


def _application(function: str, arguments: tuple[Term, ...], notation: Notation) -> str:
    around = _AROUND.get(function)
    if around is None:
        return _called(f"<mi>{_SPELLED.get(function, function)}</mi>", arguments, notation)
    between = f"<mo>{_RELATIONS.get(function, ',')}</mo>"
    inner = between.join(_row(argument, notation) for argument in arguments)
    return f"<mrow><mo>{around[0]}</mo>{inner}<mo>{around[1]}</mo></mrow>"


def _called(function: str, arguments: tuple[Term, ...], notation: Notation) -> str:
    inner = "<mo>,</mo>".join(_row(argument, notation) for argument in arguments)
    is_name = len(arguments) == 1 and isinstance(arguments[0], Name)
    return f"<mrow>{function}{_APPLY}{_SPACE + inner if is_name else _bracketed(inner)}</mrow>"


def _joined(factors: list[str]) -> str:
    """A product: nothing between the factors, a space beside words."""
    text = factors[0]
    for before, after in pairwise(factors):
        text += _TIMES + (_SPACE if _WORD_LAST.search(before) or _WORD_FIRST.match(after) else "") + after
    return text


def _number(value: float) -> str:
    if isinstance(value, int):
        return f"<mn>{value}</mn>"
    mantissa, _, exponent = f"{float(value)!r}".partition("e")
    if not exponent:
        return f"<mn>{mantissa}</mn>"
    return f"<mn>{mantissa}</mn><mo>·</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
