"""Expressions of time, ``1 + 0.1*sin(5*t)``, with their exact first and second derivatives.

They are parsed, never run: Python's own parser makes a tree of them, what is no number, name, sign or function of the
tables below is refused, and the rest becomes a function of CasADi, which differentiates it.
"""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable
from typing import Any, cast

import casadi as ca
import numpy as np

from liaisons.errors import LiaisonsError, suggestion

_LONGEST, _DEEPEST = 1000, 200
"""Characters, and levels of brackets and signs."""


class ExpressionError(LiaisonsError):
    """An expression cannot be understood, or has no value at some time."""


Expression = Callable[[float], tuple[float, float, float]]
"""A function of time [s]: value, rate, acceleration."""


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
            value = _read(ast.parse(text, mode="eval").body, 0)
    except _RefusedError as refused:
        raise _unclear(text, len(text.encode()[: refused.place].decode()), str(refused)) from None
    except SyntaxError as error:
        words = "a number runs into a name; write 5*t, not 5t" if "decimal literal" in error.msg else error.msg
        raise _unclear(text, (error.offset or 1) - 1, words if text else "there is nothing") from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{_short(text)}: too deep, or characters that do not belong here") from None
    rate = _rate(value)
    function = ca.Function("input", [_T], [ca.densify(ca.vertcat(value, rate, _rate(rate)))])
    buffer, run = cast("Any", function.buffer())  # called in place, at a twentieth of the cost
    time: Any = np.zeros(1)
    found: Any = np.zeros(3)
    buffer.set_arg(0, memoryview(time))
    buffer.set_res(0, memoryview(found))

    def evaluate(t: float) -> tuple[float, float, float]:
        time[0] = t
        run()
        value, rate, acceleration = found.tolist()
        if buffer.ret() or not math.isfinite(value):
            raise ExpressionError(f"{_short(text)} has no value there: {value}")
        return value, rate, acceleration

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


def _read(node: ast.expr, depth: int) -> ca.SX:
    """What a node of the tree stands for."""
    if depth > _DEEPEST:
        raise _RefusedError(node, f"more than {_DEEPEST} levels; write it with fewer brackets")
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            try:
                return ca.SX(float(number))
            except OverflowError:
                raise _RefusedError(node, "this number is too large") from None
        case ast.Name(id=name):
            return _named(node, name)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            return _SIGNS[type(sign)](_read(operand, depth + 1))
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _SIGNS:
            return _SIGNS[type(sign)](_read(left, depth + 1), _read(right, depth + 1))
        case ast.BinOp(op=ast.BitXor(), right=right):
            raise _RefusedError(right, "powers are written **, not ^")
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _function(node, name, len(arguments))(*(_read(argument, depth + 1) for argument in arguments))
    raise _RefusedError(node, f"only numbers, t, pi, e, brackets, + - * / ** and {', '.join(FUNCTIONS)}")


def _named(node: ast.expr, name: str) -> ca.SX:
    if name in FUNCTIONS:
        raise _RefusedError(node, f"{name} is a function: write {name}(...)")
    if name not in _NAMES:
        raise _RefusedError(node, f"there is no {name!r}{suggestion(name, [*_NAMES, *FUNCTIONS])}")
    return _NAMES[name]


def _function(node: ast.expr, name: str, given: int) -> Callable[..., ca.SX]:
    if name not in FUNCTIONS:
        raise _RefusedError(node, f"there is no function {name!r}{suggestion(name, FUNCTIONS)}")
    expected = 2 if name == "pow" else 1
    if given != expected:
        raise _RefusedError(node, f"{name} takes {expected} argument{'s' * (expected > 1)}, not {given}")
    return FUNCTIONS[name]


def _rate(value: ca.SX) -> ca.SX:
    return ca.jacobian(value, _T)


def _magnitude(value: ca.SX) -> ca.SX:
    """On the side where time goes: at a zero, its sign is that which it is about to have."""
    rate = _rate(value)
    turn = ca.sign(rate) + (rate == 0) * ca.sign(_rate(rate))
    return (ca.sign(value) + (value == 0) * turn) * value


_T = ca.SX.sym("t")
_NAMES = {"t": _T, "pi": ca.SX(math.pi), "e": ca.SX(math.e)}
_SIGNS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
FUNCTIONS: dict[str, Callable[..., ca.SX]] = {
    **{name: getattr(ca, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh")},
    "abs": _magnitude,
    "pow": operator.pow,
}
