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

from liaisons.algebra import stack
from liaisons.base.arrays import lane_blocks, rows_of_blocks
from liaisons.base.compiled_code import call_c_function, compiled_library
from liaisons.errors import SimulationError
from liaisons_motion.derivatives.contacts import Contacts, packaged_c_file
from liaisons_motion.derivatives.steps import METHOD, Floats, Integers, Segment, Steps
from liaisons_motion.right_hand_sides import CArray, RightHandSide, StepCode, c_function

Purpose = Literal["run", "tangents", "adjoint"]

DIRECTIONS = 8
_OPTIONS: dict[Purpose, tuple[str, ...]] = {"run": ("-fno-tree-vectorize",), "tangents": (), "adjoint": ()}
"""Of the compiler: a single motion waits for vectors that have been written number by number."""
_STEPS = 2_000_000
"""Steps of one motion from which on it is refused."""

_RUN = """\
/* Largest difference of a step and two halves, relative to sizes; not-a-number if one is. */
static double step_error(const double *whole, const double *halves, const double *sizes)
{
    double error = 0.0;
    for (int j = 0; j < N; ++j) {
        const double part = fabs(whole[j] - halves[j]) / (sizes[j] + fabs(whole[j]));
        error = isnan(error) || part <= error ? error : part;
    }
    return error;
}

/* By which the size of a step may change. */
static double size_factor(double error, double tolerance)
{
    return isfinite(error) ? 0.9 * pow(tolerance / fmax(error, 1e-30), 1.0 / ORDER) : 0.0;
}

/* Try a step, also by halves, whose path has start, middle and end; whether its error is small enough, or *size. */
static int try_step(double t, double h, const double *limits, const double *k, const double *s, const double *y,
                    double tolerance, const double *sizes, double *size, double *whole, double *path, double *kept,
                    double *factor)
{
    double *halves = path + 2 * N;
    memcpy(whole, y, N * sizeof *y);
    memcpy(path, y, N * sizeof *y);
    memcpy(halves, y, N * sizeof *y);
    step(t, h, limits, k, s, whole, kept);
    step(t, 0.5 * h, limits, k, s, halves, kept);
    memcpy(path + N, halves, N * sizeof *y);
    step(t + 0.5 * h, 0.5 * h, limits, k, s, halves, kept);
    const double error = step_error(whole, halves, sizes);
    *factor = size_factor(error, tolerance);
    if (error <= tolerance)
        return 1;
    *size = h * fmax(*factor, 0.1);
    return 0;
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
            double whole[N], path[3 * N], factor;
            if (!try_step(t, h, limits, k, s, y, tolerance, sizes, size, whole, path, kept, &factor)) {
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
/* Derivatives along blocks of directions of a step from its stages: dy before it, then behind it. */
static void step_tangents(double t, double h, const double *limits, const double *k, const double *s,
                          const double *kept, long blocks, const double *dk, const double *dt, const double *dh,
                          double *dy, double *df)
{
    double f[S * N], slope[N], at[N], w[W], along[N * D], time_along[D];
    for (int stage = 0; stage <= S; ++stage) {
        const double time = clipped(t + C[stage] * h, limits), *y = kept + stage * N;
        combine(stage, N, f, slope);
        if (stage < S)
            rates_early(&time, k, s, y, f + stage * N, w);
        else
            project_early(&time, k, s, y, at, w);
        for (long b = 0; b < blocks; ++b) {
            const double *t_b = dt + b * D, *h_b = dh + b * D, *k_b = dk + b * K * D;
            double *y_b = dy + b * N * D, *f_b = df + b * S * N * D;
            move(stage, N * D, f_b, h, y_b, along);
            for (int j = 0; j < N; ++j)
#pragma omp simd
                for (int i = 0; i < D; ++i)
                    along[j * D + i] += h_b[i] * slope[j];
            for (int i = 0; i < D; ++i)
                time_along[i] = t_b[i] + C[stage] * h_b[i];
            if (stage < S)
                rates_late(&time, k, s, y, w, time_along, k_b, along, f_b + stage * N * D);
            else
                project_late(&time, k, s, y, w, time_along, k_b, along, y_b);
        }
    }
}

void tangents(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
              const double *table, const double *kept, long blocks, const double *dk, const double *dt,
              const double *dh, long moving, double *dy, const long *record, double *records, double *df)
{
    for (long n = 0; n < steps; ++n) {
        const long moved = n * moving * D;
        step_tangents(t[n], h[n], limits, k, table + rows[n] * R, kept + n * (S + 1) * N, blocks, dk, dt + moved,
                      dh + moved, dy, df);
        if (record[n] >= 0)
            memcpy(records + record[n] * blocks * N * D, dy, blocks * N * D * sizeof *dy);
    }
}
"""
_ADJOINT = """\
/* Derivatives of a sum by what is before a step from its stages: lambda by y behind it, then before it. */
static void step_adjoint(double t, double h, const double *limits, const double *k, const double *s, const double *y,
                         double *lambda, double *of_k, double *of_t, double *of_h)
{
    double f[N], g[N], scaled[N], total[N], part_k[K + 1], part_t;
    double of_y[(S + 1) * N]; /* by y after the step, and at each stage */
    double time = clipped(t + h, limits);
    project_adjoint(&time, k, s, y + S * N, lambda, f, total, part_k, &part_t);
    memcpy(of_y, total, sizeof total);
    *of_t = *of_h = part_t;
    for (int i = 0; i < K; ++i)
        of_k[i] += part_k[i];
    for (int stage = S - 1; stage >= 0; --stage) {
        combine(stage, N, of_y, g);
        for (int j = 0; j < N; ++j)
            scaled[j] = h * g[j];
        time = clipped(t + C[stage] * h, limits);
        rates_adjoint(&time, k, s, y + stage * N, scaled, f, of_y + (stage + 1) * N, part_k, &part_t);
        *of_t += part_t;
        *of_h += C[stage] * part_t;
        for (int i = 0; i < K; ++i)
            of_k[i] += part_k[i];
        for (int j = 0; j < N; ++j) {
            *of_h += f[j] * g[j];
            total[j] += of_y[(stage + 1) * N + j];
        }
    }
    memcpy(lambda, total, sizeof total);
}

void adjoint(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
             const double *table, const double *kept, const long *record, const double *weights, double *lambda,
             double *of_k, double *of_t, double *of_h)
{
    for (long n = steps - 1; n >= 0; --n) {
        if (record[n] >= 0)
            for (int j = 0; j < N; ++j)
                lambda[j] += weights[record[n] * N + j];
        step_adjoint(t[n], h[n], limits, k, table + rows[n] * R, kept + n * (S + 1) * N, lambda, of_k, of_t + n,
                     of_h + n);
    }
}
"""


@final
class CompiledSteps:
    """C functions that take the steps of a motion, each compiled before its first call."""

    def __init__(self, equations: RightHandSide, contacts: Contacts | None) -> None:
        """Take the equations of the motion, and its contacts."""
        self._equations, self._contacts = equations, contacts
        self._libraries: dict[Purpose, ctypes.CDLL] = {}

    def call(self, purpose: Purpose, name: str, *arguments: Any) -> int:
        """Call a C function of the library for a purpose, compiled before its first call; return what it returns."""
        if purpose not in self._libraries:
            code = c_source(self._equations, purpose, self._contacts)
            self._libraries[purpose] = compiled_library(code, *_OPTIONS[purpose])
        return call_c_function(self._libraries[purpose], name, *arguments)

    def choose_step_ends(
        self, segment: Segment, k: Floats, y: Floats, size: Floats, *, tolerance: float, sizes: Floats
    ) -> tuple[Floats, Integers]:
        """Choose steps within a tolerance: their ends, and how many there are up to the end of each interval.

        :param y: first state; replaced by the last one.
        :param size: of the first step; replaced by that of the next one.
        :param sizes: nominal values of the states.
        :returns: counts are empty where no step is small enough.
        """
        intervals = len(segment.rows)
        most, counts, stages = 4 * intervals + 1000, np.empty(intervals, dtype=np.int_), stage_room(1, y)
        motion = [intervals, segment.instants, segment.rows, segment.limits, k, segment.table, float(tolerance), sizes]
        while True:
            state, first, ends = y.copy(), size.copy(), np.empty(most)
            done = self.call("run", "choose", *motion, first, state, stages, most, ends, counts)
            if done <= most:
                y[:], size[:] = state, first
                return ends[: done if done >= 0 else -1 - done], counts if done >= 0 else counts[:0]
            refuse_many(most, ends[-1])
            most *= 4

    def advance(self, steps: Steps, k: Floats, y: Floats, *, keep: bool = False) -> tuple[Floats, Floats]:
        """States at the ends of steps, (steps, states), and of their stages, of the last step alone unless kept."""
        states, stages = np.empty((len(steps.t), len(y))), stage_room(len(steps.t) if keep else 1, y)
        stride = stages[0].size if keep else 0
        self.call("run", "advance", *steps.arguments(k), y.copy(), states, stages, stride)
        return states, stages

    def directional_derivatives(
        self, steps: Steps, k: Floats, stages: Floats, k_directions: Floats, y_directions: Floats
    ) -> tuple[Floats, Floats]:
        """Derivatives of states along directions, at recorded ends (records, states, directions), and at the last end.

        :param k_directions: directions of the values, (values, directions); ``y_directions``: of the first state.
        """
        states, count = y_directions.shape
        dk, dy = lane_blocks(k_directions, DIRECTIONS), lane_blocks(y_directions, DIRECTIONS)
        dt, dh = (
            np.ascontiguousarray(lane_blocks(rows, DIRECTIONS).swapaxes(0, 1)) for rows in (steps.of_t, steps.of_h)
        )
        blocks, is_recorded = len(dy), steps.records >= 0
        record = np.where(is_recorded, np.cumsum(is_recorded) - 1, -1)
        records = np.empty((int(is_recorded.sum()), blocks, states, DIRECTIONS))
        work = np.empty((blocks, METHOD.stages, states, DIRECTIONS))
        seeds = [blocks, dk, dt, dh, blocks if len(dt) == len(steps.t) else 0, dy]
        self.call("tangents", "tangents", *steps.arguments(k), stages, *seeds, record, records, work)
        return rows_of_blocks(records, count), rows_of_blocks(dy, count)

    def adjoint_derivatives(
        self, steps: Steps, k: Floats, stages: Floats, weights: Floats, y_adjoint: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Derivatives of a weighted sum of states by the values (values,), and by starts and sizes of steps (steps,).

        :param weights: derivatives by the states at all recorded times, (times, states).
        :param y_adjoint: derivatives of the sum by the last state; replaced by those by the first one.
        """
        of_k, of_t, of_h = np.zeros(len(k)), np.empty(len(steps.t)), np.empty(len(steps.t))
        sums = [weights, y_adjoint, of_k, of_t, of_h]
        self.call("adjoint", "adjoint", *steps.arguments(k), stages, steps.records, *sums)
        return of_k, of_t, of_h


def stage_room(steps: int, y: Floats) -> Floats:
    """Uninitialized array (steps, stages + 1, states): states at stages, and at the end before the projection."""
    return np.empty((steps, METHOD.stages + 1, len(y)))


def refuse_many(steps: int, t: float) -> None:
    """Raise a SimulationError if there are too many steps up to an instant."""
    if steps > _STEPS:
        raise SimulationError(f"more than {steps} steps until t = {t:g} s; stop earlier, or take a larger tolerance")


def c_source(equations: RightHandSide, purpose: Purpose, contacts: Contacts | None) -> str:
    """C99 code of steps, or of their derivatives, for a purpose."""
    if purpose == "run":
        steps = StepCode(equations, METHOD).step(stores_stages=True)
        return steps + _RUN + (contacts.event_code() if contacts else "")
    code = StepCode(equations, METHOD, DIRECTIONS if purpose == "tangents" else 1)
    point, lines = equations.c_arguments(packed=False), list[str]()
    forwards = {"rates": (equations.rates, point), "project": (equations.projected, point)}
    backwards = {}
    if contacts:
        forwards |= {
            name: (value, [*point, (contacts.flags, "flags")]) for name, value in contacts.states_after_events.items()
        }
        backwards = {"watch": (contacts.indicators, point)}
        lines.append(contacts.entry_declarations())
    if purpose == "adjoint":
        forwards, backwards = {}, forwards | backwards
    parametric, variables = 1, [point[i] for i in (0, 1, 3)]
    for name, (value, arguments) in forwards.items():
        early, late = _directional_derivative_code(name, value, arguments, variables)
        parametric = max(parametric, early)
        lines += late
    for name, (value, arguments) in backwards.items():
        lines += _adjoint_derivative_code(name, value, arguments, variables)
    if purpose == "tangents":
        lines += [*code.stage_states(), *code.weighted_sums(), f"enum {{ W = {parametric} }};", _TANGENTS]
    else:
        lines += [*code.weighted_sums(adjoint=True), _ADJOINT]
    sweep = [packaged_c_file(f"contact_{purpose}")] if contacts else []
    return "\n".join([code.declarations(), *lines, *sweep])


def _directional_derivative_code(
    name: str, expression: ca.SX, arguments: Sequence[CArray], variables: Sequence[CArray]
) -> tuple[int, list[str]]:
    """C functions of an expression and of its directional derivatives, and the count of numbers that directions share.

    :param variables: those of the arguments that have derivatives.
    """
    seeds = [(ca.SX.sym("d", column.numel()), f"*d{array}") for column, array in variables]
    moved, along, point = (ca.vertcat(*(column for column, _ in group)) for group in (variables, seeds, arguments))
    late, symbols, early = ca.extract_parametric(ca.densify(ca.jtimes(expression, moved, along)), point)
    shared, own = [*arguments, (stack(symbols), "w"), *seeds], [(expression, "f"), (stack(early), "w")]
    lines = [*c_function(f"{name}_early", arguments, own), *c_function(f"{name}_late", shared, [(late, "*df")])]
    return len(early), lines


def _adjoint_derivative_code(
    name: str, expression: ca.SX, arguments: Sequence[CArray], variables: Sequence[CArray]
) -> Iterator[str]:
    """C function of an expression and of the derivatives of its weighted sum by t, k and y."""
    weights, columns = ca.SX.sym("a", expression.numel()), [column for column, _ in variables]
    ends = np.cumsum([0, *(column.numel() for column in columns)]).tolist()
    of_t, of_k, of_y = ca.vertsplit(ca.densify(ca.jtimes(expression, ca.vertcat(*columns), weights, True)), ends)
    results = [(expression, "f"), (of_y, "of_y"), (of_k, "of_k"), (of_t, "of_t")]
    return c_function(f"{name}_adjoint", [*arguments, (weights, "a")], results)
