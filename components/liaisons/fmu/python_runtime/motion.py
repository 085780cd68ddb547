"""Motion through one communication step [t, t + H]: input polynomials and CasADi's integrators.

Inside a step every input is a polynomial in τ = (t' − t)/H, by ``input_reconstruction``:

=================  ==========================================================================================
0 hold             σ, σ̇, σ̈ constant, each as given
1 extrapolate      Taylor polynomial of σ from the values at t; other inputs constant
2 interpolate      quintic Hermite polynomial of σ between the values at t and at t + H; other inputs linear
=================  ==========================================================================================
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable
from functools import lru_cache, reduce

import casadi as ca
import numpy as np

from .calls import Array, Call, view
from .table import Table, violation
from .vectors import Vectors

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)
TIGHTEST, LOOSEST = 1e-14, 1e-2  # tolerances are kept between these
_MOST_STEPS = 100_000

# Error of an internal step: this part of the importer's tolerance, so that hundreds of periods stay near it, and not
# less than rounding allows.
PART, LEAST = 0.02, 1e-14


class Events:
    """Instants at which a component is not smooth.

    :param events: (k,) → (times,), or (k, t) → (times,).
    :param k: parameters, an array that the caller shares.
    """

    def __init__(self, events: ca.Function, k: Array) -> None:
        self._t, self._instants = np.zeros(1), np.zeros(events.numel_out(0))
        self._call = Call(events, (k, self._t)[: events.n_in()], (self._instants,))
        self.any = bool(self._instants.size)

    def after(self, t: float) -> float:
        """The first one after t [s]; inf if there is none."""
        if not self.any:
            return math.inf
        self._t[0] = t
        self._call.run()
        return min((instant for instant in self._instants.tolist() if instant > t), default=math.inf)


class Step:
    """One communication step of one instance.

    :param mode: input_reconstruction.
    :param tolerance: of the importer.
    :param vectors: of the instance; inputs are given at t or (interpolate) at t + H.
    :ivar next: (t, y, u) at the end, of which :meth:`advance` sets y and u.
    """

    def __init__(self, table: Table, mode: int, tolerance: float, vectors: Vectors) -> None:
        self.mode, self.tolerance = mode, tolerance
        self._table, self._vectors = table, vectors
        v, states = vectors, vectors.y.size
        end = np.zeros(v.now.size)
        self.next = view(end)
        _, self._y_next, self._u_next = np.split(end, [1, 1 + states])
        self._tau = np.ones(1)
        inputs, coefficients = _reconstruction(table, mode)
        self._inputs = Call(inputs, (self._tau, v.H, v.u, v.given), (self._u_next,))
        if not states:
            return
        largest = max(PART * tolerance, LEAST)
        short, long = _integrators(table, mode, largest)
        error = np.ones(1)
        self._error, self._largest_error = view(error), largest**2
        self._short = Call(short, (v.t, v.H, v.y, v.u, v.given, v.k, v.size), (self._y_next, self._u_next, error))
        p, self._x, self._x_next = np.zeros(long.numel_in("p")), np.zeros(states), np.zeros(states)
        span, c, self._p_k, self._p_size = np.split(p, np.cumsum([6, coefficients.numel_out(0), v.k.size]))
        self._span = view(span)
        self._coefficients = Call(coefficients, (v.H, v.u, v.given), (c,))
        self._long = Call(long, (self._x, np.zeros(0), p), (self._x_next,))
        self._events = Events(table.functions["events"], v.k)

    def advance(self) -> str:
        """Compute y and u at t + H; returns what made that fail, and when, or an empty text."""
        if not self._vectors.size.size:
            self._inputs.run()
            return ""
        self._short.run()
        smooth = not self._events.any
        done = (smooth and self._error[0] <= self._largest_error) or self._integrate(1.0)
        return "" if done else self._obstacle()

    def _integrate(self, fraction: float) -> bool:
        """Integrate over a fraction of the step, from event to event, with error control."""
        v = self._vectors
        t, H = float(v.t[0]), float(v.H[0])
        events = [self._events.after(t)]
        while events[-1] <= t + fraction * H:
            events.append(self._events.after(events[-1]))
        self._coefficients.run()
        self._p_k[:], self._p_size[:], self._x[:] = v.k, v.size, v.y / v.size
        begin, earliest = 0.0, t
        for instant in events:
            end = min(instant - t, fraction * H)
            span = (t, H, begin, end - begin, earliest, math.nextafter(instant, t))
            self._span[:] = array("d", span)
            self._long.run()
            if not self._long.succeeded:
                return False
            begin, earliest, self._x[:] = end, instant, self._x_next
        self._y_next[:] = self._x * v.size
        return bool(np.isfinite(self._y_next).all())

    def _obstacle(self) -> str:
        """Why :meth:`_integrate` fails, and when."""
        t, H = self._vectors.t[0], self._vectors.H[0]
        for fraction in np.linspace(0.0, 1.0, 1025):
            self._tau[0] = fraction
            self._inputs.run()
            if problem := violation(self._table.inputs, self._u_next, t + fraction * H):
                return problem
        if self._long.internal_steps >= _MOST_STEPS:
            return f"more than {_MOST_STEPS} internal steps are needed: choose a smaller step"
        return self._singularity()

    def _singularity(self) -> str:
        """Where the motion ends, by bisection, and the condition that is about to fail there."""
        v = self._vectors
        reached, failed, y = 0.0, 1.0, v.y.copy()
        for _ in range(20):
            middle = (reached + failed) / 2
            if self._integrate(middle):
                reached, y = middle, self._y_next.copy()
            else:
                failed = middle
        self._tau[0] = reached
        self._inputs.run()
        t = v.t[0] + reached * v.H[0]
        # Conditions are distances from a singularity, of order 1 elsewhere.
        condition = self._table.failed_condition(t, y, self._u_next, v.k, 1e-3)
        return condition or f"no step from t = {t:.9g} is small enough for the tolerance {self.tolerance:g}"


@lru_cache(maxsize=64)
def _reconstruction(table: Table, mode: int) -> tuple[ca.Function, ca.Function]:
    """Inputs inside a step, (τ, H, u at t, given) → (u,), and the coefficients of their polynomials."""
    tau, H = ca.SX.sym("tau"), ca.SX.sym("H")
    u_0, u_1 = (ca.SX.sym(name, len(table.inputs)) for name in ("u_0", "u_1"))
    rows = _polynomials(table, mode, H, u_0, u_1)
    # At τ = 1 the polynomials have rounding errors.
    u = ca.if_else(tau == 1, u_1, _evaluate(rows, tau)) if mode == INTERPOLATE else _evaluate(rows, tau)
    return (
        ca.Function("inputs", [tau, H, u_0, u_1], [u]),
        ca.Function("coefficients", [H, u_0, u_1], [ca.densify(_column(c for row in rows for c in row))]),
    )


@lru_cache(maxsize=64)
def _integrators(table: Table, mode: int, tolerance: float) -> tuple[ca.Function, ca.Function]:
    """CasADi's integrators over one step.

    ``short`` (t, H, y, u_0, u_1, k, n) → (y, u, squared error / (n + abs(y))²) is the classical Runge-Kutta method
    over one element and over two: their difference is the error, of order 5, and is taken off the better one.
    ``long`` (y/n, z, (t, H, begin, width, earliest, latest, c, k, n)) → (y/n,) is the adaptive pair of order 5(4)
    from t + begin on; time is kept between the earliest and the latest, that is on one side of an event.  A call of
    it costs several times as much, so it does what ``short`` cannot.
    """
    f, conditions = table.functions["derivatives"], table.functions["conditions"]
    y, u_0, u_1, k = (ca.SX.sym(name, f.size1_in(i)) for name, i in (("y", 1), ("u_0", 2), ("u_1", 2), ("k", 3)))
    n, x = ca.SX.sym("n", y.numel()), ca.SX.sym("x", y.numel())
    t, H, tau = (ca.SX.sym(name) for name in ("t", "H", "tau"))
    inputs, coefficients = _reconstruction(table, mode)
    c = ca.SX.sym("c", coefficients.numel_out(0))
    rows = _split(c, _polynomials(table, mode, H, u_0, u_1))

    def derivatives(time: ca.SX, tau: ca.SX, y: ca.SX) -> ca.SX:
        """dy/dt; NaN where an input or a condition is out of bounds, which the integrators take as a failure."""
        u = _evaluate(rows, tau)
        valid = ca.vertsplit(conditions(time, y, u, k)[: table.lasting, 0] > 0)
        for entry, value in zip(table.inputs, ca.vertsplit(u), strict=True):
            valid += [margin > 0 if entry.strict else margin >= 0 for margin in entry.margins(value)]
        trap = ca.if_else(reduce(ca.logic_and, valid), 0, math.nan) if valid else 0
        return f(time, y, u, k) + trap

    def runge_kutta(elements: int) -> ca.SX:
        rates = H * derivatives(t + tau * H, tau, y)
        problem = {"x": y, "t": tau, "p": ca.vertcat(t, H, c, k), "ode": rates}
        options = {"number_of_finite_elements": elements, "simplify": True}
        p = ca.vertcat(t, H, coefficients(H, u_0, u_1), k)
        return ca.integrator("short", "rk", problem, 0, 1, options)(x0=y, p=p)["xf"]

    coarse, fine = runge_kutta(1), runge_kutta(2)
    error = (fine - coarse) / 15
    results = [fine + error, inputs(1, H, u_0, u_1), ca.sumsqr(error / (n + ca.fabs(fine)))]

    begin, width, earliest, latest, s = (ca.SX.sym(name) for name in ("begin", "width", "earliest", "latest", "s"))
    elapsed = begin + s * width
    time = ca.fmax(earliest, ca.fmin(latest, t + elapsed))
    problem = {
        "x": x,
        "t": s,
        "p": ca.vertcat(t, H, begin, width, earliest, latest, c, k, n),
        "ode": width * derivatives(time, elapsed / H, n * x) / n,
    }
    options = {
        "abstol": tolerance,
        "reltol": tolerance,
        "step0": 1.0,  # try the whole step first: estimating the first step costs as much as rejecting it
        "max_num_steps": _MOST_STEPS,
        "show_eval_warnings": False,
    }
    return (
        ca.Function("short", [t, H, y, u_0, u_1, k, n], ca.cse(results)),
        ca.integrator("long", "erk", problem, 0, 1, options),
    )


def _polynomials(table: Table, mode: int, H: ca.SX, u_0: ca.SX, u_1: ca.SX) -> list[list[ca.SX]]:
    """Coefficients in τ of every input, lowest first."""
    start, end = ca.vertsplit(u_0), ca.vertsplit(u_1)
    rows = [[a, b - a] if mode == INTERPOLATE else [a] for a, b in zip(start, end, strict=True)]
    for s, s_dot, s_ddot in table.active if mode != HOLD else ():
        row = [start[s], H * start[s_dot], H**2 * start[s_ddot] / 2]
        if mode == INTERPOLATE:
            # What the parabola from t misses at t + H: value, rate, acceleration.
            a = end[s] - sum(row)
            b = H * end[s_dot] - row[1] - 2 * row[2]
            c = H**2 * end[s_ddot] - 2 * row[2]
            row += [10 * a - 4 * b + c / 2, -15 * a + 7 * b - c, 6 * a - 3 * b + c / 2]
        rows[s] = row
        rows[s_dot] = _derivative(row, H)
        rows[s_ddot] = _derivative(rows[s_dot], H)
    return rows


def _derivative(row: list[ca.SX], H: ca.SX) -> list[ca.SX]:
    """Coefficients of the derivative with respect to t' = t + τ H."""
    return [i * coefficient / H for i, coefficient in enumerate(row)][1:]


def _split(c: ca.SX, rows: list[list[ca.SX]]) -> list[list[ca.SX]]:
    """The entries of c in the pattern of the rows."""
    entries = iter(ca.vertsplit(c))
    return [[next(entries) for _ in row] for row in rows]


def _evaluate(rows: list[list[ca.SX]], tau: ca.SX) -> ca.SX:
    """All polynomials at τ."""
    return _column(reduce(lambda value, coefficient: value * tau + coefficient, reversed(row)) for row in rows)


def _column(expressions: Iterable[ca.SX]) -> ca.SX:
    rows = list(expressions)
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)
