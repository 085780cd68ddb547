"""Formulas, ``1 + 0.1*sin(5*t)``, as CasADi expressions.

They are parsed by Python's ``ast``, never run; only numbers, the allowed names and functions, and signs are accepted.
"""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from liaisons.base.arguments import shown
from liaisons.errors import FormulaError, LiaisonsError, suggestion

_LONGEST = 1000
"""Largest number of characters of a formula."""
_DEEPEST = 200
"""Deepest nesting of brackets and signs."""

FUNCTIONS: Mapping[str, Callable[..., ca.SX]] = {
    **{name: getattr(ca, name) for name in ("sin", "cos", "tan", "atan2", "exp", "log", "sqrt", "tanh")},
    "abs": ca.fabs,
    "pow": operator.pow,
}
CONSTANTS: Mapping[str, ca.SX] = {"pi": ca.SX(math.pi), "e": ca.SX(math.e)}
_SIGNS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def formula(text: str, names: Mapping[str, ca.SX], functions: Mapping[str, Callable[..., ca.SX]] = FUNCTIONS) -> ca.SX:
    """CasADi expression of a formula.

    :param text: numbers, ``pi``, ``e``, brackets, ``+ - * / **``, the names and the functions.
    :raises FormulaError: for an error in it; with its position, and the nearest name.
    """
    if len(text) > _LONGEST:
        raise FormulaError(f"{shown(text)}: {len(text)} characters, {_LONGEST} at most")
    text = " ".join(text.split())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the parser, on what is refused below
            return _Reader(names, functions).read(ast.parse(text, mode="eval").body, 0)
    except _RefusedError as refused:
        raise _error_at(text, len(text.encode()[: refused.column].decode()), str(refused)) from None
    except SyntaxError as error:
        words = "a number runs into a name; write 5*t, not 5t" if "decimal literal" in error.msg else error.msg
        raise _error_at(text, (error.offset or 1) - 1, words if text else "there is nothing") from None
    except LiaisonsError:  # of the names: a ValueError, too
        raise
    except (ValueError, RecursionError, MemoryError):
        raise FormulaError(f"{shown(text)}: too deep, or characters that do not belong here") from None


class _RefusedError(Exception):
    """A part of a formula is not allowed."""

    def __init__(self, node: ast.expr, words: str) -> None:
        super().__init__(words)
        self.column = node.col_offset


def _error_at(text: str, column: int, words: str) -> FormulaError:
    """Error that names the position in a formula."""
    return FormulaError(f"{shown(text)}, at character {column + 1}: {words}")


@dataclass(frozen=True)
class _Reader:
    """Evaluation of a syntax tree with the allowed names and functions."""

    names: Mapping[str, ca.SX]
    functions: Mapping[str, Callable[..., ca.SX]]

    def read(self, node: ast.expr, depth: int) -> ca.SX:
        """Expression of a node of the tree."""
        if depth > _DEEPEST:
            raise _RefusedError(node, f"more than {_DEEPEST} levels; write it with fewer brackets")
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                try:
                    return ca.SX(float(number))
                except OverflowError:
                    raise _RefusedError(node, "this number is too large") from None
            case ast.Name(id=name):
                return self._symbol(node, name)
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int() as index)):
                return self._symbol(node, f"{name}[{index}]")
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                return _SIGNS[type(sign)](self.read(operand, depth + 1))
            case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _SIGNS:
                return _SIGNS[type(sign)](self.read(left, depth + 1), self.read(right, depth + 1))
            case ast.BinOp(op=ast.BitXor(), right=right):
                raise _RefusedError(right, "powers are written **, not ^")
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._check_call(node, name, len(arguments))
                return self.functions[name](*(self.read(argument, depth + 1) for argument in arguments))
        raise _RefusedError(node, f"only numbers, names, brackets, + - * / ** and {', '.join(self.functions)}")

    def _symbol(self, node: ast.expr, name: str) -> ca.SX:
        """Symbol or constant of a name."""
        if name in self.functions:
            raise _RefusedError(node, f"{name} is a function: write {name}(...)")
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name not in self.names:
            raise _RefusedError(
                node, f"there is no {name!r}{suggestion(name, [*self.names, *CONSTANTS, *self.functions])}"
            )
        return self.names[name]

    def _check_call(self, node: ast.expr, name: str, count: int) -> None:
        """Raise an error for an unknown function, or another count of arguments than it takes."""
        if name not in self.functions:
            raise _RefusedError(node, f"there is no function {name!r}{suggestion(name, self.functions)}")
        expected = 2 if name in ("atan2", "pow") else 1
        if count != expected:
            raise _RefusedError(node, f"{name} takes {expected} argument{'s' * (expected > 1)}, not {count}")
