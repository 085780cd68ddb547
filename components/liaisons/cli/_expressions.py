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
            tree = ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise _unclear(text, (error.offset or 1) - 1, _words(text, error)) from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{_short(text)}: too deep, or characters that do not belong here") from None
    function = _Reader(text).read(tree, 0)

    def evaluate(t: float) -> Jet:
        try:
            return function(Jet(float(t), 1.0))
        except (ArithmeticError, ValueError) as error:
            raise ExpressionError(f"{_short(text)} has no value there: {error}") from None

    return evaluate


class _Reader:
    """Makes functions of the nodes of a tree."""

    def __init__(self, text: str) -> None:
        self._text = text

    def read(self, node: ast.expr, depth: int) -> Callable[[Jet], Jet]:
        if depth > _DEEPEST:
            raise self._refused(node, f"more than {_DEEPEST} levels; write it with fewer brackets")
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return self._number(node, number)
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                inner, factor = self.read(operand, depth + 1), -1.0 if isinstance(sign, ast.USub) else 1.0
                return lambda t: _scaled(inner(t), factor)
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
                apply, first, second = (
                    _OPERATORS[type(operator)],
                    self.read(left, depth + 1),
                    self.read(right, depth + 1),
                )
                return lambda t: apply(first(t), second(t))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(node, name, [self.read(argument, depth + 1) for argument in arguments])
            case ast.BinOp(op=ast.BitXor(), right=right):
                raise self._refused(right, "powers are written **, not ^")
            case _:
                raise self._refused(node, f"only numbers, t, pi, e, brackets, + - * / ** and {', '.join(_NAMES)}")

    def _number(self, node: ast.expr, number: float) -> Callable[[Jet], Jet]:
        try:
            constant = Jet(float(number))
        except OverflowError:
            raise self._refused(node, "this number is too large") from None
        return lambda _: constant

    def _name(self, node: ast.expr, name: str) -> Callable[[Jet], Jet]:
        if name == "t":
            return lambda t: t
        if name not in _CONSTANTS:
            if name in _NAMES:
                raise self._refused(node, f"{name} is a function: write {name}(...)")
            raise self._refused(node, f"there is no {name!r}{suggestion(name, [*_CONSTANTS, *_NAMES, 't'])}")
        constant = Jet(_CONSTANTS[name])
        return lambda _: constant

    def _call(self, node: ast.expr, name: str, inner: list[Callable[[Jet], Jet]]) -> Callable[[Jet], Jet]:
        if name not in _NAMES:
            raise self._refused(node, f"there is no function {name!r}{suggestion(name, _NAMES)}")
        expected = 2 if name == "pow" else 1
        if len(inner) != expected:
            raise self._refused(node, f"{name} takes {expected} argument{'s' * (expected > 1)}, not {len(inner)}")
        if name == "pow":
            base, exponent = inner
            return lambda t: _power(base(t), exponent(t))
        (argument,) = inner
        if name == "abs":
            return lambda t: _magnitude(argument(t))
        rule = FUNCTIONS[name]
        return lambda t: _composed(rule, argument(t))

    def _refused(self, node: ast.expr, words: str) -> ExpressionError:
        before = self._text.encode()[: node.col_offset].decode()
        return _unclear(self._text, len(before), words)


def _unclear(text: str, place: int, words: str) -> ExpressionError:
    return ExpressionError(f"{_short(text)}, at character {place + 1}: {words}")


def _short(text: str) -> str:
    return repr(text if len(text) <= 80 else f"{text[:77]}...")


def _words(text: str, error: SyntaxError) -> str:
    if not text:
        return "there is nothing"
    if "decimal literal" in str(error.msg):
        return "a number runs into a name; write 5*t, not 5t"
    return str(error.msg)


def _scaled(a: Jet, factor: float) -> Jet:
    return Jet(factor * a.value, factor * a.rate, factor * a.acceleration)


def _sum(a: Jet, b: Jet) -> Jet:
    return Jet(a.value + b.value, a.rate + b.rate, a.acceleration + b.acceleration)


def _difference(a: Jet, b: Jet) -> Jet:
    return Jet(a.value - b.value, a.rate - b.rate, a.acceleration - b.acceleration)


def _product(a: Jet, b: Jet) -> Jet:
    return Jet(
        a.value * b.value,
        a.rate * b.value + a.value * b.rate,
        a.acceleration * b.value + 2 * a.rate * b.rate + a.value * b.acceleration,
    )


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
    sign = next((math.copysign(1.0, number) for number in a if number != 0), 0.0)
    return _scaled(a, sign)


def _composed(rule: _Rule, a: Jet) -> Jet:
    value, first, second = rule(a.value)
    return Jet(value, first * a.rate, second * a.rate**2 + first * a.acceleration)


def _tangent(x: float) -> tuple[float, float, float]:
    y = math.tan(x)
    return y, 1 + y * y, 2 * y * (1 + y * y)


def _hyperbolic_tangent(x: float) -> tuple[float, float, float]:
    y = math.tanh(x)
    return y, 1 - y * y, -2 * y * (1 - y * y)


FUNCTIONS: dict[str, _Rule] = {
    "sin": lambda x: (math.sin(x), math.cos(x), -math.sin(x)),
    "cos": lambda x: (math.cos(x), -math.sin(x), -math.cos(x)),
    "tan": _tangent,
    "exp": lambda x: (math.exp(x), math.exp(x), math.exp(x)),
    "log": lambda x: (math.log(x), 1 / x, -1 / x**2),
    "sqrt": lambda x: _monomial(x, 0.5),
    "tanh": _hyperbolic_tangent,
}
_NAMES = [*FUNCTIONS, "abs", "pow"]
_CONSTANTS = {"pi": math.pi, "e": math.e}
_OPERATORS: dict[type[ast.operator], Callable[[Jet, Jet], Jet]] = {
    ast.Add: _sum,
    ast.Sub: _difference,
    ast.Mult: _product,
    ast.Div: _quotient,
    ast.Pow: _power,
}
