r"""Straight-line code: scalar CasADi expressions as lists of operations, printed as C or evaluated.

Each operation is one statement with one temporary, so that the body of a loop over lanes (members of an ensemble, links
of a chain) is free of calls that a compiler cannot vectorise::

    >>> x, k = ca.SX.sym("x", 2), ca.SX.sym("k")
    >>> [lines], _ = c_parts([(x, "x[{}][i]"), (k, "k[i]")], [(-k * ca.sin(x[0]) / x[1], "f[i]")])
    >>> print("\n".join(lines))
    const double a0 = k[i];
    const double a1 = x[0][i];
    const double a2 = x[1][i];
    const double a3 = sin(a1);
    const double a4 = a0 * a3;
    const double a5 = a4 / a2;
    const double a6 = -a5;
    f[i] = a6;

Common subexpressions are evaluated once.  All inputs are read before the first output is written: they may share an
array.
"""

from __future__ import annotations

from liaisons.expressions.calls import called_functions, jumping_table, without_zero_directions
from liaisons.expressions.dimensions import Declared, check_units
from liaisons.expressions.identities import nonzero_states
from liaisons.expressions.operations import (
    OPERATIONS,
    Instruction,
    interpret,
    is_smooth,
    is_smooth_function,
    operation_codes,
    perform,
)
from liaisons.expressions.printing import c_parts, literal
from liaisons.expressions.programs import Program

__all__ = [
    "OPERATIONS",
    "Declared",
    "Instruction",
    "Program",
    "c_parts",
    "called_functions",
    "check_units",
    "interpret",
    "is_smooth",
    "is_smooth_function",
    "jumping_table",
    "literal",
    "nonzero_states",
    "operation_codes",
    "perform",
    "without_zero_directions",
]
