"""Programs as statements of C."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence

import casadi as ca

from liaisons.expressions.operations import OPERATIONS
from liaisons.expressions.programs import Program


def c_parts(
    inputs: Sequence[tuple[ca.SX, str]],
    outputs: Sequence[tuple[ca.SX, str]],
    *,
    spill: str = "",
    most: int = sys.maxsize,
) -> tuple[list[list[str]], int]:
    """C99 statements that evaluate expressions, in parts for functions of their own; they need ``math.h``.

    Compile time is superlinear in the statements of a function.

    :param inputs: columns of symbols, and how their entries are read: ``"y[{}][i]"`` for ``y[0][i]``, ``y[1][i]``, ...
    :param outputs: columns of expressions, and how their entries are written.
    :param spill: where a number is stored that a later part needs: ``"w[{}]"``.
    :param most: operations in a part, at most.
    :returns: lines of each part, at least one, without indentation: reads, operations, writes; and the count of stored
        numbers.  An output is written by the part that calculates it, so with several parts it must lie elsewhere than
        the inputs.
    :raises ComponentError: as :func:`program` does.
    """
    symbols, expressions = [column for column, _ in inputs], [column for column, _ in outputs]
    code = Program.of(symbols, expressions, reciprocals=True)
    calculated = [number for number, node in enumerate(code.nodes) if node.operation is not None]
    count = max(1, -(-len(calculated) // most))
    part_of = {number: i * count // len(calculated) for i, number in enumerate(calculated)}
    writes: list[list[tuple[int, str]]] = [[] for _ in range(count)]
    for (_, pattern), entries in zip(outputs, code.outputs, strict=True):
        for entry, number in enumerate(entries):
            writes[part_of.get(number, 0)].append((number, pattern.format(entry)))
    sources = {
        number: inputs[node.arguments[0]][1].format(node.arguments[1])
        for number, node in enumerate(code.nodes)
        if node.operation is None and node.constant is None
    }
    entries_read = len(sources)
    for number in calculated:
        for argument in code.nodes[number].arguments:
            if part_of.get(argument, part_of[number]) < part_of[number] and argument not in sources:
                sources[argument] = spill.format(len(sources) - entries_read)
                writes[part_of[argument]].append((argument, sources[argument]))
    members: list[list[int]] = [[] for _ in range(count)]
    for number in calculated:
        members[part_of[number]].append(number)
    parts = [_part(code, *part, sources) for part in zip(members, writes, strict=True)]
    return parts, len(sources) - entries_read


def _part(
    code: Program,
    calculated: Sequence[int],
    writes: Sequence[tuple[int, str]],
    sources: Mapping[int, str],
) -> list[str]:
    """C statements of one part: reads, operations, writes."""
    names: dict[int, str] = {}
    lines: list[str] = []

    def declare(number: int, value: str) -> None:
        names[number] = f"a{len(lines)}"
        lines.append(f"const double {names[number]} = {value};")

    needed = {number for number, _ in writes}.union(*(code.nodes[number].arguments for number in calculated))
    for number in sorted(needed.difference(calculated)):
        constant = code.nodes[number].constant
        if constant is None:
            declare(number, sources[number])
        else:
            names[number] = literal(constant)
    for number in calculated:
        node = code.nodes[number]
        assert node.operation is not None
        declare(number, OPERATIONS[node.operation].format(*(names[argument] for argument in node.arguments)))
    return [*lines, *(f"{target} = {names[number]};" for number, target in writes)]


def literal(value: float) -> str:
    """Number as an operand in C."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return repr(value) if math.copysign(1.0, value) > 0 else f"({value!r})"
