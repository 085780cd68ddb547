"""Parallel transport by the dynamic connection on V*M (M 7, eq. 53)."""

from __future__ import annotations

import casadi as ca

from liaisons.analysis.active import Loop, changes_round_loop
from liaisons.analysis.phase_space import hamiltonian_field
from liaisons.analysis.quantity import Quantity, Source, require_free_coordinates
from liaisons.analysis.submersions import dynamic_lift, submersion_of


def dynamic_holonomy(source: Source, loop: Loop, *, tolerance: float = 1e-12, **values: float) -> dict[str, float]:
    """How far transport by the dynamic connection round a closed loop of shapes moves (x, p).

    The lift H(Y) is that of the function p·Γ Y: x moves as by the kinetic connection, and p with the map of fibres that
    this makes, so that p·δx is constant for neighbours that are transported, too.

    :param loop: as for :func:`holonomy`.
    :param values: x and p, or ẋ while the shapes rest, at the start; parameters.
    :returns: changes by the names of coordinates and momenta; of an orientation the quaternion at the end.  Of
        constraints p stands for all p + Cᵀ ν.
    :raises ComponentError: if the loop is not closed or names no active coordinate, or the start violates a constraint;
        without a free coordinate.
    """
    equations = submersion_of(source)
    require_free_coordinates(equations, "a connection")
    m = equations.mechanism
    states, shape_rates = ca.vertcat(m.free.q, m.free.p), ca.SX.sym("rates", len(m.actives))
    lift = ca.vertcat(*hamiltonian_field(equations, dynamic_lift(equations, shape_rates)))
    start = Quantity(equations, states).evaluate(**values)
    return changes_round_loop(equations, loop, (states, lift, shape_rates), start, tolerance=tolerance, values=values)
