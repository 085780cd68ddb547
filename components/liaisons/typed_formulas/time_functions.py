"""Functions of time, ``1 + 0.1*sin(5*t)``, with their exact first and second derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import casadi as ca
import numpy as np

from liaisons.base.arguments import shown
from liaisons.errors import FormulaError
from liaisons.typed_formulas.formulas import FUNCTIONS, formula

_POINTS = 501
"""Number of points between which maxima are searched for."""
_MOST = 20
"""Largest number of maxima that are examined."""
TimeFunction = Callable[[float], tuple[float, float, float]]
"""A function of time [s]: value, rate, acceleration."""


def time_function(text: str) -> TimeFunction:
    """Function of time that a formula describes, with its first and second derivative.

    :param text: a formula of ``t`` [s].
    :raises FormulaError: if it is none; names the place, and the nearest name.
    """
    value = formula(text, {"t": _T}, {**FUNCTIONS, "abs": _absolute_value})
    rate = _time_derivative(value)
    function = ca.Function("input", [_T], [ca.densify(ca.vertcat(value, rate, _time_derivative(rate)))])
    buffer, run = cast("Any", function.buffer())  # called in place, at a twentieth of the cost
    time: Any = np.zeros(1)
    values: Any = np.zeros(3)
    buffer.set_arg(0, memoryview(time))
    buffer.set_res(0, memoryview(values))

    def evaluate(t: float) -> tuple[float, float, float]:
        """Value, rate and acceleration at an instant."""
        time[0] = t
        run()
        value, rate, acceleration = values.tolist()
        if buffer.ret() or not math.isfinite(value):
            raise FormulaError(f"{shown(text)} has no value there: {value}")
        return value, rate, acceleration

    return evaluate


def pulse_instants(text: str, start: float, stop: float) -> list[float]:
    """Instants [s] around short pulses of a formula, which are maxima of the argument of an ``exp``.

    :raises FormulaError: as :func:`time_function` does.
    """
    exponents: list[ca.SX] = []

    def exp(exponent: ca.SX) -> ca.SX:
        """Exponential of an expression, which is recorded."""
        exponents.append(exponent)
        return ca.exp(exponent)

    from scipy.optimize import brentq

    formula(text, {"t": _T}, {**FUNCTIONS, "abs": _absolute_value, "exp": exp})
    grid, instants = np.linspace(start, stop, _POINTS), list[float]()
    for exponent in exponents:
        rates = ca.Function("rates", [_T], [rate := _time_derivative(exponent), _time_derivative(rate)])
        slopes = rates.map(_POINTS)(grid)[0].full().ravel()
        for k in np.flatnonzero((slopes[:-1] > 0) & (slopes[1:] <= 0))[:_MOST]:
            maximum: Any = brentq(
                lambda t, rates=rates: float(rates(t)[0]), float(grid[k]), float(grid[k + 1]), xtol=1e-300
            )
            width = 1 / math.sqrt(max(-float(rates(maximum)[1]), 1e-300))
            if width < grid[1] - grid[0]:
                instants += (maximum + width * np.arange(-5, 6)).tolist()
    return instants


def _time_derivative(value: ca.SX) -> ca.SX:
    """Derivative of an expression by time."""
    return ca.jacobian(value, _T)


def _absolute_value(value: ca.SX) -> ca.SX:
    """Absolute value of an expression, whose rate where it is zero is the one to the right."""
    rate = _time_derivative(value)
    sign = ca.sign(rate) + (rate == 0) * ca.sign(_time_derivative(rate))
    return (ca.sign(value) + (value == 0) * sign) * value


_T = ca.SX.sym("t")
