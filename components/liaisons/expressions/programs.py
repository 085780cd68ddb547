"""Lists of scalar operations: made from CasADi expressions, optimised, and evaluated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.expressions.common_factors import Factored
from liaisons.expressions.operations import NUMPY, Instruction, interpret
from liaisons.expressions.value_numbering import Builder

_PASSES = 2  # what was used twice may be used once when factors have been put in front of sums


@final
@dataclass(frozen=True, slots=True)
class Program:
    """Straight-line code: instructions in the order of their execution.

    :param nodes: each once.
    :param outputs: for each output, the numbers of the nodes that are its entries.
    """

    nodes: tuple[Instruction, ...]
    outputs: tuple[tuple[int, ...], ...]

    @staticmethod
    def of(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], *, reciprocals: bool = False) -> Program:
        """Optimised program of expressions, columns, as functions of columns of symbols.

        :param reciprocals: whether a divisor of several numbers is inverted once, and multiplied by.
        :raises ComponentError: for an operation that has no counterpart in C, such as a call of another function.
        """
        function = ca.Function("statements", list(inputs), [ca.densify(ca.SX(expression)) for expression in outputs])
        builder = Builder()
        results = interpret(function, entry=builder.entry, constant=builder.constant, operation=builder.perform)
        short = _pruned(builder.nodes, [[builder.node_number(number) for number in entries] for entries in results])
        if reciprocals:
            short = _with_reciprocals(short)
        for _ in range(_PASSES):
            factored = Factored(short.nodes, short.outputs)
            short = _pruned(factored.nodes, factored.outputs)
        return short

    def evaluate(self, inputs: Sequence[ArrayLike]) -> list[NDArray[np.float64]]:
        """Evaluate the program by NumPy; return its outputs.

        :param inputs: arrays of shape (entries, ...) whose trailing shapes fit each other.
        :returns: arrays of shape (entries, ...), one an output.
        """
        arrays = [np.asarray(array, dtype=float) for array in inputs]
        trailing = np.broadcast_shapes(*(array.shape[1:] for array in arrays))
        values: list[Any] = []
        with np.errstate(all="ignore"):  # as in C; what is not finite is the caller's to see
            for node in self.nodes:
                if node.operation is not None:
                    result = NUMPY[node.operation](*(values[number] for number in node.arguments))
                    values.append(np.asarray(result, dtype=float))
                elif node.constant is not None:
                    values.append(np.float64(node.constant))
                else:
                    values.append(arrays[node.arguments[0]][node.arguments[1]])
        columns = ([np.broadcast_to(values[number], trailing) for number in entries] for entries in self.outputs)
        return [np.array(column, dtype=float).reshape(len(column), *trailing) for column in columns]


def _with_reciprocals(original: Program) -> Program:
    """Program with one reciprocal, as slow as four products, in place of several quotients by a number."""
    quotients = Counter(node.arguments[1] for node in original.nodes if node.operation == ca.OP_DIV)
    nodes: list[Instruction] = []
    new: list[int] = []
    inverses: dict[int, int] = {}
    for node in original.nodes:
        if node.operation == ca.OP_DIV and quotients[node.arguments[1]] > 1:
            dividend, divisor = node.arguments
            if divisor not in inverses:
                inverses[divisor] = len(nodes)
                nodes.append(Instruction(ca.OP_INV, (new[divisor],)))
            replacement = Instruction(ca.OP_MUL, (new[dividend], inverses[divisor]))
        else:
            replacement = node.renumbered(new)
        new.append(len(nodes))
        nodes.append(replacement)
    return Program(tuple(nodes), _renumbered(original.outputs, new))


def _pruned(nodes: Sequence[Instruction], outputs: Sequence[Sequence[int]]) -> Program:
    """Program of the nodes that outputs depend on, entries of inputs and constants first."""
    used = {number for entries in outputs for number in entries}
    for number in reversed(range(len(nodes))):
        if number in used and nodes[number].operation is not None:
            used.update(nodes[number].arguments)
    order = sorted(used, key=lambda number: (nodes[number].operation is not None, number))
    new = {old: k for k, old in enumerate(order)}
    return Program(tuple([nodes[old].renumbered(new) for old in order]), _renumbered(outputs, new))


def _renumbered(
    outputs: Sequence[Sequence[int]], new: Sequence[int] | Mapping[int, int]
) -> tuple[tuple[int, ...], ...]:
    """Outputs with the new numbers of nodes."""
    return tuple(tuple(new[number] for number in entries) for entries in outputs)
