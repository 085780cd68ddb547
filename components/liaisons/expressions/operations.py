"""CasADi's scalar instructions: their interpretation, and their counterparts in C and NumPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, TypeVar, final

import casadi as ca
import numpy as np

T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """One of CasADi's operations in C, ``"{0} + {1}"``, and in NumPy."""

    c: str
    numpy: Callable[..., Any]


def interpret(
    function: ca.Function,
    *,
    entry: Callable[[int, int], T],
    constant: Callable[[float], T],
    operation: Callable[[int, list[T]], T],
) -> list[list[T]]:
    """Return the outputs of a scalar function, evaluated instruction by instruction with values of any type.

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
            work[targets[0]] = operation(code, [work[source] for source in sources])
    return [[values[i] for i in sorted(values)] for values in outputs]


def operation_codes(function: ca.Function) -> set[int]:
    """Return CasADi's codes of a function's instructions."""
    return {function.instruction_id(k) for k in range(function.n_instructions())}


NAMES = {code: name[3:].lower().removesuffix("_zero") for name, code in vars(ca).items() if name.startswith("OP_")}
"""CasADi's names of its operations, by code."""

_NOT_SMOOTH = {
    *(ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO, ca.OP_FABS),
    *(ca.OP_SIGN, ca.OP_COPYSIGN, ca.OP_FMIN, ca.OP_FMAX, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD, ca.OP_REMAINDER),
}


def is_smooth(expression: ca.SX, by: ca.SX) -> bool:
    """Return whether no operand that depends on a symbol enters an operation with a kink or a jump."""
    parameters = [symbol for symbol in ca.symvar(expression) if not ca.is_equal(symbol, by)]
    function = ca.Function("expression", [by, ca.vertcat(*parameters)], [expression])
    kinks: set[int] = set()

    def depends(code: int, operands: list[bool]) -> bool:
        if any(operands):
            kinks.update({code} & _NOT_SMOOTH)
        return any(operands)

    interpret(function, entry=lambda i, _: i == 0, constant=lambda _: False, operation=depends)
    return not kinks


def _call_of(name: str, function: Callable[..., Any], arguments: int = 1) -> Operation:
    """Return the operation that calls a function of math.h."""
    return Operation(f"{name}({', '.join(f'{{{i}}}' for i in range(arguments))})", function)


def _truth_value(c: str, function: Callable[..., Any]) -> Operation:
    # & and | instead of && and ||: no branch, so that lanes can decide differently
    """Return the operation that is 1 where a condition of C holds, and else 0."""
    return Operation(f"({c}) ? 1.0 : 0.0", lambda *arguments: function(*arguments).astype(float))


def _erf(x: Any) -> Any:
    from scipy.special import erf

    return erf(x)


OPERATIONS: dict[int, Operation] = {
    ca.OP_ASSIGN: Operation("{0}", lambda x: x),
    ca.OP_ADD: Operation("{0} + {1}", np.add),
    ca.OP_SUB: Operation("{0} - {1}", np.subtract),
    ca.OP_MUL: Operation("{0} * {1}", np.multiply),
    ca.OP_DIV: Operation("{0} / {1}", np.divide),
    ca.OP_NEG: Operation("-{0}", np.negative),
    ca.OP_SQ: Operation("{0} * {0}", np.square),
    ca.OP_TWICE: Operation("{0} + {0}", lambda x: x + x),
    ca.OP_INV: Operation("1.0 / {0}", lambda x: 1.0 / x),
    ca.OP_SQRT: _call_of("sqrt", np.sqrt),
    ca.OP_EXP: _call_of("exp", np.exp),
    ca.OP_EXPM1: _call_of("expm1", np.expm1),
    ca.OP_LOG: _call_of("log", np.log),
    ca.OP_LOG1P: _call_of("log1p", np.log1p),
    ca.OP_SIN: _call_of("sin", np.sin),
    ca.OP_COS: _call_of("cos", np.cos),
    ca.OP_TAN: _call_of("tan", np.tan),
    ca.OP_ASIN: _call_of("asin", np.arcsin),
    ca.OP_ACOS: _call_of("acos", np.arccos),
    ca.OP_ATAN: _call_of("atan", np.arctan),
    ca.OP_SINH: _call_of("sinh", np.sinh),
    ca.OP_COSH: _call_of("cosh", np.cosh),
    ca.OP_TANH: _call_of("tanh", np.tanh),
    ca.OP_ASINH: _call_of("asinh", np.arcsinh),
    ca.OP_ACOSH: _call_of("acosh", np.arccosh),
    ca.OP_ATANH: _call_of("atanh", np.arctanh),
    ca.OP_ERF: _call_of("erf", _erf),
    ca.OP_FLOOR: _call_of("floor", np.floor),
    ca.OP_CEIL: _call_of("ceil", np.ceil),
    ca.OP_FABS: _call_of("fabs", np.abs),
    ca.OP_SIGN: Operation("{0} < 0.0 ? -1.0 : {0} > 0.0 ? 1.0 : {0}", np.sign),
    ca.OP_POW: _call_of("pow", np.power, 2),
    ca.OP_CONSTPOW: _call_of("pow", np.power, 2),
    ca.OP_FMOD: _call_of("fmod", np.fmod, 2),
    ca.OP_REMAINDER: _call_of("remainder", lambda x, y: x - y * np.rint(x / y), 2),
    ca.OP_COPYSIGN: _call_of("copysign", np.copysign, 2),
    ca.OP_ATAN2: _call_of("atan2", np.arctan2, 2),
    ca.OP_HYPOT: _call_of("hypot", np.hypot, 2),
    # fmin and fmax written out, for they are not vectorised: of a number and not-a-number they return the number
    ca.OP_FMIN: Operation("({0} < {1}) | ({1} != {1}) ? {0} : {1}", np.fmin),
    ca.OP_FMAX: Operation("({0} > {1}) | ({1} != {1}) ? {0} : {1}", np.fmax),
    ca.OP_LT: _truth_value("{0} < {1}", np.less),
    ca.OP_LE: _truth_value("{0} <= {1}", np.less_equal),
    ca.OP_EQ: _truth_value("{0} == {1}", np.equal),
    ca.OP_NE: _truth_value("{0} != {1}", np.not_equal),
    ca.OP_NOT: _truth_value("{0} == 0.0", np.logical_not),
    ca.OP_AND: _truth_value("({0} != 0.0) & ({1} != 0.0)", np.logical_and),
    ca.OP_OR: _truth_value("({0} != 0.0) | ({1} != 0.0)", np.logical_or),
    ca.OP_IF_ELSE_ZERO: Operation("{0} != 0.0 ? {1} : 0.0", lambda x, y: np.where(x != 0.0, y, 0.0)),
}
"""By CasADi's instruction number."""


@final
class Instruction(NamedTuple):
    """Node of a program: a constant, an entry of an input, or an operation on earlier nodes."""

    operation: Operation | None
    arguments: tuple[int, ...]  # numbers of nodes; of an entry: which input, which entry
    constant: float | None = None

    @classmethod
    def of(cls, code: int, *arguments: int) -> Self:
        """Return the instruction that performs CasADi's operation of a code."""
        return cls(OPERATIONS[code], arguments)

    def is_a(self, code: int) -> bool:
        """Return whether it performs CasADi's operation of a code."""
        return self.operation is OPERATIONS[code]

    def renumbered(self, new: Mapping[int, int] | Sequence[int]) -> Instruction:
        """Return the same operation on renumbered nodes."""
        return self if self.operation is None else Instruction(self.operation, tuple([new[x] for x in self.arguments]))
