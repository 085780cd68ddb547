"""C of explicit Runge-Kutta steps, from a right-hand side and a tableau.

One text makes the steps of an ensemble, of a single motion and of its derivatives: vectors have ``D`` numbers an entry,
entry by entry, one for each motion of an ensemble or each direction of a derivative.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from liaisons.expressions import c_parts
from liaisons_motion.right_hand_sides.methods import Tableau
from liaisons_motion.right_hand_sides.right_hand_side import CArray, RightHandSide

OPERATIONS = 1000
"""In one function of C, at most: the time to compile it grows faster than their number."""

_VECTORISED = (
    (("sin", "cos", "exp", "log"), ("pow",), (2, 22)),
    (
        ("acos", "acosh", "asin", "asinh", "atan", "atanh", "cosh", "erf", "expm1", "log1p", "sinh", "tan", "tanh"),
        ("atan2",),
        (2, 35),
    ),
)
"""Functions of one and of two arguments in libmvec, and the first glibc that has them."""

_HEAD = """\
#include <math.h>
#include <string.h>
{declarations}
enum {{ N = {states}, K = {lanes}, R = {shared}, S = {stages}, D = {width}, ORDER = {order} }};
static const double C[S + 1] = {{{nodes}}};

static inline double clipped(double t, const double *limits)
{{
    return t < limits[0] ? limits[0] : t > limits[1] ? limits[1] : t;
}}

"""
_STEP = "double t, double h, const double *limits, const double *k, const double *s, double *restrict y"
_SIMD = "#pragma omp simd\n"
"""Before loops over packs.  A single motion would wait for vectors that have been written number by number."""
_LOOP = "    for (int i = 0; i < {}; ++i)\n        {};"


@final
@dataclass(frozen=True, eq=False)
class StepCode:
    """C of explicit Runge-Kutta steps of D motions, or of the derivatives of one along D directions.

    :param width: D.
    """

    equations: RightHandSide
    tableau: Tableau
    width: int = 1

    def declarations(self) -> str:
        """C declarations that all other code needs: sizes, nodes and ``clipped``."""
        _, k, s, y = self.equations.symbols
        return _HEAD.format(
            declarations="\n".join(_libmvec_declarations()),
            states=y.numel(),
            lanes=k.numel(),
            shared=s.numel(),
            stages=self.tableau.stages,
            width=self.width,
            order=self.tableau.order + 1,
            nodes=", ".join(map(repr, (*self.tableau.nodes, 1.0))),
        )

    def step(self, *, stores_stages: bool = False) -> str:
        """C declarations, and the C function ``step`` that advances D motions by one step.

        :param stores_stages: whether ``step`` stores the states at the stages and before the projection.
        """
        equations, tableau, width = self.equations, self.tableau, self.width
        point, y = equations.c_arguments(), equations.symbols[3]
        projects = stores_stages or not ca.is_equal(equations.projected, y)
        most = OPERATIONS if width == 1 else sys.maxsize  # numbers that parts hand on are many where each is a pack
        lines = [*c_function("rates", point, [(equations.rates, "*f")], most)]
        lines += c_function("project", point, [(equations.guarded, "*f")], most) if projects else ()
        lines.append(f"static void step({_STEP}{', double *restrict kept' if stores_stages else ''})\n{{")
        lines.append(f"    double time, f[S * N * D]{'' if stores_stages else ', at[N * D]'};")
        for stage, row in enumerate(tableau.rows):
            last, own = stage == tableau.stages, f"(kept + {stage} * N * D)"
            state = own if stores_stages else "at" if any(row) and (projects or not last) else "y"
            if last or state != "y":
                expression = _stage_state_expression(row, "N * D")
                lines.append(_SIMD * (width > 1) + _LOOP.format("N * D", f"{state}[i] = {expression}"))
            lines.append(f"    time = clipped(t + C[{stage}] * h, limits);")
            if not last:
                lines.append(f"    rates(&time, k, s, {state}, f + {stage} * N * D);")
            elif projects:
                lines.append(f"    project(&time, k, s, {state}, y);")
        return self.declarations() + "\n".join([*lines, "}\n"])

    def stage_states(self) -> Iterator[str]:
        """C function ``move`` that writes the state at a stage or after the step, from the rates f of the stages."""
        parameters = "double h, const double *restrict y, double *restrict at"
        rows = (f"at[i] = {_stage_state_expression(row, 'count')}" for row in self.tableau.rows)
        return _switch_function("move", parameters, _SIMD, rows)

    def weighted_sums(self, *, adjoint: bool = False) -> Iterator[str]:
        """C function ``combine`` that sums the blocks of f with the weights of a row of the step, or of its adjoint."""
        rows = self.tableau.adjoint_rows if adjoint else self.tableau.rows
        statements = (f"sum[i] = {_weighted_sum_expression(row, 'count') or '0.0'}" for row in rows)
        return _switch_function("combine", "double *restrict sum", "", statements)


def _switch_function(name: str, parameters: str, simd: str, statements: Iterable[str]) -> Iterator[str]:
    """C function that switches to the statement of a row, a loop over blocks of f of count numbers."""
    yield f"static void {name}(int row, int count, const double *restrict f, {parameters})\n{{\n    switch (row) {{"
    for row, statement in enumerate(statements):
        yield f"    case {row}:\n{simd}{_LOOP.format('count', statement)}\n        return;"
    yield "    }\n}"


def _stage_state_expression(row: Sequence[float], count: str) -> str:
    """C expression of the state at a stage or after the step."""
    total = _weighted_sum_expression(row, count)
    return f"y[i] + h * ({total})" if total else "y[i]"


def _weighted_sum_expression(row: Sequence[float], count: str) -> str:
    """C expression of the weighted sum of blocks of f; empty if all weights are 0."""
    return " + ".join(f"{weight!r} * f[{q} * {count} + i]" for q, weight in enumerate(row) if weight)


def c_function(
    name: str, inputs: Sequence[CArray], outputs: Sequence[CArray], max_operations: int = OPERATIONS
) -> Iterator[str]:
    """C function that computes output arrays from input arrays, in a loop over the D numbers an entry if they have D.

    :param max_operations: in each of the C functions that it calls.
    """
    loops = outputs[0][1].startswith("*")
    spill = "*v" if loops else "v"
    parts, spilled = c_parts(
        *([(column, _array_entry_format(array)) for column, array in group] for group in (inputs, outputs)),
        spill=_array_entry_format(spill),
        most=max_operations,
    )
    names = [array.lstrip("*") for _, array in (*inputs, *outputs)]
    taken = [f"const double *restrict {array}" for array in names[: len(inputs)]]
    taken += [f"double *restrict {array}" for array in names[len(inputs) :]]
    for number, part in enumerate(parts):
        yield f"static inline void {name}_{number}({', '.join(taken)}, double *restrict v)\n{{"
        yield f"    {', '.join(f'(void){array}' for array in (*names[: len(inputs)], 'v'))};"
        if loops:
            yield "#pragma omp simd\n    for (int i = 0; i < D; ++i) {"
        yield from (f"    {line}" for line in part)
        yield "    }\n}" if loops else "}"
    yield f"static void {name}({', '.join(taken)})\n{{"
    yield f"    double v[{max(1, spilled)}{' * D' if loops else ''}];"
    yield from (f"    {name}_{number}({', '.join(names)}, v);" for number in range(len(parts)))
    yield "}"


def _array_entry_format(array: str) -> str:
    """Format string of an entry of a C array: ``"y[{}]"``, or ``"y[{} * D + i]"`` for ``"*y"``."""
    return f"{array[1:]}[{{}} * D + i]" if array.startswith("*") else f"{array}[{{}}]"


def _libmvec_declarations() -> Iterator[str]:
    """C declarations of the vector functions in libmvec; the system's header has them under -ffast-math only."""
    name, version = platform.libc_ver()
    glibc = tuple(int(part) for part in version.split(".")[:2]) if name == "glibc" else ()
    yield "#ifdef LIBMVEC"
    for ones, twos, since in _VECTORISED:
        if glibc >= since:
            for functions, arguments in ((ones, "double"), (twos, "double, double")):
                for called in functions:
                    yield f'__attribute__((const, simd("notinbranch"))) double {called}({arguments});'
    yield "#endif"
