"""The C of a model's functions, as core.h declares them: arrays in, arrays out."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

import casadi as ca

from liaisons.expressions import OPERATIONS, c_parts, operation_codes

DIFFERENTIATED = ("start", "outputs_function", "remember")
"""Functions of a model, by its members, of which the runtime has derivatives."""

_LONGEST = 1000
"""Largest number of operations in one C function: for twice as many a compiler takes more than twice the time."""

_ZEROS = 100
"""Number of zeros of a result that are written one by one; more are cleared in a loop."""

_DECLARATION = "const double "


def function_code(functions: Iterable[ca.Function]) -> tuple[list[str], int]:
    """Lines of C that define functions, each name once, and the number of doubles in their work space.

    Scalar code is printed by :mod:`liaisons.expressions`: straight lines, in which a compiler merges sine and cosine of
    one argument.  CasADi prints the rest: maps over the links of a chain, external calls.
    """
    generator = ca.CodeGenerator("model", {"with_header": False, "with_export": False, "verbose": False})
    straight: list[str] = []
    calling: list[ca.Function] = []
    space = 0
    for function in {function.name(): function for function in functions}.values():
        if _is_printable(function):
            lines, numbers = _straight_line_code(function)
            straight += lines
        else:
            generator.add(function)
            calling.append(function)
            numbers = function.sz_w()
        space = max(space, numbers)
    # CasADi calls hypot, which is five times slower.
    generated = generator.dump().replace("hypot(x, y)", "sqrt(x * x + y * y)")
    for function in calling:
        generated = _with_own_pointers(generated, function)
    return [generated, *straight], space


def _with_own_pointers(generated: str, function: ca.Function) -> str:
    """The code with a copy of the caller's pointers for a function that calls others.

    CasADi passes arguments and results of inner calls behind those of the outer one, in the same two arrays, where the
    runtime keeps what further functions take.
    """
    arguments, results = function.n_in(), function.n_out()
    if function.sz_arg() == arguments and function.sz_res() == results:
        return generated
    parameters = "const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem"
    head = f"int {function.name()}({parameters}){{\n"
    copies = [
        f"const casadi_real* arguments[{function.sz_arg()}];",
        f"casadi_real* results[{function.sz_res()}];",
        f"for (int i = 0; i < {arguments}; i++) arguments[i] = arg[i];",
        f"for (int i = 0; i < {results}; i++) results[i] = res[i];",
    ]
    begin, call, end = generated.partition(head)
    if not call:
        raise AssertionError(f"CasADi declares {function.name()} in another way")
    lines = "".join(f"  {line}\n" for line in copies)
    return begin + head + lines + end.replace("(arg, res, iw, w, mem)", "(arguments, results, iw, w, mem)", 1)


def _is_printable(function: ca.Function) -> bool:
    """Whether all operations of a function are scalar ones that can be printed in straight lines."""
    printable = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, *OPERATIONS}
    return function.is_a("SXFunction") and operation_codes(function) <= printable


def _straight_line_code(function: ca.Function) -> tuple[list[str], int]:
    """Lines of C that define a function of scalar operations, and the number of doubles in its work space."""
    arguments = function.sx_in()
    results = function.call(arguments, True, False)
    clear: list[str] = []
    written: list[tuple[ca.SX, str]] = []
    for i, result in enumerate(results):
        is_zero = [entry.is_zero() for entry in ca.vertsplit(result)]
        if sum(is_zero) <= _ZEROS:
            written.append((result, f"results[{i}][{{}}]"))
            continue
        clear.append(f"for (int j = 0; j < {len(is_zero)}; j++) results[{i}][j] = 0;")
        for first, end in _nonzero_ranges(is_zero):
            written.append((result[first:end], f"results[{i}][{first} + {{}}]"))
    parts, space = c_parts(
        [(argument, f"arguments[{i}][{{}}]") for i, argument in enumerate(arguments)],
        written,
        spill="reals[{}]",
        most=_LONGEST,
    )
    parts = [_joined_declarations(part) for part in parts]
    if len(parts) == 1:
        return function_definition(function.name(), [*clear, *parts[0]]), 0
    names = [f"{function.name()}_{i}" for i in range(len(parts))]
    lines = [
        line for name, statements in zip(names, parts, strict=True) for line in function_definition(name, statements)
    ]
    # Called through a table, so that compilers do not inline them.
    lines += [f"static Function *const {function.name()}_parts[] = {{{', '.join(names)}}};", ""]
    calls = f"for (int i = 0; i < {len(parts)}; i++)"
    call = f"    {function.name()}_parts[i](arguments, results, integers, reals, memory);"
    return lines + function_definition(function.name(), [*clear, calls, call]), space


def _joined_declarations(lines: Iterable[str]) -> list[str]:
    """Statements with successive declarations joined in one."""
    joined: list[str] = []
    for declares, group in groupby(lines, lambda line: line.startswith(_DECLARATION)):
        if declares:
            joined.append(_DECLARATION + ",\n".join(line.removeprefix(_DECLARATION)[:-1] for line in group) + ";")
        else:
            joined += group
    return joined


def _nonzero_ranges(is_zero: list[bool]) -> list[tuple[int, int]]:
    """First index and the end of each range of entries that are not 0."""
    edges = [True, *is_zero, True]
    changes = [i for i in range(len(edges) - 1) if edges[i] != edges[i + 1]]
    return list(zip(changes[::2], changes[1::2], strict=True))


def function_definition(name: str, statements: Iterable[str]) -> list[str]:
    """Lines of C that define a function with these statements, declared as in core.h."""
    return [
        f"static int {name}(const double **arguments, double **results, long long *integers, double *reals,",
        "    int memory) {",
        *(f"    {statement}" for statement in statements),
        "    return 0;",
        "}",
        "",
    ]
