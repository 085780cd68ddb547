"""CasADi's scalar instructions: their interpretation, and their counterparts in C and NumPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, final

import casadi as ca
import numpy as np

T = TypeVar("T")
X = TypeVar("X", ca.SX, ca.MX)


def interpret(
    function: ca.Function,
    *,
    entry: Callable[[int, int], T],
    constant: Callable[[float], T],
    operation: Callable[[int, list[T]], T],
) -> list[list[T]]:
    """Evaluate a scalar function instruction by instruction, with values of any type; return its outputs.

    :param entry: value of an entry of an input, by the indices of both.
    :param constant: value of a number.
    :param operation: value of an operation, by CasADi's code and its operands.
    :returns: for each output its nonzero entries.
    """
    work: dict[int, T] = {}
    outputs: list[dict[int, T]] = [{} for _ in range(function.n_out())]
    for k in range(function.n_instructions()):
        code, sources, targets = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if code == ca.OP_OUTPUT:
            outputs[targets[0]][targets[1]] = work[sources[0]]
        elif code == ca.OP_INPUT:
            work[targets[0]] = entry(*sources)
        elif code == ca.OP_CONST:
            work[targets[0]] = constant(function.instruction_constant(k))
        else:
            result = operation(code, [work[source] for source in sources])
            work.update(dict.fromkeys(targets, result))  # several of a call
    return [[values[i] for i in sorted(values)] for values in outputs]


def operation_codes(function: ca.Function) -> set[int]:
    """CasADi's codes of a function's instructions."""
    return {function.instruction_id(k) for k in range(function.n_instructions())}


NAMES = {code: name[3:].lower().removesuffix("_zero") for name, code in vars(ca).items() if name.startswith("OP_")}
"""CasADi's names of its operations, by code."""

NOT_SMOOTH = {
    *(ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO, ca.OP_FABS),
    *(ca.OP_SIGN, ca.OP_COPYSIGN, ca.OP_FMIN, ca.OP_FMAX, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD, ca.OP_REMAINDER),
}
"""Codes of operations with a kink or a jump."""


def is_smooth_function(function: ca.Function) -> bool:
    """Whether no operation of a scalar function has a kink or a jump."""
    return not operation_codes(function) & NOT_SMOOTH


def is_smooth(expression: ca.SX, by: ca.SX) -> bool:
    """Whether an expression is smooth in a symbol: no operand with it has a kink or a jump."""
    parameters = [symbol for symbol in ca.symvar(expression) if not ca.is_equal(symbol, by)]
    function = ca.Function("expression", [by, ca.vertcat(*parameters)], [expression])
    kinks: set[int] = set()

    def depends(code: int, operands: list[bool]) -> bool:
        if any(operands):
            kinks.update({code} & NOT_SMOOTH)
        return any(operands)

    interpret(function, entry=lambda i, _: i == 0, constant=lambda _: False, operation=depends)
    return not kinks


def perform(code: int, operands: Sequence[X]) -> X:
    """Result of the operation with a code of CasADi on one or two expressions."""
    first, *second = operands
    return type(first).binary(code, first, second[0]) if second else type(first).unary(code, first)


OPERATIONS: dict[int, str] = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SIGN: "{0} < 0.0 ? -1.0 : {0} > 0.0 ? 1.0 : {0}",
    ca.OP_CONSTPOW: "pow({0}, {1})",
    # fmin and fmax written out, for they are not vectorised: of a number and not-a-number they return the number
    ca.OP_FMIN: "(({0} < {1}) | ({1} != {1})) ? {0} : {1}",
    ca.OP_FMAX: "(({0} > {1}) | ({1} != {1})) ? {0} : {1}",
    # & and | instead of && and ||: no branch, so that lanes can decide differently
    ca.OP_LT: "({0} < {1}) ? 1.0 : 0.0",
    ca.OP_LE: "({0} <= {1}) ? 1.0 : 0.0",
    ca.OP_EQ: "({0} == {1}) ? 1.0 : 0.0",
    ca.OP_NE: "({0} != {1}) ? 1.0 : 0.0",
    ca.OP_NOT: "({0} == 0.0) ? 1.0 : 0.0",
    ca.OP_AND: "(({0} != 0.0) & ({1} != 0.0)) ? 1.0 : 0.0",
    ca.OP_OR: "(({0} != 0.0) | ({1} != 0.0)) ? 1.0 : 0.0",
    ca.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}
"""Operations in C by CasADi's code."""

_MATH = {
    "{0}": "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh erf floor ceil fabs",
    "{0}, {1}": "pow fmod remainder copysign atan2 hypot",
}
"""Functions of math.h by their arguments; CasADi has them by the same names."""
OPERATIONS |= {
    getattr(ca, f"OP_{name.upper()}"): f"{name}({arguments})"
    for arguments, names in _MATH.items()
    for name in names.split()
}

_SAME_NAMES = "sqrt exp expm1 log log1p sin cos tan sinh cosh tanh floor ceil sign fmod copysign hypot fmin fmax"
_OTHER_NAMES = (
    "ADD=add SUB=subtract MUL=multiply DIV=divide NEG=negative SQ=square POW=power CONSTPOW=power FABS=abs ASIN=arcsin "
    "ACOS=arccos ATAN=arctan ATAN2=arctan2 ASINH=arcsinh ACOSH=arccosh ATANH=arctanh LT=less LE=less_equal EQ=equal "
    "NE=not_equal NOT=logical_not AND=logical_and OR=logical_or"
)


def _erf(x: Any) -> Any:
    from scipy.special import erf

    return erf(x)


NUMPY: dict[int, Callable[..., Any]] = {
    **{getattr(ca, f"OP_{name.upper()}"): getattr(np, name) for name in _SAME_NAMES.split()},
    **{
        getattr(ca, f"OP_{name}"): getattr(np, function)
        for name, function in (pair.split("=") for pair in _OTHER_NAMES.split())
    },
    ca.OP_ASSIGN: lambda x: x,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_INV: lambda x: 1.0 / x,
    ca.OP_ERF: _erf,
    ca.OP_REMAINDER: lambda x, y: x - y * np.rint(x / y),
    ca.OP_IF_ELSE_ZERO: lambda condition, x: np.where(condition != 0, x, 0.0),
}
"""Operations in NumPy by CasADi's code; of conditions Booleans."""


@final
class Instruction(NamedTuple):
    """Node of a program: a constant, an entry of an input, or an operation on earlier nodes."""

    operation: int | None  # its code in CasADi
    arguments: tuple[int, ...]  # numbers of nodes; of an entry: which input, which entry
    constant: float | None = None

    def renumbered(self, new: Mapping[int, int] | Sequence[int]) -> Instruction:
        """Instruction with new numbers of its arguments."""
        return self if self.operation is None else Instruction(self.operation, tuple([new[x] for x in self.arguments]))
