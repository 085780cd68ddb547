"""A list of operations, made from CasADi expressions, and performed by NumPy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.errors import ComponentError
from liaisons.expressions.instruction_scheduling import Reordering
from liaisons.expressions.operations import OPERATIONS, Instruction, instructions
from liaisons.expressions.rewriting import Builder
from liaisons.expressions.sum_factoring import Scaled

_PASSES = 2  # what was used twice may be used once when factors have been put in front of sums


@final
@dataclass(frozen=True, slots=True)
class Program:
    """Operations in the order of their execution.

    :param nodes: each once.
    :param outputs: for each output, the numbers of the nodes that are its entries.
    """

    nodes: tuple[Instruction, ...]
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


def program(
    inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], *, reciprocals: bool = False, late: int | None = None
) -> Program:
    """The operations that lead from columns of symbols to columns of expressions.

    :param reciprocals: whether what divides more than one number is inverted once, and these are multiplied by it.
    :param late: the input that is known last, when all that depends on others alone has been calculated.
    :raises ComponentError: for an operation that has no counterpart in C, such as a call of another function.
    """
    function = ca.Function("statements", list(inputs), [ca.densify(ca.SX(expression)) for expression in outputs])
    builder = Builder()
    work: dict[int, Scaled] = {}
    found = [[(1.0, 0)] * function.numel_out(k) for k in range(function.n_out())]
    for code, sources, targets, constant in instructions(function):
        if code == ca.OP_OUTPUT:
            found[targets[0]][targets[1]] = work[sources[0]]
        elif code == ca.OP_INPUT:
            work[targets[0]] = builder.entry(sources)
        elif code == ca.OP_CONST:
            work[targets[0]] = builder.constant(constant)
        elif code in OPERATIONS:
            work[targets[0]] = builder.perform(code, [work[source] for source in sources])
        else:
            raise ComponentError(
                f"an expression has CasADi's instruction {code}, which is no scalar operation of C; expand the function"
            )
    short = _pruned(builder.nodes, [[builder.node(number) for number in entries] for entries in found])
    if reciprocals:
        short = _with_reciprocals(short)
    for _ in range(_PASSES):
        fast = Reordering(short.nodes, short.outputs, late)
        short = _pruned(fast.nodes, fast.outputs)
    return short


def _with_reciprocals(found: Program) -> Program:
    """A division takes as long as four multiplications, and the next one has to wait for it."""
    quotients = Counter(node.arguments[1] for node in found.nodes if node.is_a(ca.OP_DIV))
    nodes: list[Instruction] = []
    new: list[int] = []
    inverses: dict[int, int] = {}
    for node in found.nodes:
        if node.is_a(ca.OP_DIV) and quotients[node.arguments[1]] > 1:
            dividend, divisor = node.arguments
            if divisor not in inverses:
                inverses[divisor] = len(nodes)
                nodes.append(Instruction.of(ca.OP_INV, new[divisor]))
            renumbered = Instruction.of(ca.OP_MUL, new[dividend], inverses[divisor])
        else:
            renumbered = node.renumbered(new)
        new.append(len(nodes))
        nodes.append(renumbered)
    return Program(tuple(nodes), tuple(tuple(new[number] for number in entries) for entries in found.outputs))


def _pruned(nodes: Sequence[Instruction], outputs: Sequence[Sequence[int]]) -> Program:
    """What the outputs need; entries of inputs and constants first."""
    used = {number for entries in outputs for number in entries}
    for number in reversed(range(len(nodes))):
        if number in used and nodes[number].operation is not None:
            used.update(nodes[number].arguments)
    order = sorted(used, key=lambda number: (nodes[number].operation is not None, number))
    new = {old: k for k, old in enumerate(order)}
    kept = tuple([nodes[old].renumbered(new) for old in order])
    return Program(kept, tuple(tuple(new[number] for number in entries) for entries in outputs))
