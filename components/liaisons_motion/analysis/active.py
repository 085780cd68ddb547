"""What the active coordinates do to a classical system: energy, connection, holonomy, dynamic field (M 6, 7).

Fibre coordinates x^i (free), base coordinates s^α (active), metric g of T = ½ g(v, v) in blocks g_ij, g_iα, g_αβ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from liaisons.algebra import gradient, hessian, stack
from liaisons.errors import ComponentError, suggestion
from liaisons.mechanics import Equations, rates_from_momenta
from liaisons_motion.analysis.numeric import final_state, value_at_zero, with_values
from liaisons_motion.analysis.phase_space import hamiltonian, hamiltonian_field
from liaisons_motion.analysis.quantity import (
    Quantity,
    Source,
    all_rates,
    equations_of,
    orientation_cross_products,
    random_states,
    require_free_coordinates,
    require_independent_coordinates,
    require_no_constraints,
    where_nonzero,
)
from liaisons_motion.analysis.submersions import (
    PURPOSE,
    dynamic_lift_generator,
    effective_mass_matrix,
    equations_with_active_coordinates,
    fibre_hamiltonian,
    horizontal_lift,
)

Loop = Callable[[ca.SX], Mapping[str, Any]]
"""Shapes of a loop: takes the symbol a, which runs from 0 to 2π, and returns expressions by active coordinate."""

_TURN = 2 * np.pi
_CLOSED = 1e-9  # what a loop, or a constraint where it begins, may miss
_RADII, _WEIGHTS = np.polynomial.legendre.leggauss(24)  # exact for polynomials of degree 47 along a radius
_ANGLES = 256  # points of the trapezoidal rule, which converges exponentially for a smooth loop


def active_hamiltonian(source: Source) -> Quantity:
    """Active Hamiltonian H̃ = H̃_0 + K_Y on V*M, the energy T + V as a function of x, s, p and ṡ = Y (M 6, 7) [J].

    :raises ComponentError: unless there are active coordinates; for non-holonomic constraints and contacts.
    """
    equations = equations_with_active_coordinates(source)
    return Quantity(equations, equations.in_phase_space(equations.energy))


def legendre_rank(source: Source, **values: float) -> tuple[int, int]:
    """Rank of ∂²L/∂v∂v by all rates v, free and active, at random states; and the number of rates.

    Where both are the same L is hyper-regular, and Legendre's transformation (M eq. 10) can be inverted.

    :param values: parameters and coordinates where they differ from their defaults.
    """
    equations = equations_of(source)
    metric = hessian(equations.lagrangian, all_rates(equations))
    matrices = Quantity(equations, metric).evaluate(**random_states(equations, values)).reshape(*metric.shape, -1)
    return int(np.min(np.linalg.matrix_rank(np.moveaxis(matrices, -1, 0)))), metric.shape[0]


def multiplier_equations(source: Source, **values: float) -> Quantity:
    """Rates and multipliers (ẋ, ṗ, λ) by Hamilton's equations on T*M (M eq. 29-38); (n + f + a,).

    H(x, s, p, p_s) is Legendre's transform in all rates; ∂H/∂p and -∂H/∂x (eq. 36) are the motion, at the p_s = ∂L/∂ṡ
    for which ∂H/∂p_s = ṡ (eq. 37); dp_s/dt + ∂H/∂s (eq. 38) are the operator's forces λ, which contain s̈.  Without
    friction, drives and loads.

    :param values: parameters for which L is hyper-regular, if it is not for the defaults.
    :raises ComponentError: if L is not hyper-regular; unless there are active coordinates and the free ones are
        independent.
    """
    equations = _adapted_equations(source)
    m, L = equations.mechanism, equations.lagrangian
    rank, count = legendre_rank(equations, **values)
    if rank < count:
        raise ComponentError(
            f"{equations.name}: L is not hyper-regular: its kinetic energy has rank {rank} of {count} in the rates of "
            "free and active coordinates; use reduced_multiplier_equations()"
        )
    rates, p_s = all_rates(equations), ca.SX.sym("p_s", m.active.s_dot.shape)
    p = ca.vertcat(m.free.frame.T @ m.free.p, p_s)
    inverse = rates_from_momenta(L, rates, p)
    H = ca.substitute(ca.dot(gradient(L, rates), rates) - L, rates, inverse)
    return _rates_and_multipliers(equations, H, p_s)


def reduced_multiplier_equations(source: Source) -> Quantity:
    """Rates and multipliers (ẋ, ṗ, λ) by H̃ - Σ ṡ^β p_β on V*M (M eq. 45-47); (n + f + a,).

    It takes any L whose mass matrix can be inverted.

    :raises ComponentError: unless there are active coordinates and the free ones are independent.
    """
    equations = _adapted_equations(source)
    p_s = ca.SX.sym("p_s", equations.mechanism.active.s_dot.shape)
    return _rates_and_multipliers(equations, hamiltonian(equations).expression, p_s)


def _rates_and_multipliers(equations: Equations, h: ca.SX, p_s: ca.SX) -> Quantity:
    """Rates (ẋ, ṗ) that a Hamiltonian h generates, and multipliers λ = dp_s/dt + ∂h/∂s with p_s = ∂L/∂ṡ."""
    m = equations.mechanism
    momenta = ca.densify(equations.in_phase_space(gradient(equations.lagrangian, m.active.s_dot)))
    field = ca.vertcat(*hamiltonian_field(equations, h))
    field, slope = (ca.substitute(part, p_s, momenta) for part in (field, gradient(h, m.active.s)))
    state = ca.vertcat(m.free.q, m.free.p, m.active.s, m.active.s_dot)
    change = ca.jtimes(momenta, state, ca.densify(ca.vertcat(field, m.active.s_dot, m.active.s_ddot)))
    return Quantity(equations, ca.vertcat(field, change + slope), conservative=True)


def effective_mass(source: Source) -> Quantity:
    """Effective mass Θ_αβ = (g^αβ)⁻¹ = ∂λ/∂σ̈ at the active coordinates (M eq. 50); (a, a)."""
    equations = equations_with_active_coordinates(source)
    return Quantity(equations, equations.effective_mass)


def active_energy(source: Source) -> Quantity:
    """Kinetic energy of the active constraints, K_Y = ½ Θ(Y, Y) at Y = ṡ (M eq. 51) [J]."""
    equations = equations_with_active_coordinates(source)
    Y = equations.mechanism.active.s_dot
    return Quantity(equations, ca.bilin(effective_mass_matrix(equations), Y, Y) / 2)


def kinetic_connection(source: Source) -> Quantity:
    """Kinetic connection Γ (f, a): velocities ẋ = Γ ṡ are orthogonal to the fibre (M 7, proof of eq. 52-53).

    Γ^i_α = -g_V⁻¹ g_iα = Θ_αβ g^βi.

    Active coordinates are also the values of rheonomic constraints, the last ones: at states that keep them.

    :raises ComponentError: unless there are active coordinates; for non-holonomic constraints and contacts.
    """
    equations = equations_with_active_coordinates(source)
    require_free_coordinates(equations, "a connection")
    return Quantity(equations, horizontal_lift(equations))


def curvature(source: Source) -> Quantity:
    """Curvature F^i_αβ = ∂_α Γ^i_β + Γ^j_α ∂_j Γ^i_β - (α ↔ β), the bracket of two horizontal lifts (M 7).

    For an orientation the components are those of an angular velocity in the body frame, and Γ_α × Γ_β is added.

    :returns: (f, a(a-1)/2), a column for each pair α < β: (1,2), (1,3), ..., (2,3), ...
    :raises ComponentError: unless there are two active coordinates and the free ones are independent.
    """
    equations = _adapted_equations(source)
    m, connection = equations.mechanism, kinetic_connection(source).expression
    count = len(m.actives)
    if count < 2:
        raise ComponentError(f"{equations.name}: a curvature needs two active coordinates; it has {count}")

    def along(alpha: int, column: ca.SX) -> ca.SX:
        """Derivative along the horizontal lift of ∂_α."""
        lift = ca.vertcat(m.free.kinematics @ connection[:, alpha], ca.SX.eye(count)[:, alpha])
        return ca.jtimes(column, ca.vertcat(m.free.q, m.active.s), ca.densify(lift))

    columns = []
    for a, b in combinations(range(count), 2):
        first, second = connection[:, a], connection[:, b]
        columns.append(along(a, second) - along(b, first) + orientation_cross_products(equations, first, second))
    return Quantity(equations, ca.horzcat(*columns))


@dataclass(frozen=True, eq=False)
class DynamicField:
    """The three terms of D_Y = D_0 - X_K + H(Y) (M eq. 52), Y = ṡ; columns over (x, s, p)."""

    frozen: Quantity  # D_0 = (∂H̃_0/∂p, 0, -∂H̃_0/∂x): the active coordinates held still
    energy: Quantity  # -X_K = (0, 0, ∂K_Y/∂x): force of the kinetic energy of the active constraints
    lift: Quantity  # H(Y) = (Γ Y, Y, -∂(p·Γ Y)/∂x): horizontal lift by the dynamic connection (M eq. 53)

    def evaluate(self, **values: ArrayLike) -> np.ndarray:
        """Values of D_Y, the sum of the three terms; see :meth:`Quantity.evaluate`."""
        return self.frozen.evaluate(**values) + self.energy.evaluate(**values) + self.lift.evaluate(**values)


def dynamic_field(source: Source) -> DynamicField:
    """Field D_Y of the motion of (x, s, p) while ṡ = Y(s), in three terms, without friction (M eq. 52, 53).

    Each is generated by a function on phase space: H̃_0, -K_Y and p·Γ Y.  Of constraints, p stands for all p + Cᵀ ν, and
    so does its rate, C being their gradients; s are the active coordinates that L has.

    :raises ComponentError: unless there are active coordinates; for non-holonomic constraints and contacts.
    """
    equations = equations_with_active_coordinates(source)
    require_free_coordinates(equations, "a connection")
    m = equations.mechanism
    Y, K_Y = m.active.s_dot, active_energy(equations).expression
    shape_rate = Y[: m.active.adapted, 0]

    def field(h: ca.SX, shape_rate: ca.SX) -> Quantity:
        """Field over (x, s, p) that a function h on phase space generates, with given rates of s."""
        x_dot, p_dot = hamiltonian_field(equations, h)
        return Quantity(equations, ca.vertcat(x_dot, shape_rate, p_dot), conservative=True)

    still = ca.SX.zeros(shape_rate.shape)
    H_0, lift = fibre_hamiltonian(equations), dynamic_lift_generator(equations, Y)
    return DynamicField(field(H_0, still), field(-K_Y, still), field(lift, shape_rate))


def holonomy(source: Source, loop: Loop, **values: float) -> dict[str, float]:
    """Changes ∮ Γ ds of x by parallel transport round a closed loop, by the kinetic connection (M 7, 8.2).

    What the system does when it starts with all momenta 0 and no force acts, at whatever speed.

    :param loop: a ↦ active coordinates, 0 <= a <= 2π, for example
        ``lambda a: {"psi_1": ca.cos(a), "psi_2": ca.sin(a)}``; those not named stay where they are.
    :param values: x at the start, parameters.
    :returns: Δx by the name of the free coordinate; of an orientation the quaternion at the end.
    :raises ComponentError: if the loop is not closed or names no active coordinate, or the start violates a constraint.
    """
    equations = equations_with_active_coordinates(source)
    x, shape_rates = equations.mechanism.free.q, ca.SX.sym("rates", len(equations.mechanism.actives))
    lift = equations.mechanism.free.kinematics @ kinetic_connection(equations).expression @ shape_rates
    start = np.atleast_1d(Quantity(equations, x).evaluate(**values))
    return _changes_round_loop(equations, loop, (x, lift, shape_rates), start, values)


def dynamic_holonomy(source: Source, loop: Loop, **values: float) -> dict[str, float]:
    """Changes of (x, p) by parallel transport round a closed loop, by the dynamic connection (M 7, eq. 53).

    The lift H(Y) is that of the function p·Γ Y: x moves as by the kinetic connection, and p with the map of fibres that
    this makes, so that p·δx is constant for neighbours that are transported, too.

    :param loop: as for :func:`holonomy`.
    :param values: x and p, or ẋ while the shapes rest, at the start; parameters.
    :returns: changes by the names of coordinates and momenta; of an orientation the quaternion at the end.  Of
        constraints p stands for all p + Cᵀ ν.
    :raises ComponentError: if the loop is not closed or names no active coordinate, or the start violates a constraint;
        without a free coordinate.
    """
    equations = equations_with_active_coordinates(source)
    require_free_coordinates(equations, "a connection")
    m = equations.mechanism
    states, shape_rates = ca.vertcat(m.free.q, m.free.p), ca.SX.sym("rates", len(m.actives))
    lift = ca.vertcat(*hamiltonian_field(equations, dynamic_lift_generator(equations, shape_rates)))
    start = Quantity(equations, states).evaluate(**values)
    return _changes_round_loop(equations, loop, (states, lift, shape_rates), start, values)


def curvature_integral(source: Source, loop: Loop, **values: float) -> dict[str, float]:
    """Holonomy as an area, ∬ Σ_{α<β} F_αβ ds^α ∧ ds^β over a surface in the loop, by Stokes (M 7, 8.2).

    The surface is the cone of the loop over its mean point; any number of active coordinates will do.

    :param loop: as for :func:`holonomy`; smooth.
    :returns: Δx by the name of the free coordinate.
    :raises ComponentError: as :func:`holonomy`, and if Γ depends on x, when areas do not add up.
    """
    equations = _adapted_equations(source)
    require_independent_coordinates(equations, "a curvature that adds up")
    m, a, rho = equations.mechanism, ca.SX.sym("a"), ca.SX.sym("rho")
    connection = kinetic_connection(equations).expression
    if where_nonzero(equations, ca.jacobian(connection, m.free.q), values):
        names = ", ".join(item.name for item in m.coordinates)
        raise ComponentError(f"{equations.name}: the connection depends on {names}: use holonomy()")
    sigma = _loop_coordinates(equations, loop, a, values)
    angles = np.arange(_ANGLES) * (_TURN / _ANGLES)
    centre = np.asarray(ca.Function("loop", [a], [ca.densify(sigma)])(angles[None, :])).mean(axis=1)
    arm, arm_rate = sigma - centre, ca.jacobian(sigma, a)
    # (s_ρ ∧ s_a) dρ da with s = centre + ρ arm
    areas = stack(rho * (arm[i] * arm_rate[j] - arm[j] * arm_rate[i]) for i, j in combinations(range(arm.shape[0]), 2))
    density = ca.substitute(curvature(equations).expression, m.active.s, centre + rho * arm) @ areas
    density = with_values(equations, density, values, ca.SX(0, 1))
    function = ca.Function("density", [rho, a], [ca.densify(density)])
    radii, turns = (grid.ravel()[None, :] for grid in np.meshgrid((1 + _RADII) / 2, angles, indexing="ij"))
    weights = np.repeat(_WEIGHTS / 2, _ANGLES) * (_TURN / _ANGLES)
    total = np.asarray(function(radii, turns)) @ weights
    return dict(zip([item.name for item in m.coordinates], total.tolist(), strict=True))


def _adapted_equations(source: Source) -> Equations:
    """Equations of a mechanism that has active coordinates.

    :raises ComponentError: if it has none; for constraints and contacts.
    """
    equations = equations_of(source)
    require_no_constraints(equations, PURPOSE)
    return equations_with_active_coordinates(equations)


def _changes_round_loop(
    equations: Equations,
    loop: Loop,
    field: tuple[ca.SX, ca.SX, ca.SX],
    start: np.ndarray,
    values: Mapping[str, float],
) -> dict[str, float]:
    """Changes of states by transport round a loop, by name; of a quaternion its values at the end.

    :param field: states, their rates, and the symbols of the active coordinates' rates in these.
    :raises ComponentError: if the loop is not closed or names no active coordinate, or the start violates a constraint.
    """
    m, a, (states, lift, shape_rates) = equations.mechanism, ca.SX.sym("a"), field
    sigma = _loop_coordinates(equations, loop, a, values)
    begin = {
        str(s): value_at_zero(row, a) for s, row in zip(ca.vertsplit(m.active.s), ca.vertsplit(sigma), strict=True)
    }
    for item, row in zip(m.all_constraints, ca.vertsplit(equations.constraints.residuals), strict=True):
        left = float(Quantity(equations, row).evaluate(**{**values, **begin}))
        if not abs(left) < _CLOSED:
            raise ComponentError(f"{equations.name}: {item.name} is off by {left:g} where the loop begins")
    rate = ca.substitute(
        lift, ca.vertcat(m.active.s, shape_rates), ca.densify(ca.vertcat(sigma, ca.jacobian(sigma, a)))
    )
    rate = with_values(equations, rate, values, states)
    end = final_state(rate, states, start, t=a, duration=_TURN, owner=equations.name)
    quaternions = {name for item in m.orientations for name in item.quaternion}
    changes = zip(map(str, ca.vertsplit(states)), end.tolist(), (end - start).tolist(), strict=True)
    return {name: value if name in quaternions else change for name, value, change in changes}


def _loop_coordinates(equations: Equations, loop: Loop, a: ca.SX, values: Mapping[str, float]) -> ca.SX:
    """Active coordinates on a loop as expressions of its parameter; a ComponentError unless it is closed."""
    m, owner = equations.mechanism, equations.name
    shapes, names = dict(loop(a)), [item.name for item in m.actives]
    for name in shapes:
        if name not in names:
            raise ComponentError(f"{owner}: a loop moves active coordinates, not {name!r}{suggestion(name, names)}")
    sigma = stack(ca.SX(shapes.get(item.name, values.get(item.name, item.start))) for item in m.actives)
    gap = ca.substitute(sigma, a, ca.SX(_TURN)) - ca.substitute(sigma, a, ca.SX(0.0))
    for name, row in zip(names, ca.vertsplit(gap), strict=True):
        if not abs(value_at_zero(row, a)) < _CLOSED:
            raise ComponentError(
                f"{owner}: the loop is open: {name} at a = 2π and a = 0 differ by {value_at_zero(row, a):g}"
            )
    return sigma
