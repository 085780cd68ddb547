"""CasADi functions by which a Python FMU steps, made when it is written: its runtime holds no symbols.

The method is the explicit Runge-Kutta pair of Dormand and Prince of order 5(4), with SciPy's tableau.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import reduce

import casadi as ca
from scipy.integrate import RK45

from liaisons.fmu.dependencies import coupled
from liaisons.language import Variable
from liaisons.mechanics.model import Model

DEGREE = 5
"""Degree of the polynomials in τ = (t' - t)/H that inputs are within a step."""

_LARGEST = 1.7976931348623157e308

# Coefficients of τ³, τ⁴ and τ⁵ by what the Taylor polynomial misses at τ = 1: value, rate, acceleration.
_QUINTIC = ca.DM([[10, -15, 6], [-4, 7, -3], [0.5, -1, 0.5]])


def bounds(variable: Variable) -> tuple[float, float]:
    """Least and largest allowed number; an excluded bound is replaced by its neighbour."""
    low = -_LARGEST if variable.minimum is None else variable.minimum
    high = _LARGEST if variable.maximum is None else variable.maximum
    return (math.nextafter(low, math.inf), math.nextafter(high, -math.inf)) if variable.strict else (low, high)


def step_functions(model: Model, active: list[list[int]]) -> dict[str, ca.Function]:
    """Functions of a communication step of size H, by name.

    * ``polynomials`` (mode, H, u at the start, u at the end) → (coefficients in τ,), columns of all inputs
    * ``inputs``      (τ, coefficients) → (u,)
    * ``advance``     (elapsed, h, y, n, (t, H, earliest, latest), coefficients, k) → (y, error), a step of the method
    * ``jump_along``  (part, h, y, n, t, all of y, u, k, jump, start of the jump) → (y, error), the same in a jump

    :param model: without arrays.
    :param active: for each active coordinate the indices of σ, σ̇, σ̈ among the inputs.
    """
    coefficients, tau = ca.SX.sym("coefficients", len(model.inputs) * (DEGREE + 1)), ca.SX.sym("tau")
    u = reduce(lambda value, column: value * tau + column, reversed(_columns(coefficients)))
    inputs = ca.Function("inputs", [tau, coefficients], [u])
    functions = {"polynomials": _polynomials(len(model.inputs), active), "inputs": inputs}
    if model.states:
        functions["advance"] = _runge_kutta(_rates(model, inputs))
    if model.states and active:
        functions["jump_along"] = _runge_kutta(_rates_of_jump(model, active))
    return functions


def _columns(coefficients: ca.SX) -> list[ca.SX]:
    """Coefficients of all inputs, for each power of τ."""
    return ca.horzsplit(ca.reshape(coefficients, -1, DEGREE + 1))


def _polynomials(count: int, active: list[list[int]]) -> ca.Function:
    """Polynomials of the inputs in each mode; see ``python_runtime.motion``."""
    mode, H, start, end = (ca.SX.sym(name, size) for name, size in (("m", 1), ("H", 1), ("u_0", count), ("u_1", count)))
    interpolates = mode == 2
    change = ca.if_else(interpolates, end - start, ca.SX(count, 1))
    rows = ca.horzcat(start, change, ca.SX(count, DEGREE - 1))
    for indices in active:
        value, rate, acceleration = ca.vertsplit(start[indices])
        taylor = ca.horzcat(value, H * rate, H**2 * acceleration / 2)
        reached = ca.horzcat(ca.sum2(taylor), taylor[1] + 2 * taylor[2], 2 * taylor[2])
        missed = end[indices].T * ca.horzcat(1, H, H**2) - reached
        row = ca.horzcat(taylor, ca.if_else(interpolates, missed @ _QUINTIC, ca.SX(1, 3)))
        for index in indices:
            rows[index, :] = ca.if_else(mode == 0, rows[index, :], row)
            row = ca.horzcat(row[1:] * ca.DM(range(1, DEGREE + 1)).T / H, 0)
    return ca.Function("polynomials", [mode, H, start, end], [ca.densify(ca.vec(rows))], {"cse": True})


def _rates(model: Model, inputs: ca.Function) -> ca.Function:
    """(elapsed, y, (t, H, earliest, latest), coefficients, k) → (dy/dt,); NaN where a domain is left.

    Time is kept between the earliest and the latest, that is on one side of an event.
    """
    elapsed, y, span = ca.SX.sym("elapsed"), model.derivatives.sx_in(1), ca.SX.sym("span", 4)
    coefficients, k = inputs.sx_in(1), model.derivatives.sx_in(3)
    t, H, earliest, latest = ca.vertsplit(span)
    now = ca.fmax(earliest, ca.fmin(latest, t + elapsed))
    u = inputs(elapsed / H, coefficients)
    lasting = len(model.condition_texts) - model.start_only
    low, high = (ca.DM(side) for side in zip(*map(bounds, model.inputs), strict=True)) if model.inputs else (u, u)
    allowed = [model.conditions(now, y, u, k)[:lasting] > 0, u >= low, u <= high]
    rates = model.derivatives(now, y, u, k) + ca.if_else(_all(allowed), 0, math.nan)
    return ca.Function("rates", [elapsed, y, span, coefficients, k], [ca.densify(rates)], {"cse": True})


def _all(conditions: Iterable[ca.SX]) -> ca.SX:
    return reduce(ca.logic_and, ca.vertsplit(ca.vertcat(*conditions)), ca.SX(1))


def _rates_of_jump(model: Model, active: list[list[int]]) -> ca.Function:
    """(part, y, t, all of y, u, k, jump, start of the jump) → (dy/dpart,) of the states that act on the motion.

    In a fictitious time of length 1 the jump is added to the rate of σ; see ``fmu.jumps``.
    """
    t, whole, u, k = model.derivatives.sx_in()
    part, y = ca.SX.sym("part"), ca.SX.sym("y", coupled(model))
    jump, begin = ca.SX.sym("jump", len(active)), ca.SX.sym("begin", len(active))
    resting = ca.SX(u)
    for i, (value, _, _) in enumerate(active):
        resting[value] = ca.if_else(jump[i] == 0, u[value], begin[i] + part * jump[i])
    jumping = ca.SX(resting)
    jumping[[rate for _, rate, _ in active]] += jump
    state = ca.vertcat(y, whole[y.numel() :])
    change = model.derivatives(t, state, jumping, k) - model.derivatives(t, state, resting, k)
    rates = ca.densify(change[: y.numel()])
    return ca.Function("rates", [part, y, t, whole, u, k, jump, begin], [rates], {"cse": True})


def _runge_kutta(rates: ca.Function) -> ca.Function:
    """(s, h, x, n, *others) → (x at s + h, its error relative to n + abs(x)).

    :param rates: (s, x, *others) → (dx/ds,).
    """
    s, x, *others = rates.mx_in()
    h, n = ca.MX.sym("h"), ca.MX.sym("n", x.numel())
    slopes, end = rates(s, x, *others), x
    for part, row in zip([*RK45.C[1:], 1], [*RK45.A[1:], RK45.B], strict=True):
        end = x + h * ca.mtimes(slopes, ca.DM(row[: slopes.shape[1]]))
        slopes = ca.horzcat(slopes, rates(s + part * h, end, *others))
    error = h * ca.mtimes(slopes, ca.DM(RK45.E))
    return ca.Function("step", [s, h, x, n, *others], [end, ca.norm_2(error / (n + ca.fabs(end)))])
