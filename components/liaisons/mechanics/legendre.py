"""Legendre's transformation: rates from momenta, by Newton's method where L is not quadratic in the rates.

Solved is ∂L/∂v = p (M eq. 10) with the Hessian A = ∂²L/∂v∂v, from v = 0 on.  Where L is convex in the rates,
φ = L − p·v is least at the solution; the length of the first steps makes φ small, so that rates stay where L exists.
"""

import casadi as ca

from liaisons.algebra import at_zero, gradient, hessian, solve_symmetric

CHOSEN = 8
"""Newton steps whose length is chosen.

With these numbers a point mass in special relativity converges for Lorentz factors up to 100."""
FULL = 4
"""Number of full steps that follow, each of which doubles the digits."""
HALVINGS = 8
"""How often the length of a step is halved, at most."""

CONVERGED = 1e-10
"""Part of the terms of a momentum that may be missing after the last step: rounding, by the square of such a factor."""


def rates_from_momenta(lagrangian: ca.SX, rates: ca.SX, momenta: ca.SX) -> ca.SX:
    """Rates with these momenta, the solution v of ∂L/∂v = p (f,); not-a-number or far off if Newton's method fails."""
    metric = hessian(lagrangian, rates)
    if not ca.depends_on(metric, rates):
        return solve_symmetric(metric, momenta - at_zero(gradient(lagrangian, rates), rates))
    function, slope = lagrangian - ca.dot(momenta, rates), momenta - gradient(lagrangian, rates)
    step = solve_symmetric(ca.hessian(lagrangian, rates)[0], slope)
    solved = ca.SX.zeros(rates.shape)
    for k in range(CHOSEN + FULL):
        full, part = ca.substitute(step, rates, solved), ca.SX(1)
        if k < CHOSEN:
            part, least = ca.SX(0.5**HALVINGS), ca.SX(ca.inf)
            for j in reversed(range(HALVINGS + 1)):
                value = ca.substitute(function, rates, solved + 0.5**j * full)
                is_less = value <= least  # not where L does not exist
                part, least = ca.if_else(is_less, 0.5**j, part), ca.if_else(is_less, value, least)
        solved += part * full
    return solved


def convergence_margins(lagrangian: ca.SX, rates: ca.SX, momenta: ca.SX, sizes: ca.DM) -> ca.SX:
    """Margins of convergence, > 0 where the rates have these momenta (f,).

    :param sizes: nominal values of the rates (f,).
    """
    A, p = ca.hessian(lagrangian, rates)[0], gradient(lagrangian, rates)
    terms = ca.fabs(momenta) + ca.fabs(A) @ (ca.fabs(rates) + sizes)
    return CONVERGED * terms - ca.fabs(p - momenta)
