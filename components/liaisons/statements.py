r"""Straight-line code: scalar CasADi expressions as one list of operations, printed as C or performed by NumPy.

One statement an operation and one temporary a statement, so that the body of a loop over lanes (members of an ensemble,
links of a chain) is free of calls that a compiler cannot vectorise::

    >>> x, k = ca.SX.sym("x", 2), ca.SX.sym("k")
    >>> print("\n".join(c_statements([(x, "x[{}][i]"), (k, "k[i]")], [(-k * ca.sin(x[0]) / x[1], "f[i]")])))
    const double a0 = k[i];
    const double a1 = x[0][i];
    const double a2 = x[1][i];
    const double a3 = sin(a1);
    const double a4 = a0 * a3;
    const double a5 = a4 / a2;
    const double a6 = -a5;
    f[i] = a6;

What occurs twice is calculated once.  All inputs are read before the first output is written: the two may be one array.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.errors import ComponentError

_LARGEST_POWER = 16  # integer powers up to here are products; more would cost accuracy


@final
@dataclass(frozen=True, slots=True)
class Operation:
    """What one CasADi instruction is in C, ``"{0} + {1}"``, and in NumPy."""

    c: str
    numpy: Callable[..., Any]


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
@dataclass(frozen=True, slots=True)
class Node:
    """A number: a constant, an entry of an input, or an operation on numbers before it."""

    operation: Operation | None
    arguments: tuple[int, ...]  # numbers of nodes; of an entry: which input, which entry
    constant: float | None = None

    def is_a(self, code: int) -> bool:
        """Whether it is this operation."""
        return self.operation is OPERATIONS[code]


@final
@dataclass(frozen=True, slots=True)
class Program:
    """Operations in the order of their execution.

    :param nodes: each once.
    :param outputs: for each output, the numbers of the nodes that are its entries.
    """

    nodes: tuple[Node, ...]
    outputs: tuple[tuple[int, ...], ...]

    def evaluate(self, inputs: Sequence[ArrayLike]) -> list[NDArray[np.float64]]:
        """Perform it by NumPy.

        :param inputs: arrays of shape (entries, ...) whose trailing shapes fit each other.
        :returns: arrays of shape (entries, ...), one an output.
        """
        arrays = [np.asarray(given, dtype=float) for given in inputs]
        trailing = np.broadcast_shapes(*(array.shape[1:] for array in arrays))
        values: list[Any] = []
        with np.errstate(all="ignore"):  # as in C; what is not finite is the caller's to see
            for node in self.nodes:
                if node.operation is not None:
                    values.append(node.operation.numpy(*(values[number] for number in node.arguments)))
                elif node.constant is not None:
                    values.append(np.float64(node.constant))
                else:
                    values.append(arrays[node.arguments[0]][node.arguments[1]])
        found = []
        for entries in self.outputs:
            output = np.empty((len(entries), *trailing))
            for row, number in enumerate(entries):
                output[row] = values[number]
            found.append(output)
        return found


def program(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> Program:
    """The operations that lead from columns of symbols to columns of expressions.

    :raises ComponentError: for an operation that has no counterpart in C, such as a call of another function.
    """
    function = ca.Function("statements", list(inputs), [ca.densify(ca.SX(expression)) for expression in outputs])
    builder = _Builder()
    work: dict[int, int] = {}
    found = [[0] * function.numel_out(k) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        code, sources, targets = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if code == ca.OP_OUTPUT:
            found[targets[0]][targets[1]] = work[sources[0]]
        elif code == ca.OP_INPUT:
            work[targets[0]] = builder.number(Node(None, tuple(sources)))
        elif code == ca.OP_CONST:
            work[targets[0]] = builder.constant(function.instruction_constant(k))
        elif code in OPERATIONS:
            work[targets[0]] = builder.perform(code, [work[source] for source in sources])
        else:
            raise ComponentError(
                f"an expression has CasADi's instruction {code}, which is no scalar operation of C; expand the function"
            )
    return builder.program(found)


def c_statements(
    inputs: Sequence[tuple[ca.SX, str]], outputs: Sequence[tuple[ca.SX, str]], *, temporary: str = "a"
) -> list[str]:
    """C99 statements that calculate expressions; they need ``math.h``.

    :param inputs: columns of symbols, and how their entries are read: ``"y[{}][i]"`` for ``y[0][i]``, ``y[1][i]``, ...
    :param outputs: columns of expressions, and how their entries are written.
    :param temporary: names of temporaries begin with it.
    :returns: lines without indentation: reads, operations, writes.
    :raises ComponentError: as :func:`program` does.
    """
    found = program([symbols for symbols, _ in inputs], [expressions for expressions, _ in outputs])
    names: list[str] = []
    reads: list[str] = []
    lines: list[str] = []
    for node in found.nodes:
        if node.constant is not None:
            names.append(_literal(node.constant))
            continue
        name = f"{temporary}{len(reads) + len(lines)}"
        if node.operation is None:
            which, entry = node.arguments
            reads.append(f"const double {name} = {inputs[which][1].format(entry)};")
        else:
            value = node.operation.c.format(*(names[number] for number in node.arguments))
            lines.append(f"const double {name} = {value};")
        names.append(name)
    writes = [
        f"{pattern.format(entry)} = {names[number]};"
        for (_, pattern), entries in zip(outputs, found.outputs, strict=True)
        for entry, number in enumerate(entries)
    ]
    return [*reads, *lines, *writes]


@final
class _Builder:
    """Numbers nodes, equal ones alike; entries of inputs first."""

    def __init__(self) -> None:
        self._numbers: dict[object, int] = {}
        self._nodes: list[Node] = []

    def number(self, node: Node) -> int:
        key = node if node.constant is None else ("constant", node.constant.hex())  # tells 0 from -0
        if key not in self._numbers:
            self._numbers[key] = len(self._nodes)
            self._nodes.append(node)
        return self._numbers[key]

    def constant(self, value: float) -> int:
        return self.number(Node(None, (), float(value)))

    def perform(self, code: int, arguments: Sequence[int]) -> int:
        if code in {ca.OP_POW, ca.OP_CONSTPOW}:
            exponent = self._nodes[arguments[1]].constant
            if exponent == 0.5:
                return self.perform(ca.OP_SQRT, arguments[:1])
            if exponent is not None and exponent.is_integer() and 0 < abs(exponent) <= _LARGEST_POWER:
                power = self._power(arguments[0], int(abs(exponent)))
                return power if exponent > 0 else self.perform(ca.OP_INV, [power])
        if code in {ca.OP_ADD, ca.OP_MUL}:
            arguments = sorted(arguments)
        simpler = self._simpler(code, arguments)
        return self.number(Node(OPERATIONS[code], tuple(arguments))) if simpler is None else simpler

    def _simpler(self, code: int, arguments: Sequence[int]) -> int | None:
        """What it is without rounding differently: x - x = 0, (2 x) y = 2 (x y), ..., some of which occur again."""
        x, y = arguments[0], arguments[-1]
        left, right = self._nodes[x], self._nodes[y]
        if code == ca.OP_MUL and left.constant == 0.5 and right.is_a(ca.OP_TWICE):
            return right.arguments[0]
        if code == ca.OP_MUL and right.constant == 0.5 and left.is_a(ca.OP_TWICE):
            return left.arguments[0]
        if (code == ca.OP_SUB and x == y) or (code == ca.OP_MUL and 0.0 in (left.constant, right.constant)):
            return self.constant(0.0)
        other: tuple[int, list[int]] | None = None
        match code:
            case ca.OP_SUB if left.constant == 0.0:
                other = ca.OP_NEG, [y]
            case ca.OP_SUB if right.is_a(ca.OP_NEG):
                other = ca.OP_ADD, [x, right.arguments[0]]
            case ca.OP_ADD if left.is_a(ca.OP_NEG):
                other = ca.OP_SUB, [y, left.arguments[0]]
            case ca.OP_ADD if right.is_a(ca.OP_NEG):
                other = ca.OP_SUB, [x, right.arguments[0]]
            case ca.OP_MUL | ca.OP_TWICE | ca.OP_NEG:
                return self._pulled_out(code, arguments)
        return self.perform(*other) if other else None

    def _pulled_out(self, code: int, arguments: Sequence[int]) -> int | None:
        """Signs and factors of 2 in front of a product."""
        for outer in (ca.OP_NEG, ca.OP_TWICE):
            for place, number in enumerate(arguments):
                node = self._nodes[number]
                if node.is_a(outer) and code != ca.OP_NEG and not (code == outer == ca.OP_TWICE):
                    inner = [*arguments[:place], node.arguments[0], *arguments[place + 1 :]]
                    return self.perform(outer, [self.perform(code, inner)])
                if node.is_a(outer) and code == outer == ca.OP_NEG:
                    return node.arguments[0]
        return None

    def _power(self, base: int, exponent: int) -> int:
        if exponent == 1:
            return base
        half = self._power(base, exponent // 2)
        square = self.perform(ca.OP_SQ, [half])
        return self.perform(ca.OP_MUL, [base, square]) if exponent % 2 else square

    def program(self, outputs: Sequence[Sequence[int]]) -> Program:
        used = {number for entries in outputs for number in entries}
        for number in reversed(range(len(self._nodes))):
            if number in used and self._nodes[number].operation is not None:
                used.update(self._nodes[number].arguments)
        order = sorted(used, key=lambda number: (self._nodes[number].operation is not None, number))
        new = {old: k for k, old in enumerate(order)}
        nodes = []
        for old in order:
            node = self._nodes[old]
            if node.operation is not None:
                node = Node(node.operation, tuple(new[number] for number in node.arguments))
            nodes.append(node)
        return Program(tuple(nodes), tuple(tuple(new[number] for number in entries) for entries in outputs))


def _literal(value: float) -> str:
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return repr(value) if math.copysign(1.0, value) > 0 else f"({value!r})"
