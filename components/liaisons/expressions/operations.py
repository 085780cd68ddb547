"""What CasADi's instructions are in C and in NumPy, and what they work on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, final

import casadi as ca
import numpy as np


@final
@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """What one CasADi instruction is in C, ``"{0} + {1}"``, and in NumPy."""

    c: str
    numpy: Callable[..., Any]


def instructions(function: ca.Function) -> Iterator[tuple[int, list[int], list[int], float]]:
    """Of each instruction of a scalar function its code, where it reads and writes, and the value of a constant."""
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        constant = function.instruction_constant(k) if code == ca.OP_CONST else 0.0
        yield code, function.instruction_input(k), function.instruction_output(k), constant


_NOT_SMOOTH = {
    *(ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO, ca.OP_FABS),
    *(ca.OP_SIGN, ca.OP_COPYSIGN, ca.OP_FMIN, ca.OP_FMAX, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD, ca.OP_REMAINDER),
}


def is_smooth(expression: ca.SX, by: ca.SX) -> bool:
    """Whether no operation with a kink or a jump in its result works on what depends on a symbol."""
    others = [symbol for symbol in ca.symvar(expression) if not ca.is_equal(symbol, by)]
    function = ca.Function("expression", [by, ca.vertcat(*others)], [expression])
    depends = [False] * function.sz_w()
    for code, read, written, _ in instructions(function):
        if code == ca.OP_INPUT:
            depends[written[0]] = read[0] == 0
        elif code != ca.OP_OUTPUT:
            found = code != ca.OP_CONST and any(depends[place] for place in read)
            if found and code in _NOT_SMOOTH:
                return False
            depends[written[0]] = found
    return True


def _call(name: str, function: Callable[..., Any], arguments: int = 1) -> Operation:
    return Operation(f"{name}({', '.join(f'{{{i}}}' for i in range(arguments))})", function)


def _choice(c: str, function: Callable[..., Any]) -> Operation:
    # & and | instead of && and ||: no branch, so that lanes can decide differently
    return Operation(f"({c}) ? 1.0 : 0.0", lambda *arguments: function(*arguments).astype(float))


def _special(name: str) -> Callable[[Any], Any]:
    def call(x: Any) -> Any:
        from scipy import special

        return getattr(special, name)(x)

    return call


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
    ca.OP_SQRT: _call("sqrt", np.sqrt),
    ca.OP_EXP: _call("exp", np.exp),
    ca.OP_EXPM1: _call("expm1", np.expm1),
    ca.OP_LOG: _call("log", np.log),
    ca.OP_LOG1P: _call("log1p", np.log1p),
    ca.OP_SIN: _call("sin", np.sin),
    ca.OP_COS: _call("cos", np.cos),
    ca.OP_TAN: _call("tan", np.tan),
    ca.OP_ASIN: _call("asin", np.arcsin),
    ca.OP_ACOS: _call("acos", np.arccos),
    ca.OP_ATAN: _call("atan", np.arctan),
    ca.OP_SINH: _call("sinh", np.sinh),
    ca.OP_COSH: _call("cosh", np.cosh),
    ca.OP_TANH: _call("tanh", np.tanh),
    ca.OP_ASINH: _call("asinh", np.arcsinh),
    ca.OP_ACOSH: _call("acosh", np.arccosh),
    ca.OP_ATANH: _call("atanh", np.arctanh),
    ca.OP_ERF: _call("erf", _special("erf")),
    ca.OP_FLOOR: _call("floor", np.floor),
    ca.OP_CEIL: _call("ceil", np.ceil),
    ca.OP_FABS: _call("fabs", np.abs),
    ca.OP_SIGN: Operation("{0} < 0.0 ? -1.0 : {0} > 0.0 ? 1.0 : {0}", np.sign),
    ca.OP_POW: _call("pow", np.power, 2),
    ca.OP_CONSTPOW: _call("pow", np.power, 2),
    ca.OP_FMOD: _call("fmod", np.fmod, 2),
    ca.OP_REMAINDER: _call("remainder", lambda x, y: x - y * np.rint(x / y), 2),
    ca.OP_COPYSIGN: _call("copysign", np.copysign, 2),
    ca.OP_ATAN2: _call("atan2", np.arctan2, 2),
    ca.OP_HYPOT: _call("hypot", np.hypot, 2),
    # fmin and fmax written out, for they are not vectorised: of a number and not-a-number they return the number
    ca.OP_FMIN: Operation("({0} < {1}) | ({1} != {1}) ? {0} : {1}", np.fmin),
    ca.OP_FMAX: Operation("({0} > {1}) | ({1} != {1}) ? {0} : {1}", np.fmax),
    ca.OP_LT: _choice("{0} < {1}", np.less),
    ca.OP_LE: _choice("{0} <= {1}", np.less_equal),
    ca.OP_EQ: _choice("{0} == {1}", np.equal),
    ca.OP_NE: _choice("{0} != {1}", np.not_equal),
    ca.OP_NOT: _choice("{0} == 0.0", np.logical_not),
    ca.OP_AND: _choice("({0} != 0.0) & ({1} != 0.0)", np.logical_and),
    ca.OP_OR: _choice("({0} != 0.0) | ({1} != 0.0)", np.logical_or),
    ca.OP_IF_ELSE_ZERO: Operation("{0} != 0.0 ? {1} : 0.0", lambda x, y: np.where(x != 0.0, y, 0.0)),
}
"""By CasADi's instruction number."""


@final
class Instruction(NamedTuple):
    """A number: a constant, an entry of an input, or an operation on numbers before it."""

    operation: Operation | None
    arguments: tuple[int, ...]  # numbers of nodes; of an entry: which input, which entry
    constant: float | None = None

    @classmethod
    def of(cls, code: int, *arguments: int) -> Self:
        """The node of an operation of CasADi's."""
        return cls(OPERATIONS[code], arguments)

    def is_a(self, code: int) -> bool:
        """Whether it is this operation."""
        return self.operation is OPERATIONS[code]

    def renumbered(self, new: Mapping[int, int] | Sequence[int]) -> Instruction:
        """The same on nodes of other numbers."""
        return self if self.operation is None else Instruction(self.operation, tuple([new[x] for x in self.arguments]))
