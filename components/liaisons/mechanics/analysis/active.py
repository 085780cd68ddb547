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

from liaisons.errors import ComponentError, suggestion
from liaisons.mechanics.algebra import gradient, solve_symmetric, stack
from liaisons.mechanics.analysis.numeric import at_zero, frozen, integrate
from liaisons.mechanics.analysis.phase_space import hamiltonian
from liaisons.mechanics.analysis.quantity import (
    Quantity,
    Source,
    equations_of,
    largest,
    name_of,
    require_coordinates,
)
from liaisons.mechanics.equations import Equations

Loop = Callable[[ca.SX], Mapping[str, Any]]
"""Shapes of a loop: takes the symbol a, which runs from 0 to 2π, and returns expressions by active coordinate."""

_TURN = 2 * np.pi
_RADII, _WEIGHTS = np.polynomial.legendre.leggauss(24)  # exact for polynomials of degree 47 along a radius
_ANGLES = 256  # points of the trapezoidal rule, which converges exponentially for a smooth loop


def active_hamiltonian(source: Source) -> Quantity:
    """H̃ on V*M: the energy T + V as a function of x, s, p and Y = ṡ; H̃ = H̃_0 + K_Y (M 6, 7) [J].

    :raises ComponentError: unless there are active coordinates and the free ones are independent.
    """
    equations = _adapted(source)
    return Quantity(equations, equations.in_phase_space(equations.energy))


def effective_mass(source: Source) -> Quantity:
    """Θ_αβ = (g^αβ)⁻¹ (M eq. 50), the mass that the operator feels: ∂λ/∂σ̈; (a, a)."""
    equations = _adapted(source)
    return Quantity(equations, equations.effective_mass)


def active_energy(source: Source) -> Quantity:
    """K_Y = ½ Θ(Y, Y) at Y = ṡ, the kinetic energy of the active constraints (M eq. 51) [J]."""
    equations = _adapted(source)
    Y = equations.mechanism.active.s_dot
    return Quantity(equations, ca.bilin(equations.effective_mass, Y, Y) / 2)


def kinetic_connection(source: Source) -> Quantity:
    """Γ^i_α = -g_V⁻¹ g_iα = Θ_αβ g^βi: ẋ = Γ ṡ is orthogonal to the fibre (M 7, proof of eq. 52-53); (f, a).

    :raises ComponentError: unless there are active coordinates and the free ones are independent.
    """
    equations = _adapted(source)
    m = equations.mechanism
    mixed = ca.jacobian(gradient(equations.kinetic_energy, m.free.q_dot), m.active.s_dot)
    return Quantity(equations, -solve_symmetric(equations.mass_matrix, mixed))


def curvature(source: Source) -> Quantity:
    """F^i_αβ = ∂_α Γ^i_β + Γ^j_α ∂_j Γ^i_β - (α ↔ β), the bracket of two horizontal lifts (M 7).

    :returns: (f, a(a-1)/2), a column for each pair α < β: (1,2), (1,3), ..., (2,3), ...
    :raises ComponentError: unless there are two active coordinates and the free ones are independent.
    """
    equations = _adapted(source)
    m, connection = equations.mechanism, kinetic_connection(source).expression
    count = len(m.actives)
    if count < 2:
        raise ComponentError(f"{name_of(equations)}: a curvature needs two active coordinates; it has {count}")

    def along(alpha: int, column: ca.SX) -> ca.SX:
        """Derivative along the horizontal lift of ∂_α."""
        lift = ca.vertcat(connection[:, alpha], ca.SX.eye(count)[:, alpha])
        return ca.jtimes(column, ca.vertcat(m.free.q, m.active.s), ca.densify(lift))

    pairs = combinations(range(count), 2)
    columns = [along(a, connection[:, b]) - along(b, connection[:, a]) for a, b in pairs]
    return Quantity(equations, ca.horzcat(*columns))


@dataclass(frozen=True, eq=False)
class DynamicField:
    """The three terms of D_Y = D_0 - X_K + H(Y) (M eq. 52), Y = ṡ; columns over (x, s, p), (2f + a,)."""

    frozen: Quantity  # D_0 = (∂H̃_0/∂p, 0, -∂H̃_0/∂x): the active coordinates held still
    energy: Quantity  # -X_K = (0, 0, ∂K_Y/∂x): force of the kinetic energy of the active constraints
    lift: Quantity  # H(Y) = (Γ Y, Y, -∂(p·Γ Y)/∂x): horizontal lift by the dynamic connection (M eq. 53)

    def evaluate(self, **values: ArrayLike) -> np.ndarray:
        """D_Y itself, the sum of the three terms; see :meth:`Quantity.evaluate`."""
        return self.frozen.evaluate(**values) + self.energy.evaluate(**values) + self.lift.evaluate(**values)


def dynamic_field(source: Source) -> DynamicField:
    """The three terms of the field D_Y that moves (x, s, p) while ṡ = Y(s) (M eq. 52, 53); without friction.

    :raises ComponentError: unless there are active coordinates and the free ones are independent.
    """
    equations = _adapted(source)
    m = equations.mechanism
    x, p, Y = m.free.q, m.free.p, m.active.s_dot
    H_0 = ca.substitute(hamiltonian(equations).expression, Y, ca.SX.zeros(Y.shape))
    K_Y, lifted = active_energy(equations).expression, kinetic_connection(equations).expression @ Y
    still, no_force = ca.SX.zeros(Y.shape), ca.SX.zeros(x.shape)
    return DynamicField(
        frozen=Quantity(equations, ca.vertcat(gradient(H_0, p), still, -gradient(H_0, x))),
        energy=Quantity(equations, ca.vertcat(no_force, still, gradient(K_Y, x))),
        lift=Quantity(equations, ca.vertcat(lifted, Y, -gradient(ca.dot(p, lifted), x))),
    )


def holonomy(source: Source, loop: Loop, *, tolerance: float = 1e-12, **values: float) -> dict[str, float]:
    """How far parallel transport by the kinetic connection round a closed loop of shapes moves x: ∮ Γ ds (M 7, 8.2).

    What the system does when it starts with all momenta 0 and no force acts, at whatever speed.

    :param loop: a ↦ active coordinates, 0 <= a <= 2π, for example
        ``lambda a: {"psi_1": ca.cos(a), "psi_2": ca.sin(a)}``; those not named stay where they are.
    :param values: x at the start, parameters.
    :returns: Δx by the name of the free coordinate.
    :raises ComponentError: if the loop is not closed or names no active coordinate.
    """
    equations = _adapted(source)
    m, a = equations.mechanism, ca.SX.sym("a")
    sigma = _shapes(equations, loop, a, values)
    x = m.free.q
    rate = ca.substitute(kinetic_connection(equations).expression, m.active.s, sigma) @ ca.jacobian(sigma, a)
    start = np.atleast_1d(Quantity(equations, x).evaluate(**values))
    rate = frozen(equations, rate, values, x)
    end = integrate(rate, x, start, t=a, duration=_TURN, tolerance=tolerance, owner=name_of(equations))
    return dict(zip([item.name for item in m.coordinates], (end - start).tolist(), strict=True))


def curvature_integral(source: Source, loop: Loop, **values: float) -> dict[str, float]:
    """The holonomy as an area: ∬ Σ_{α<β} F_αβ ds^α ∧ ds^β over a surface in the loop, by Stokes (M 7, 8.2).

    The surface is the cone of the loop over its mean point; any number of active coordinates will do.

    :param loop: as for :func:`holonomy`; smooth.
    :returns: Δx by the name of the free coordinate.
    :raises ComponentError: as :func:`holonomy`, and if Γ depends on x, when areas do not add up.
    """
    equations = _adapted(source)
    m, a, rho = equations.mechanism, ca.SX.sym("a"), ca.SX.sym("rho")
    connection = kinetic_connection(equations).expression
    size = ca.norm_fro(connection) + ca.norm_fro(ca.jacobian(connection, m.free.q))
    if largest(equations, ca.norm_fro(ca.jacobian(connection, m.free.q)), size, values) != 0:
        names = ", ".join(item.name for item in m.coordinates)
        raise ComponentError(f"{name_of(equations)}: the connection depends on {names}: use holonomy()")
    sigma = _shapes(equations, loop, a, values)
    angles = np.arange(_ANGLES) * (_TURN / _ANGLES)
    centre = np.asarray(ca.Function("loop", [a], [ca.densify(sigma)])(angles[None, :])).mean(axis=1)
    arm, arm_rate = sigma - centre, ca.jacobian(sigma, a)
    # (s_ρ ∧ s_a) dρ da with s = centre + ρ arm
    areas = stack(rho * (arm[i] * arm_rate[j] - arm[j] * arm_rate[i]) for i, j in combinations(range(arm.shape[0]), 2))
    density = ca.substitute(curvature(equations).expression, m.active.s, centre + rho * arm) @ areas
    density = frozen(equations, density, values, ca.SX(0, 1))
    function = ca.Function("density", [rho, a], [ca.densify(density)])
    radii, turns = (grid.ravel()[None, :] for grid in np.meshgrid((1 + _RADII) / 2, angles, indexing="ij"))
    weights = np.repeat(_WEIGHTS / 2, _ANGLES) * (_TURN / _ANGLES)
    total = np.asarray(function(radii, turns)) @ weights
    return dict(zip([item.name for item in m.coordinates], total.tolist(), strict=True))


def _adapted(source: Source) -> Equations:
    """The equations of a mechanism with active coordinates and independent free ones, adapted in M's sense."""
    equations = equations_of(source)
    require_coordinates(equations, "the geometry of active constraints")
    if not equations.mechanism.actives:
        raise ComponentError(f"{name_of(equations)}: it has no active coordinate; declare one as ActiveCoordinate")
    return equations


def _shapes(equations: Equations, loop: Loop, a: ca.SX, values: Mapping[str, float]) -> ca.SX:
    """σ(a) of all active coordinates, checked to be closed; (a,)."""
    m, owner = equations.mechanism, name_of(equations)
    given, names = dict(loop(a)), [item.name for item in m.actives]
    for name in given:
        if name not in names:
            raise ComponentError(f"{owner}: a loop moves active coordinates, not {name!r}{suggestion(name, names)}")
    sigma = stack(ca.SX(given.get(item.name, values.get(item.name, item.start))) for item in m.actives)
    gap = ca.substitute(sigma, a, ca.SX(_TURN)) - ca.substitute(sigma, a, ca.SX(0.0))
    for name, row in zip(names, ca.vertsplit(gap), strict=True):
        if not abs(at_zero(row, a)) < 1e-9:
            raise ComponentError(f"{owner}: the loop is open: {name} at a = 2π and a = 0 differ by {at_zero(row, a):g}")
    return sigma
