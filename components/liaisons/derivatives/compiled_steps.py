"""Steps of one motion in C, with their derivatives: along directions, and backwards.

What a derivative along a direction needs of the motion is calculated once a stage; what remains, linear in the
directions, is a loop over :data:`DIRECTIONS` of them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from typing import Any, Literal, final

import casadi as ca
import numpy as np

from liaisons.derivatives.steps import METHOD, Floats, Integers, Segment, Steps
from liaisons.ensembles.right_hand_sides import RightHandSide
from liaisons.ensembles.steps import declarations, library
from liaisons.errors import SimulationError
from liaisons.expressions import c_parts, literal
from liaisons.expressions.algebra import stack

Purpose = Literal["run", "tangents", "adjoint"]

DIRECTIONS = 8
_OPERATIONS = 1000
"""In one function of C, at most."""
_STEPS = 2_000_000
"""From so many on there are too many."""

_HEAD = """\
#include <math.h>
#include <string.h>
{declarations}
enum {{ N = {states}, K = {lanes}, R = {shared}, W = {numbers}, S = {stages}, D = {directions}, ORDER = {order} }};
typedef double Row[D];
static const double C[S + 1] = {{{nodes}}};
{functions}

static double clipped(double t, const double *limits)
{{
    return t < limits[0] ? limits[0] : t > limits[1] ? limits[1] : t;
}}

"""
_RUN = """\
static void step(double t, double h, const double *limits, const double *k, const double *s, double *y, double *kept)
{
    double f[S][N], slope[N];
    for (int stage = 0; stage <= S; ++stage, kept += N) {
        const double time = clipped(t + C[stage] * h, limits);
        combine(stage, (const double (*)[N])f, slope);
        for (int j = 0; j < N; ++j)
            kept[j] = y[j] + h * slope[j];
        if (stage < S)
            rates(&time, k, s, kept, f[stage]);
        else
            project(&time, k, s, kept, y);
    }
}

long choose(long intervals, const double *cuts, const long *rows, const double *limits, const double *k,
            const double *table, double tolerance, const double *sizes, double *size, double *y, double *kept,
            long most, double *ends, long *counts)
{
    long count = 0;
    for (long m = 0; m < intervals; counts[m++] = count) {
        const double *s = table + rows[m] * R;
        double t = cuts[m], end = cuts[m + 1];
        do {
            const int last = *size >= 0.999999 * (end - t);
            const double h = last ? end - t : fmin(*size, 0.5 * (end - t));
            double whole[N], halves[N], error = 0.0;
            memcpy(whole, y, sizeof whole);
            memcpy(halves, y, sizeof halves);
            step(t, h, limits, k, s, whole, kept);
            step(t, 0.5 * h, limits, k, s, halves, kept);
            step(t + 0.5 * h, 0.5 * h, limits, k, s, halves, kept);
            for (int j = 0; j < N; ++j) {
                const double part = fabs(whole[j] - halves[j]) / (sizes[j] + fabs(whole[j]));
                error = isnan(error) || part <= error ? error : part;
            }
            const double factor = isfinite(error) ? 0.9 * pow(tolerance / fmax(error, 1e-30), 1.0 / ORDER) : 0.0;
            if (!(error <= tolerance)) {
                *size = h * fmax(factor, 0.1);
                if (t + 1e-3 * *size == t)
                    return -1 - count;
                continue;
            }
            if (count == most)
                return most + 1;
            *size = fmax(last ? *size : 0.0, h * fmin(factor, 4.0));
            t = ends[count++] = last ? end : t + h;
            memcpy(y, whole, sizeof whole);
        } while (t < end);
    }
    return count;
}

void advance(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
             const double *table, double *y, double *states, double *kept, long stride)
{
    for (long n = 0; n < steps; ++n) {
        step(t[n], h[n], limits, k, table + rows[n] * R, y, kept + n * stride);
        memcpy(states + n * N, y, N * sizeof *y);
    }
}

"""
_TANGENTS = """\
void tangents(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
              const double *table, const double *kept, long blocks, const Row *dk, const Row *dt, const Row *dh,
              long moving, Row *dy, const long *record, Row *records, Row *df)
{
    double f[S][N], slope[N], at[N], w[W];
    Row along[N], time_along;
    for (long n = 0; n < steps; ++n) {
        const double *s = table + rows[n] * R;
        for (int stage = 0; stage <= S; ++stage) {
            const double time = clipped(t[n] + C[stage] * h[n], limits), *y = kept + (n * (S + 1) + stage) * N;
            combine(stage, (const double (*)[N])f, slope);
            if (stage < S)
                rates_early(&time, k, s, y, f[stage], w);
            else
                project_early(&time, k, s, y, at, w);
            for (long b = 0; b < blocks; ++b) {
                const Row *rows_f = df + b * S * N, *t_b = dt + n * moving + b, *h_b = dh + n * moving + b;
                Row *dy_b = dy + b * N;
                combine_rows(stage, rows_f, along);
                for (int j = 0; j < N; ++j)
#pragma omp simd
                    for (int i = 0; i < D; ++i)
                        along[j][i] = dy_b[j][i] + h[n] * along[j][i] + (*h_b)[i] * slope[j];
                for (int i = 0; i < D; ++i)
                    time_along[i] = (*t_b)[i] + C[stage] * (*h_b)[i];
                if (stage < S)
                    rates_late(&time, k, s, y, w, (const Row *)&time_along, dk + b * K, (const Row *)along,
                               df + (b * S + stage) * N);
                else
                    project_late(&time, k, s, y, w, (const Row *)&time_along, dk + b * K, (const Row *)along, dy_b);
            }
        }
        if (record[n] >= 0)
            memcpy(records + record[n] * blocks * N, dy, blocks * N * sizeof *dy);
    }
}

"""
_ADJOINT = """\
void adjoint(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
             const double *table, const double *kept, const long *record, const double *weights, double *lambda,
             double *of_k, double *of_t, double *of_h)
{
    double f[N], g[N], scaled[N], of_y[S][N], total[N], part_k[K + 1], part_t;
    for (long n = steps - 1; n >= 0; --n) {
        const double *s = table + rows[n] * R, *y = kept + n * (S + 1) * N;
        double time = clipped(t[n] + h[n], limits);
        if (record[n] >= 0)
            for (int j = 0; j < N; ++j)
                lambda[j] += weights[record[n] * N + j];
        project_adjoint(&time, k, s, y + S * N, lambda, f, total, part_k, &part_t);
        memcpy(lambda, total, sizeof total);
        of_t[n] = of_h[n] = part_t;
        for (int i = 0; i < K; ++i)
            of_k[i] += part_k[i];
        for (int stage = S - 1; stage >= 0; --stage) {
            combine_back(stage, (const double (*)[N])of_y, lambda, g);
            for (int j = 0; j < N; ++j)
                scaled[j] = h[n] * g[j];
            time = clipped(t[n] + C[stage] * h[n], limits);
            rates_adjoint(&time, k, s, y + stage * N, scaled, f, of_y[stage], part_k, &part_t);
            of_t[n] += part_t;
            of_h[n] += C[stage] * part_t;
            for (int i = 0; i < K; ++i)
                of_k[i] += part_k[i];
            for (int j = 0; j < N; ++j) {
                of_h[n] += f[j] * g[j];
                total[j] += of_y[stage][j];
            }
        }
        memcpy(lambda, total, sizeof total);
    }
}
"""


@final
class CompiledSteps:
    """Steps in machine code."""

    def __init__(self, equations: RightHandSide) -> None:
        self._equations = equations
        self._libraries: dict[Purpose, ctypes.CDLL] = {}

    def _call(self, purpose: Purpose, name: str, *arguments: Any) -> int:
        """Call a function; arrays must have the type that it takes."""
        if purpose not in self._libraries:
            self._libraries[purpose] = library(source(self._equations, purpose))
        function = getattr(self._libraries[purpose], name)
        function.restype = ctypes.c_long
        return function(*map(_converted, arguments))

    def choose(
        self, segment: Segment, k: Floats, y: Floats, size: Floats, *, tolerance: float, sizes: Floats
    ) -> tuple[Floats, Integers]:
        """Ends of steps that keep to a tolerance, and how many there are up to the end of each interval.

        :param y: at the start; then where they end.
        :param size: of the first step; then of the next one.
        :returns: counts are empty where no step is small enough.
        """
        intervals = len(segment.rows)
        most, counts, kept = 4 * intervals + 1000, np.empty(intervals, dtype=np.int_), _room(1, y)
        while True:
            at, first, ends = y.copy(), size.copy(), np.empty(most)
            where = [intervals, segment.cuts, segment.rows, segment.limits, k, segment.table]
            done = self._call("run", "choose", *where, float(tolerance), sizes, first, at, kept, most, ends, counts)
            if done <= most:
                y[:], size[:] = at, first
                return ends[: done if done >= 0 else -1 - done], counts if done >= 0 else counts[:0]
            if most > _STEPS:
                raise SimulationError(
                    f"more than {most} steps until t = {ends[-1]:g} s; stop earlier, or take a larger tolerance"
                )
            most *= 4

    def advance(self, steps: Steps, k: Floats, y: Floats, *, keep: bool = False) -> tuple[Floats, Floats]:
        """States at the ends of steps, (steps, states), and, to be kept, those of their stages."""
        states, kept = np.empty((len(steps.t), len(y))), _room(len(steps.t) if keep else 1, y)
        self._call("run", "advance", *steps.arguments(k), y.copy(), states, kept, kept[0].size if keep else 0)
        return states, kept

    def tangents(self, steps: Steps, k: Floats, kept: Floats, of_k: Floats, of_y: Floats) -> tuple[Floats, Floats]:
        """Derivatives along directions at recorded ends, (records, states, directions), and at the last end.

        :param of_k: derivatives of the values, (values, directions); of_y: of the first state.
        """
        states, count = of_y.shape
        blocks = -(-count // DIRECTIONS)
        dk, dy = _blocks(of_k, blocks), _blocks(of_y, blocks)
        dt, dh = (np.ascontiguousarray(_blocks(rows, blocks).swapaxes(0, 1)) for rows in (steps.of_t, steps.of_h))
        records = np.empty((steps.records, blocks, states, DIRECTIONS))
        work = np.empty((blocks, METHOD.stages, states, DIRECTIONS))
        moving = blocks if len(dt) == len(steps.t) else 0
        self._call(
            "tangents",
            "tangents",
            *steps.arguments(k),
            kept,
            blocks,
            dk,
            dt,
            dh,
            moving,
            dy,
            steps.record,
            records,
            work,
        )
        return _unblocked(records, count), _unblocked(dy, count)

    def adjoint(
        self, steps: Steps, k: Floats, kept: Floats, weights: Floats, of_y: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Derivatives of a sum by the values, by starts and by sizes of steps.

        :param weights: derivatives by the states at recorded ends, (records, states).
        :param of_y: derivatives by the last state; then by the first one.
        """
        of_k, of_t, of_h = np.zeros(len(k)), np.empty(len(steps.t)), np.empty(len(steps.t))
        self._call("adjoint", "adjoint", *steps.arguments(k), kept, steps.record, weights, of_y, of_k, of_t, of_h)
        return of_k, of_t, of_h


def _converted(argument: Any) -> Any:
    if isinstance(argument, np.ndarray):
        assert argument.flags.c_contiguous
        return argument.ctypes.data_as(ctypes.c_void_p)
    return ctypes.c_double(argument) if isinstance(argument, float) else ctypes.c_long(argument)


def _room(steps: int, y: Floats) -> Floats:
    return np.empty((steps, METHOD.stages + 1, len(y)))


def _blocks(rows: Floats, blocks: int) -> Floats:
    """(rows, directions) as (blocks, rows, DIRECTIONS)."""
    padded = np.pad(rows, ((0, 0), (0, blocks * DIRECTIONS - rows.shape[1])))
    return np.ascontiguousarray(padded.reshape(len(rows), blocks, DIRECTIONS).swapaxes(0, 1))


def _unblocked(blocks: Floats, count: int) -> Floats:
    """(..., blocks, rows, DIRECTIONS) as (..., rows, directions)."""
    rows = blocks.swapaxes(-3, -2)
    return rows.reshape(*rows.shape[:-2], blocks.shape[-3] * DIRECTIONS)[..., :count]


def source(equations: RightHandSide, purpose: Purpose) -> str:
    """C99 of a motion, or of its derivatives."""
    t, k, s, y = equations.symbols
    point, variables = [(t, "t"), (k, "k"), (s, "s"), (y, "y")], ca.vertcat(t, k, y)
    projected = y if equations.projected is None else equations.projected
    lines, numbers = list[str](), 1
    for name, value in (("rates", equations.rates), ("project", projected)):
        if purpose == "run":
            lines += _function(name, point, [(value, "f")])
        elif purpose == "tangents":
            seeds = [(ca.SX.sym("d", column.numel()), f"*d{letter}") for column, letter in (*point[:2], point[3])]
            late = ca.densify(ca.jtimes(value, variables, ca.vertcat(*(column for column, _ in seeds))))
            late, symbols, early = ca.extract_parametric(late, ca.vertcat(t, k, s, y))
            numbers = max(numbers, len(early))
            lines += _function(f"{name}_early", point, [(value, "f"), (stack(early), "w")])
            lines += _function(f"{name}_late", [*point, (stack(symbols), "w"), *seeds], [(late, "*df")])
        else:
            a, ends = ca.SX.sym("a", y.numel()), np.cumsum([0, 1, k.numel(), y.numel()]).tolist()
            of_t, of_k, of_y = ca.vertsplit(ca.densify(ca.jtimes(value, variables, a, True)), ends)
            backwards = [(value, "f"), (of_y, "of_y"), (of_k, "of_k"), (of_t, "of_t")]
            lines += _function(f"{name}_adjoint", [*point, (a, "a")], backwards)
    lines += _combinations(purpose)
    head = _HEAD.format(
        declarations="\n".join(declarations()),
        functions="\n".join(lines),
        states=y.numel(),
        lanes=k.numel(),
        shared=s.numel(),
        numbers=numbers,
        stages=METHOD.stages,
        directions=DIRECTIONS,
        order=METHOD.order + 1,
        nodes=", ".join(map(literal, (*METHOD.nodes, 1.0))),
    )
    return head + {"run": _RUN, "tangents": _TANGENTS, "adjoint": _ADJOINT}[purpose]


def _combinations(purpose: Purpose) -> Iterator[str]:
    """Sums of the rates of stages, for each stage and for the step."""
    rows = *METHOD.matrix, METHOD.weights
    columns = [[0.0] * (q + 1) + [row[q] for row in METHOD.matrix[q + 1 :]] for q in range(METHOD.stages)]
    back = [
        [(weight, "lambda[j]")] + [(a, f"of_y[{q}][j]") for q, a in enumerate(column)]
        for weight, column in zip(METHOD.weights, columns, strict=True)
    ]
    kinds = {
        "combine(int stage, const double (*f)[N], double *sum)": (
            "sum[j]",
            [[(a, f"f[{q}][j]") for q, a in enumerate(row)] for row in rows],
        ),
        "combine_rows(int stage, const Row *restrict f, Row *restrict sum)": (
            "sum[j][i]",
            [[(a, f"f[{q} * N + j][i]") for q, a in enumerate(row)] for row in rows],
        ),
        "combine_back(int stage, const double (*of_y)[N], const double *lambda, double *sum)": ("sum[j]", back),
    }
    used = {"run": (0,), "tangents": (0, 1), "adjoint": (2,)}[purpose]
    for number, (head, (target, sums)) in enumerate(kinds.items()):
        if number in used:
            yield f"static void {head}\n{{\n    switch (stage) {{"
            for stage, terms in enumerate(sums):
                total = " + ".join(f"{literal(a)} * {term}" for a, term in terms if a) or "0.0"
                yield f"    case {stage}:\n        for (int j = 0; j < N; ++j)"
                if "[i]" in target:
                    yield "#pragma omp simd\n            for (int i = 0; i < D; ++i)"
                yield f"                {target} = {total};\n        return;"
            yield "    }\n}"


def _function(name: str, inputs: Sequence[tuple[ca.SX, str]], outputs: Sequence[tuple[ca.SX, str]]) -> Iterator[str]:
    """A function of pointers; those with a star are to rows of directions."""
    loops = outputs[0][1].startswith("*")
    parts, spilled = c_parts(
        *([(column, _entry(pointer)) for column, pointer in columns] for columns in (inputs, outputs)),
        spill=_entry("*v" if loops else "v"),
        most=_OPERATIONS,
    )
    taken = [f"const {_declared(pointer)}" for _, pointer in inputs] + [_declared(pointer) for _, pointer in outputs]
    given = ", ".join(pointer.lstrip("*") for _, pointer in (*inputs, *outputs))
    room = _declared("*v" if loops else "v")
    for number, part in enumerate(parts):
        yield f"static void {name}_{number}({', '.join(taken)}, {room})\n{{"
        if loops:
            yield "#pragma omp simd\n    for (int i = 0; i < D; ++i) {"
        yield from (f"    {line}" for line in part)
        yield "    }\n}" if loops else "}"
    yield f"static void {name}({', '.join(taken)})\n{{"
    yield f"    {'Row' if loops else 'double'} v[{max(1, spilled)}];"
    yield from (f"    {name}_{number}({given}, v);" for number in range(len(parts)))
    yield "}"


def _entry(pointer: str) -> str:
    return f"{pointer[1:]}[{{}}][i]" if pointer.startswith("*") else f"{pointer}[{{}}]"


def _declared(pointer: str) -> str:
    return f"{'Row' if pointer.startswith('*') else 'double'} *restrict {pointer.lstrip('*')}"
