"""Expressions of time, ``1 + 0.1*sin(5*t)``, with their exact first and second derivatives.

They are parsed, never run: Python's own parser makes a tree of them, and what is no number, name, sign or function of
the tables below is refused.  Values go through the tree together with their derivatives (Taylor arithmetic of second
order: Griewank and Walther, Evaluating Derivatives, ch. 13).
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from liaisons.errors import LiaisonsError, suggestion

_LONGEST, _DEEPEST = 1000, 200
"""Characters, and levels of brackets and signs."""


class ExpressionError(LiaisonsError):
    """An expression cannot be understood, or has no value at some time."""


class Jet(NamedTuple):
    """A function of time at one instant: value, rate, acceleration."""

    value: float
    rate: float = 0.0
    acceleration: float = 0.0


Expression = Callable[[float], Jet]
"""A function of time [s]."""

_Rule = Callable[[float], tuple[float, float, float]]
"""A function's value and its first and second derivative."""


def expression(text: str) -> Expression:
    """A function of time from its text.

    :param text: numbers, ``t`` [s], ``pi``, ``e``, brackets, ``+ - * / **`` and the functions of :data:`FUNCTIONS`.
    :raises ExpressionError: if it is none; names the place, and the nearest name.
    """
    if len(text) > _LONGEST:
        raise ExpressionError(f"{_short(text)}: {len(text)} characters, {_LONGEST} at most; use a table of values")
    text = " ".join(text.split())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the parser, on what is refused below
            function = _read(ast.parse(text, mode="eval").body, 0)
    except _RefusedError as refused:
        raise _unclear(text, len(text.encode()[: refused.place].decode()), str(refused)) from None
    except SyntaxError as error:
        words = "a number runs into a name; write 5*t, not 5t" if "decimal literal" in error.msg else error.msg
        raise _unclear(text, (error.offset or 1) - 1, words if text else "there is nothing") from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{_short(text)}: too deep, or characters that do not belong here") from None

    def evaluate(t: float) -> Jet:
        try:
            return function(Jet(float(t), 1.0))
        except (ArithmeticError, ValueError) as error:
            raise ExpressionError(f"{_short(text)} has no value there: {error}") from None

    return evaluate


class _RefusedError(Exception):
    """A part of an expression that will not do."""

    def __init__(self, node: ast.expr, words: str) -> None:
        super().__init__(words)
        self.place = node.col_offset


def _unclear(text: str, place: int, words: str) -> ExpressionError:
    return ExpressionError(f"{_short(text)}, at character {place + 1}: {words}")


def _short(text: str) -> str:
    return repr(text if len(text) <= 80 else f"{text[:77]}...")


def _read(node: ast.expr, depth: int) -> Callable[[Jet], Jet]:
    """The function of a node of the tree, of those below it."""
    if depth > _DEEPEST:
        raise _RefusedError(node, f"more than {_DEEPEST} levels; write it with fewer brackets")
    match node:
        case ast.Name(id="t"):
            return lambda t: t
        case ast.Constant() | ast.Name():
            constant = _constant(node)
            return lambda _: constant
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            inner, factor = _read(operand, depth + 1), -1.0 if isinstance(sign, ast.USub) else 1.0
            return lambda t: _scaled(inner(t), factor)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            apply, one, other = _OPERATORS[type(operator)], _read(left, depth + 1), _read(right, depth + 1)
            return lambda t: apply(one(t), other(t))
        case ast.BinOp(op=ast.BitXor(), right=right):
            raise _RefusedError(right, "powers are written **, not ^")
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            of, parts = _function(node, name, len(arguments)), [_read(argument, depth + 1) for argument in arguments]
            return lambda t: of(*(part(t) for part in parts))
    raise _RefusedError(node, _ALLOWED)


def _constant(node: ast.Constant | ast.Name) -> Jet:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            try:
                return Jet(float(number))
            except OverflowError:
                raise _RefusedError(node, "this number is too large") from None
        case ast.Name(id=name) if name in _CONSTANTS:
            return Jet(_CONSTANTS[name])
        case ast.Name(id=name) if name in _OF_JETS:
            raise _RefusedError(node, f"{name} is a function: write {name}(...)")
        case ast.Name(id=name):
            raise _RefusedError(node, f"there is no {name!r}{suggestion(name, [*_CONSTANTS, *_OF_JETS, 't'])}")
    raise _RefusedError(node, _ALLOWED)


def _function(node: ast.Call, name: str, given: int) -> Callable[..., Jet]:
    if name not in _OF_JETS:
        raise _RefusedError(node, f"there is no function {name!r}{suggestion(name, _OF_JETS)}")
    expected = 2 if name == "pow" else 1
    if given != expected:
        raise _RefusedError(node, f"{name} takes {expected} argument{'s' * (expected > 1)}, not {given}")
    return _OF_JETS[name]


def _scaled(a: Jet, factor: float) -> Jet:
    return Jet(factor * a.value, factor * a.rate, factor * a.acceleration)


def _sum(a: Jet, b: Jet) -> Jet:
    return Jet(a.value + b.value, a.rate + b.rate, a.acceleration + b.acceleration)


def _product(a: Jet, b: Jet) -> Jet:
    bends = a.acceleration * b.value + 2 * a.rate * b.rate + a.value * b.acceleration
    return Jet(a.value * b.value, a.rate * b.value + a.value * b.rate, bends)


def _quotient(a: Jet, b: Jet) -> Jet:
    value = a.value / b.value
    rate = (a.rate - value * b.rate) / b.value
    return Jet(value, rate, (a.acceleration - 2 * rate * b.rate - value * b.acceleration) / b.value)


def _power(a: Jet, b: Jet) -> Jet:
    if b.rate == b.acceleration == 0:
        return _composed(lambda x: _monomial(x, b.value), a)
    return _composed(FUNCTIONS["exp"], _product(b, _composed(FUNCTIONS["log"], a)))


def _monomial(x: float, n: float) -> tuple[float, float, float]:
    """x to a constant power; the derivatives of a root at 0 are infinite, which matters where they are asked for."""
    factors = 1.0, n, n * (n - 1)
    value, first, second = (
        factor and (factor * math.pow(x, n - order) if x or n >= order else math.inf)
        for order, factor in enumerate(factors)
    )
    return value, first, second


def _magnitude(a: Jet) -> Jet:
    """On the side where time goes: at a zero, its sign is that which it is about to have."""
    return _scaled(a, next((math.copysign(1.0, number) for number in a if number != 0), 0.0))


def _composed(rule: _Rule, a: Jet) -> Jet:
    value, first, second = rule(a.value)
    return Jet(value, first * a.rate, second * a.rate**2 + first * a.acceleration)


FUNCTIONS: dict[str, _Rule] = {
    "sin": lambda x: (math.sin(x), math.cos(x), -math.sin(x)),
    "cos": lambda x: (math.cos(x), -math.sin(x), -math.cos(x)),
    "tan": lambda x: (y := math.tan(x), 1 + y * y, 2 * y * (1 + y * y)),
    "exp": lambda x: (math.exp(x), math.exp(x), math.exp(x)),
    "log": lambda x: (math.log(x), 1 / x, -1 / x**2),
    "sqrt": lambda x: _monomial(x, 0.5),
    "tanh": lambda x: (y := math.tanh(x), 1 - y * y, -2 * y * (1 - y * y)),
}
_OF_JETS: dict[str, Callable[..., Jet]] = {
    **{name: partial(_composed, rule) for name, rule in FUNCTIONS.items()},
    "abs": _magnitude,
    "pow": _power,
}
_CONSTANTS = {"pi": math.pi, "e": math.e}
_ALLOWED = f"only numbers, t, pi, e, brackets, + - * / ** and {', '.join(_OF_JETS)}"
_OPERATORS: dict[type[ast.operator], Callable[[Jet, Jet], Jet]] = {
    ast.Add: _sum,
    ast.Sub: lambda a, b: _sum(a, _scaled(b, -1.0)),
    ast.Mult: _product,
    ast.Div: _quotient,
    ast.Pow: _power,
}
