"""Steps of one motion in C, with their derivatives: along directions, and backwards.

What a derivative along a direction needs of the motion is calculated once a stage; what remains, linear in the
directions, is a loop over :data:`DIRECTIONS` of them.
"""

from __future__ import annotations

import ctypes
from typing import Any, Literal, final

import casadi as ca
import numpy as np

from liaisons.derivatives.steps import METHOD, Floats, Integers, Segment, Steps
from liaisons.ensembles.kernel import (
    argument_columns,
    c_function,
    combine_code,
    head_code,
    move_code,
    step_code,
)
from liaisons.ensembles.right_hand_sides import RightHandSide
from liaisons.ensembles.steps import call, library, packs, unpacked
from liaisons.errors import SimulationError
from liaisons.expressions.algebra import stack

Purpose = Literal["run", "tangents", "adjoint"]

DIRECTIONS = 8
_OPTIONS: dict[Purpose, tuple[str, ...]] = {"run": ("-fno-tree-vectorize",), "tangents": (), "adjoint": ()}
"""Of the compiler: a single motion waits for vectors that have been written number by number."""
_STEPS = 2_000_000
"""Steps of one motion from which on it is refused."""

_GRAZING = 1e-12
"""Distance of an event indicator from 0 at which it is said to graze."""

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
            double whole[N], halves[N];
            memcpy(whole, y, sizeof whole);
            memcpy(halves, y, sizeof halves);
            step(t, h, limits, k, s, whole, kept);
            step(t, 0.5 * h, limits, k, s, halves, kept);
            step(t + 0.5 * h, 0.5 * h, limits, k, s, halves, kept);
            const double error = step_error(whole, halves, sizes), factor = size_factor(error, tolerance);
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
_FOLLOW = """\
enum { SAMPLES = 8, CORRECTIONS = 8 };

/* Indicators at a fraction of a step, by its quintic Hermite polynomial through start, middle and end. */
static void look(double t, double h, double part, const double *limits, const double *k, const double *s,
                 const double *y, const double *f, double *values)
{
    const double x = part, p = x * x, q = (1 - x) * (1 - x), m = 2 * x - 1;
    const double at_0 = q * m * m * (1 + 6 * x), at_1 = 16 * p * q, at_2 = p * m * m * (7 - 6 * x);
    const double by_0 = x * q * m * m, by_1 = 8 * p * q * m, by_2 = p * m * m * (x - 1);
    double at[N], time = clipped(t + part * h, limits);
    for (int j = 0; j < N; ++j)
        at[j] = at_0 * y[j] + at_1 * y[N + j] + at_2 * y[2 * N + j]
                + h * (by_0 * f[j] + by_1 * f[N + j] + by_2 * f[2 * N + j]);
    watch(&time, k, s, at, values);
}

/* Value of an indicator at an event of a step from y: its margin, or 0 where it begins below. */
static double row_target(double t, const double *k, const double *s, const double *limits, const double *y, int which,
                         const double *margins)
{
    double values[I], time = clipped(t, limits);
    watch(&time, k, s, y, values);
    return values[which] > margins[which] ? margins[which] : 0.0;
}

/* First fraction of a step at which an indicator falls to 0, and which; 2 if there is none.  Where one comes nearer to
 * 0 than `near`, and does not fall below, *graze is the fraction. */
static double first_event(double t, double h, const double *limits, const double *k, const double *s, const double *y,
                          const double *f, const double *margins, double near, int *which, double *slope,
                          double *graze)
{
    double values[I], row[SAMPLES + 1][I], first = 2.0;
    for (int n = 0; n <= SAMPLES; ++n)
        look(t, h, n / (double)SAMPLES, limits, k, s, y, f, row[n]);
    for (int i = 0; i < I; ++i)
        row[0][i] = fmax(row[0][i], 0.0);
    for (int n = 0; n < SAMPLES && first > 1.0; ++n)
        for (int i = 0; i < I; ++i) {
            double a = n / (double)SAMPLES, b = (n + 1) / (double)SAMPLES, at_a = row[n][i], at_b = row[n + 1][i];
            if (at_b >= 0 && n + 2 <= SAMPLES && at_a > near && at_b < at_a
                && at_b <= row[n + 2][i] && row[n + 2][i] > near) { /* it turns between */
                double low = a, high = b + 1.0 / SAMPLES;
                for (int m = 0; m < 60 && at_b >= 0; ++m) {
                    const double left = low + 0.382 * (high - low), right = low + 0.618 * (high - low);
                    double at_left;
                    look(t, h, left, limits, k, s, y, f, values);
                    at_left = values[i];
                    look(t, h, right, limits, k, s, y, f, values);
                    b = at_left < values[i] ? left : right;
                    at_b = fmin(at_left, values[i]);
                    if (at_left < values[i])
                        high = right;
                    else
                        low = left;
                    if (at_b > fmax(1e-3 * at_a, near) && high - low < 0.01)
                        break;
                }
                if (at_b >= 0 && at_b < near)
                    *graze = t + b * h;
            }
            if (!(at_b < 0))
                continue;
            const double target = at_a > margins[i] ? margins[i] : 0.0;
            double left = at_a - target, right = at_b - target;
            for (int m = 0; m < 60 && b - a > 1e-14; ++m) { /* regula falsi, Illinois */
                const double part = fmax(a + (b - a) * left / (left - right), a + 1e-15 * b);
                look(t, h, part, limits, k, s, y, f, values);
                if (values[i] - target <= 0) {
                    b = part;
                    right = values[i] - target;
                    left /= 2;
                } else {
                    a = part;
                    left = values[i] - target;
                    right /= 2;
                }
                if (fabs(values[i] - target) < 1e-3 * margins[i])
                    break;
            }
            if (b < first) {
                double high[I];
                first = b;
                *which = i;
                look(t, h, b - 1e-3, limits, k, s, y, f, high);
                look(t, h, b + 1e-3, limits, k, s, y, f, values);
                *slope = (values[i] - high[i]) / (2e-3 * h);
            }
        }
    return first;
}

/* As choose, up to the first event; report: indicator, interval, distance from 0, an instant of grazing. */
long follow(long intervals, const double *cuts, const long *rows, const double *limits, const double *k,
            const double *table, double tolerance, const double *sizes, double *size, double *y, double *kept,
            long most, double *ends, long *counts, const double *margins, double near, double *report)
{
    long count = 0;
    report[0] = -1.0;
    report[3] = NAN;
    for (long m = 0; m < intervals; counts[m++] = count) {
        const double *s = table + rows[m] * R;
        double t = cuts[m], end = cuts[m + 1];
        report[1] = (double)m;
        do {
            const int last = *size >= 0.999999 * (end - t);
            double h = last ? end - t : fmin(*size, 0.5 * (end - t)), time;
            double whole[N], path[3 * N], f[3 * N], slope = 0.0, *halves = path + 2 * N;
            memcpy(whole, y, sizeof whole);
            memcpy(path, y, sizeof whole);
            memcpy(halves, y, sizeof whole);
            step(t, h, limits, k, s, whole, kept);
            step(t, 0.5 * h, limits, k, s, halves, kept);
            memcpy(path + N, halves, sizeof whole);
            step(t + 0.5 * h, 0.5 * h, limits, k, s, halves, kept);
            const double error = step_error(whole, halves, sizes), factor = size_factor(error, tolerance);
            if (!(error <= tolerance)) {
                *size = h * fmax(factor, 0.1);
                if (t + 1e-3 * *size == t)
                    return -1 - count;
                continue;
            }
            if (count == most)
                return most + 1;
            for (int n = 0; n < 3; ++n) {
                time = clipped(t + 0.5 * n * h, limits);
                rates(&time, k, s, path + n * N, f + n * N);
            }
            int which = -1;
            const double part = first_event(t, h, limits, k, s, path, f, margins, near, &which, &slope, &report[3]);
            if (part <= 1.0) {
                double values[I], best = part * h, least = INFINITY, now = best, earlier = 0.0, off_earlier = 0.0;
                for (int n = 0; n < CORRECTIONS; ++n) {
                    double target, off;
                    memcpy(whole, y, sizeof whole);
                    step(t, now, limits, k, s, whole, kept);
                    time = clipped(t + now, limits);
                    watch(&time, k, s, whole, values);
                    target = row_target(t, k, s, limits, y, which, margins);
                    off = values[which] - target;
                    if (n > 0 && (off - off_earlier) / (now - earlier) < 0)
                        slope = (off - off_earlier) / (now - earlier);
                    earlier = now;
                    off_earlier = off;
                    if (fabs(off) < least) {
                        least = fabs(off);
                        best = now;
                    }
                    if (!(slope < 0) || fabs(off) <= 1e-3 * margins[which])
                        break;
                    now = fmin(fmax(now - off / slope, 0.5 * now), h);
                }
                memcpy(whole, y, sizeof whole);
                step(t, best, limits, k, s, whole, kept);
                memcpy(y, whole, sizeof whole);
                ends[count++] = fmin(t + best, end);
                counts[m] = count;
                report[0] = which;
                report[2] = least;
                return count;
            }
            *size = fmax(last ? *size : 0.0, h * fmin(factor, 4.0));
            t = ends[count++] = last ? end : t + h;
            memcpy(y, whole, sizeof whole);
        } while (t < end);
    }
    return count;
}

"""
_TANGENTS = """\
void tangents(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
              const double *table, const double *kept, long blocks, const double *dk, const double *dt,
              const double *dh, long moving, double *dy, const long *record, double *records, double *df)
{
    double f[S * N], slope[N], at[N], w[W], along[N * D], time_along[D];
    for (long n = 0; n < steps; ++n) {
        const double *s = table + rows[n] * R;
        for (int stage = 0; stage <= S; ++stage) {
            const double time = clipped(t[n] + C[stage] * h[n], limits), *y = kept + (n * (S + 1) + stage) * N;
            combine(stage, N, f, slope);
            if (stage < S)
                rates_early(&time, k, s, y, f + stage * N, w);
            else
                project_early(&time, k, s, y, at, w);
            for (long b = 0; b < blocks; ++b) {
                const double *t_b = dt + (n * moving + b) * D, *h_b = dh + (n * moving + b) * D, *k_b = dk + b * K * D;
                double *y_b = dy + b * N * D, *f_b = df + b * S * N * D;
                move(stage, N * D, f_b, h[n], y_b, along);
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
        if (record[n] >= 0)
            memcpy(records + record[n] * blocks * N * D, dy, blocks * N * D * sizeof *dy);
    }
}
"""
_ADJOINT = """\
void adjoint(long steps, const double *t, const double *h, const long *rows, const double *limits, const double *k,
             const double *table, const double *kept, const long *record, const double *weights, double *lambda,
             double *of_k, double *of_t, double *of_h)
{
    double f[N], g[N], scaled[N], total[N], part_k[K + 1], part_t;
    double of_y[(S + 1) * N]; /* by y after the step, and at each stage */
    for (long n = steps - 1; n >= 0; --n) {
        const double *s = table + rows[n] * R, *y = kept + n * (S + 1) * N;
        double time = clipped(t[n] + h[n], limits);
        if (record[n] >= 0)
            for (int j = 0; j < N; ++j)
                lambda[j] += weights[record[n] * N + j];
        project_adjoint(&time, k, s, y + S * N, lambda, f, total, part_k, &part_t);
        memcpy(of_y, total, sizeof total);
        of_t[n] = of_h[n] = part_t;
        for (int i = 0; i < K; ++i)
            of_k[i] += part_k[i];
        for (int stage = S - 1; stage >= 0; --stage) {
            combine(stage, N, of_y, g);
            for (int j = 0; j < N; ++j)
                scaled[j] = h[n] * g[j];
            time = clipped(t[n] + C[stage] * h[n], limits);
            rates_adjoint(&time, k, s, y + stage * N, scaled, f, of_y + (stage + 1) * N, part_k, &part_t);
            of_t[n] += part_t;
            of_h[n] += C[stage] * part_t;
            for (int i = 0; i < K; ++i)
                of_k[i] += part_k[i];
            for (int j = 0; j < N; ++j) {
                of_h[n] += f[j] * g[j];
                total[j] += of_y[(stage + 1) * N + j];
            }
        }
        memcpy(lambda, total, sizeof total);
    }
}
"""


@final
class CompiledSteps:
    """C functions that take the steps of a motion, each compiled before its first call."""

    def __init__(self, equations: RightHandSide) -> None:
        """Take the equations of the motion."""
        self._equations = equations
        self._libraries: dict[Purpose, ctypes.CDLL] = {}

    def _call(self, purpose: Purpose, name: str, *arguments: Any) -> int:
        """Call a C function, whose library is compiled before the first call."""
        if purpose not in self._libraries:
            self._libraries[purpose] = library(source(self._equations, purpose), *_OPTIONS[purpose])
        return call(self._libraries[purpose], name, *arguments)

    def choose(
        self, segment: Segment, k: Floats, y: Floats, size: Floats, *, tolerance: float, sizes: Floats
    ) -> tuple[Floats, Integers]:
        """Ends of steps that keep to a tolerance, and their number up to the end of each interval.

        :param y: at the start; then where they end.
        :param size: of the first step; then of the next one.
        :returns: counts are empty where no step is small enough.
        """
        return self._chosen("choose", segment, k, y, size, [float(tolerance), sizes], [])

    def follow(
        self, segment: Segment, k: Floats, y: Floats, size: Floats, *, tolerance: float, sizes: Floats, margins: Floats
    ) -> tuple[Floats, Integers, Floats]:
        """As :meth:`choose`, up to the first event of contacts.

        :param margins: of the event indicators.
        :returns: also the indicator that is 0 or -1, the interval in which the steps end, the distance of the
            indicator from 0, and an instant at which one comes near to 0, or not-a-number.
        """
        report = np.empty(4)
        control = [float(tolerance), sizes]
        return *self._chosen("follow", segment, k, y, size, control, [margins, _GRAZING, report]), report

    def _chosen(  # noqa: PLR0917
        self, name: str, segment: Segment, k: Floats, y: Floats, size: Floats, control: list[Any], more: list[Any]
    ) -> tuple[Floats, Integers]:
        """Ends of steps that a function chooses."""
        intervals = len(segment.rows)
        most, counts, stages = 4 * intervals + 1000, np.empty(intervals, dtype=np.int_), _stage_room(1, y)
        while True:
            state, first, ends = y.copy(), size.copy(), np.empty(most)
            motion = [intervals, segment.instants, segment.rows, segment.limits, k, segment.table]
            chosen = [first, state, stages, most, ends, counts]
            done = self._call("run", name, *motion, *control, *chosen, *more)
            if done <= most:
                y[:], size[:] = state, first
                return ends[: done if done >= 0 else -1 - done], counts if done >= 0 else counts[:0]
            if most > _STEPS:
                raise SimulationError(
                    f"more than {most} steps until t = {ends[-1]:g} s; stop earlier, or take a larger tolerance"
                )
            most *= 4

    def advance(self, steps: Steps, k: Floats, y: Floats, *, keep: bool = False) -> tuple[Floats, Floats]:
        """States at the ends of steps, (steps, states), and, if they are kept, those of their stages."""
        states, stages = np.empty((len(steps.t), len(y))), _stage_room(len(steps.t) if keep else 1, y)
        stride = stages[0].size if keep else 0
        self._call("run", "advance", *steps.arguments(k), y.copy(), states, stages, stride)
        return states, stages

    def tangents(self, steps: Steps, k: Floats, stages: Floats, of_k: Floats, of_y: Floats) -> tuple[Floats, Floats]:
        """Derivatives along directions at recorded ends, (records, states, directions), and at the last end.

        :param of_k: derivatives of the values, (values, directions); of_y: of the first state.
        """
        states, count = of_y.shape
        dk, dy = packs(of_k, DIRECTIONS), packs(of_y, DIRECTIONS)
        dt, dh = (np.ascontiguousarray(packs(rows, DIRECTIONS).swapaxes(0, 1)) for rows in (steps.of_t, steps.of_h))
        blocks, is_recorded = len(dy), steps.records >= 0
        record = np.where(is_recorded, np.cumsum(is_recorded) - 1, -1)
        records = np.empty((int(is_recorded.sum()), blocks, states, DIRECTIONS))
        work = np.empty((blocks, METHOD.stages, states, DIRECTIONS))
        seeds = [blocks, dk, dt, dh, blocks if len(dt) == len(steps.t) else 0, dy]
        self._call("tangents", "tangents", *steps.arguments(k), stages, *seeds, record, records, work)
        return unpacked(records, count), unpacked(dy, count)

    def adjoint(
        self, steps: Steps, k: Floats, stages: Floats, weights: Floats, of_y: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Derivatives of a sum by the values, by starts and by sizes of steps.

        :param weights: derivatives by the states at all recorded times, (times, states).
        :param of_y: derivatives by the last state; then by the first one.
        """
        of_k, of_t, of_h = np.zeros(len(k)), np.empty(len(steps.t)), np.empty(len(steps.t))
        sums = [weights, of_y, of_k, of_t, of_h]
        self._call("adjoint", "adjoint", *steps.arguments(k), stages, steps.records, *sums)
        return of_k, of_t, of_h


def _stage_room(steps: int, y: Floats) -> Floats:
    """Memory for the states of the stages of steps, and before the projection at their ends."""
    return np.empty((steps, METHOD.stages + 1, len(y)))


def source(equations: RightHandSide, purpose: Purpose) -> str:
    """C99 code of steps, or of their derivatives."""
    if purpose == "run":
        return step_code(equations, METHOD, 1, keeps=True) + _RUN + _event_code(equations)
    t, k, s, y = equations.symbols
    point, variables = argument_columns(equations, star=""), ca.vertcat(t, k, y)
    lines, numbers = list[str](), 1
    for name, value in (("rates", equations.rates), ("project", equations.projected)):
        if purpose == "tangents":
            seeds = [(ca.SX.sym("d", column.numel()), f"*d{array}") for column, array in (*point[:2], point[3])]
            late = ca.densify(ca.jtimes(value, variables, ca.vertcat(*(column for column, _ in seeds))))
            late, symbols, early = ca.extract_parametric(late, ca.vertcat(t, k, s, y))
            numbers = max(numbers, len(early))
            lines += c_function(f"{name}_early", point, [(value, "f"), (stack(early), "w")])
            lines += c_function(f"{name}_late", [*point, (stack(symbols), "w"), *seeds], [(late, "*df")])
        else:
            a, ends = ca.SX.sym("a", y.numel()), np.cumsum([0, 1, k.numel(), y.numel()]).tolist()
            of_t, of_k, of_y = ca.vertsplit(ca.densify(ca.jtimes(value, variables, a, True)), ends)
            backwards = [(value, "f"), (of_y, "of_y"), (of_k, "of_k"), (of_t, "of_t")]
            lines += c_function(f"{name}_adjoint", [*point, (a, "a")], backwards)
    if purpose == "tangents":
        lines += [*move_code(METHOD), *combine_code(METHOD.rows), f"enum {{ W = {numbers} }};"]
        return head_code(equations, METHOD, DIRECTIONS) + "\n".join(lines) + _TANGENTS
    lines += combine_code(METHOD.adjoint_rows)
    return head_code(equations, METHOD, 1) + "\n".join(lines) + _ADJOINT


def _event_code(equations: RightHandSide) -> str:
    """C99 code of steps up to an event; empty where there are no contacts."""
    if equations.contacts is None:
        return ""
    indicators = equations.contacts.indicators
    lines = c_function("watch", argument_columns(equations, star=""), [(indicators, "i")])
    return "\n".join([*lines, f"enum {{ I = {indicators.numel()} }};\n"]) + _FOLLOW
