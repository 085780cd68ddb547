"""The C of a model's functions, as core.h declares them: arrays in, arrays out."""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca

from liaisons.expressions import OPERATIONS, c_parts

_LONGEST = 1000
"""Operations in one function of C: for twice as many a compiler takes more than twice the time."""

_STATES = 1
"""Place among the arguments.  States come from the stage before; what else goes in has been there for long."""


def function_code(functions: Iterable[ca.Function]) -> tuple[list[str], int]:
    """Lines that define each function once, by its name, and how many numbers of work space they need.

    Scalar code is printed by :mod:`liaisons.expressions`: straight lines, in which a compiler sees that sine and cosine
    have one argument, and merges them.  CasADi prints the rest: maps over the links of a chain, foreign calls.
    """
    different = {function.name(): function for function in functions}.values()
    generator = ca.CodeGenerator("model", {"with_header": False, "with_export": False, "verbose": False})
    straight: list[str] = []
    space = 0
    for function in different:
        if _is_scalar(function):
            lines, kept = _straight(function)
            straight += lines
        else:
            generator.add(function)
            kept = function.sz_w()
        space = max(space, kept)
    # CasADi asks for hypot, which is five times slower.
    return [generator.dump().replace("hypot(x, y)", "sqrt(x * x + y * y)"), *straight], space


def _is_scalar(function: ca.Function) -> bool:
    known = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, *OPERATIONS}
    return function.is_a("SXFunction") and all(
        function.instruction_id(k) in known for k in range(function.n_instructions())
    )


def _straight(function: ca.Function) -> tuple[list[str], int]:
    arguments = function.sx_in()
    results = function.call(arguments, True, False)
    parts, kept = c_parts(
        [(argument, f"arguments[{i}][{{}}]") for i, argument in enumerate(arguments)],
        [(result, f"results[{i}][{{}}]") for i, result in enumerate(results)],
        kept="reals[{}]",
        most=_LONGEST,
        late=_STATES,
    )
    if len(parts) == 1:
        return define(function.name(), parts[0]), 0
    names = [f"{function.name()}_{i}" for i in range(len(parts))]
    lines = [line for name, statements in zip(names, parts, strict=True) for line in define(name, statements)]
    # Called by way of a table, so that compilers do not put them together again.
    lines += [f"static Function *const {function.name()}_parts[] = {{{', '.join(names)}}};", ""]
    calls = f"for (int i = 0; i < {len(parts)}; i++)"
    call = f"    {function.name()}_parts[i](arguments, results, integers, reals, memory);"
    return lines + define(function.name(), [calls, call]), kept


def define(name: str, statements: Iterable[str]) -> list[str]:
    """Lines of a function of core.h that does this."""
    return [
        f"static int {name}(const double **arguments, double **results, long long *integers, double *reals,",
        "    int memory) {",
        *(f"    {statement}" for statement in statements),
        "    return 0;",
        "}",
        "",
    ]
