"""Calls of other functions inside scalar expressions, as ``ca.interpolant`` makes them, and their derivatives.

CasADi differentiates a call by a function that takes the direction as arguments, ``fwd1_curve(x, , 1)``, in which it is
linear; of a call that does not depend on the variable, too, by a direction of zeros.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from liaisons.expressions.operations import perform

_Call = tuple[ca.Function, list[list[ca.SX]], list[int]]
"""Function, the entries of its arguments, and the numbers of the arguments that are directions."""


def called_functions(expression: ca.SX) -> list[ca.Function]:
    """Functions that an expression calls, directly or by others."""
    return ca.Function("calls", ca.symvar(expression), [expression]).find_functions()


def jumping_table(expression: ca.SX, *, slope: bool) -> str:
    """Name of a linear interpolant in an expression, else no text.

    :param slope: only one whose derivative is in it.
    """
    kinds = ("LinearInterpolantJac",) if slope else ("LinearInterpolant", "LinearInterpolantJac")
    names = (f.name().removeprefix("jac_") for f in called_functions(expression) if f.class_name() in kinds)
    return next(names, "")


def without_zero_directions(expression: ca.SX) -> ca.SX:
    """Expression with zeros for derivatives of calls in directions of zeros."""

    def call(function: ca.Function, arguments: list[list[ca.SX]], directions: list[int]) -> list[ca.SX] | None:
        entries = [x for i in directions for x in arguments[i]]
        return [ca.SX(0)] * function.nnz_out() if entries and all(x.is_zero() for x in entries) else None

    return _rebuilt(expression, call) if called_functions(expression) else expression


def with_opaque_calls(expression: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
    """Expression with symbols for the results of its calls, each with equal arguments once.

    Derivatives are linear in their directions: a symbol stands for the factor of each.
    """
    known: dict[tuple[object, ...], ca.SX] = {}

    def call(function: ca.Function, arguments: list[list[ca.SX]], directions: list[int]) -> list[ca.SX]:
        fixed = tuple(x.element_hash() for i, entries in enumerate(arguments) for x in entries if i not in directions)
        along = [x for i in directions for x in arguments[i]]
        key = function.name(), function.__hash__(), fixed

        def factor(output: int, k: int) -> ca.SX:
            return known.setdefault((*key, output, k), ca.SX.sym(f"call{len(known)}"))

        terms = along or [ca.SX(1)]
        return [sum((x * factor(o, k) for k, x in enumerate(terms)), ca.SX(0)) for o in range(function.nnz_out())]

    rebuilt = _rebuilt(expression, call) if called_functions(expression) else expression
    return rebuilt, list(known.values())


def _rebuilt(
    expression: ca.SX, replace: Callable[[ca.Function, list[list[ca.SX]], list[int]], Sequence[ca.SX] | None]
) -> ca.SX:
    """Expression with other values for its calls.

    :param replace: function, arguments and numbers of those that are directions -> entries of all results; None: as
        they are.
    """
    results: dict[int, Sequence[ca.SX]] = {}  # entries of a call, else one value
    waiting: list[Any] = list(expression.nonzeros())
    while waiting:
        node = waiting[-1]
        operands = [node.dep(i) for i in range(node.n_dep())]
        missing = [x for x in operands if x.element_hash() not in results]
        if missing:
            waiting += missing
            continue
        waiting.pop()
        if node.element_hash() in results:
            continue
        values = [results[x.element_hash()] for x in operands]
        if node.is_output():
            results[node.element_hash()] = [values[0][node.which_output()]]
        elif node.is_call():
            results[node.element_hash()] = _results_of_call(node, [value[0] for value in values], replace)
        elif not operands or all(ca.is_equal(x, value[0]) for x, value in zip(operands, values, strict=True)):
            results[node.element_hash()] = [node]
        else:
            results[node.element_hash()] = [perform(node.op(), [value[0] for value in values])]
    nodes: list[Any] = list(expression.nonzeros())
    entries = [results[node.element_hash()][0] for node in nodes]
    return ca.SX(expression.sparsity(), ca.vertcat(*entries)) if entries else expression


def _results_of_call(
    node: Any,
    entries: list[ca.SX],
    replace: Callable[[ca.Function, list[list[ca.SX]], list[int]], Sequence[ca.SX] | None],
) -> Sequence[ca.SX]:
    """Entries of all results of a call, one after the other."""
    function, left = node.which_function(), iter(entries)
    arguments = [[next(left) for _ in range(function.nnz_in(i))] for i in range(function.n_in())]
    kind = re.match(r"(fwd|adj)\d*_", function.name_out(0))
    names = function.name_in()
    directions = [i for i, name in enumerate(names) if kind and name.startswith(kind[0])]
    found = replace(function, arguments, directions)
    if found is not None:
        return found
    columns = [ca.SX(function.sparsity_in(i), stack) for i, stack in enumerate(map(_column, arguments))]
    made = function.call(columns, False, True)  # never inlined
    return [ca.SX(x) for result in made for x in result.nonzeros()]


def _column(entries: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
