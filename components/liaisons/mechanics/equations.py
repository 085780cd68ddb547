"""The derivation: from one Lagrangian to the equations of motion in adapted coordinates.

K = Kneller, M = Marle.  Free coordinates x (here ``q``), active coordinates s = σ(t).  State (x, p):

======================  ============================================================  ==================
p = ∂L/∂ẋ               = A(x, s) ẋ + b(x, s, σ̇)                                      K eq. 79, M eq. 10
ẋ = A⁻¹ (p − b)         Legendre transform, inverted in the free rates only           M eq. 36
ṗ = ∂L/∂x + Q           only σ and σ̇ enter: p is continuous when σ̇ jumps             M eq. 26, 36
λ = d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s   force of the operator; needs σ̈                         M eq. 27
P = Σ λ σ̇               its power                                                     M eq. 28
Θ = ∂λ/∂σ̈               effective mass at the active port                             M eq. 50
Q = −η ∂T/∂q̇            friction, on free and active coordinates alike                K eq. 64
dE/dt = Σ λ σ̇ + drives and loads − 2 η T                                              K eq. 67, M eq. 28
======================  ============================================================  ==================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from liaisons.errors import ComponentError, suggestion

if TYPE_CHECKING:
    from liaisons.mechanics.mechanism import Mechanism

QUANTITIES = (
    "mass_matrix",
    "momenta",
    "velocities",
    "momentum_rates",
    "accelerations",
    "operator_forces",
    "effective_mass",
    "kinetic_energy",
    "potential_energy",
    "energy",
    "power",
    "dissipation",
)


@dataclass(frozen=True, eq=False)
class Equations:
    """Equations of motion of one mechanism, f free and a active coordinates; all members are CasADi SX.

    ``momenta`` and everything that contains rates is written in (q, q̇, s, ṡ); :meth:`in_phase_space` puts the
    state (q, p) in the place of the rates.
    """

    mechanism: Mechanism  # the symbols
    drives: ca.SX  # (f,) generalised forces q_force
    loads: ca.SX  # (f,) q_load
    point_loads: ca.SX  # (number of point components,) P_x_load
    points: dict[str, ca.SX]  # "bob_x" -> expression
    lagrangian: ca.SX
    kinetic_energy: ca.SX
    potential_energy: ca.SX
    mass_matrix: ca.SX  # A (f, f)
    momenta: ca.SX  # ∂L/∂ẋ (f,)
    velocities: ca.SX  # ẋ as function of (x, p, s, σ̇) (f,)
    momentum_rates: ca.SX  # ṗ (f,)
    accelerations: ca.SX  # ẍ (f,)
    operator_forces: ca.SX  # λ (a,)
    effective_mass: ca.SX  # Θ (a, a)
    power: ca.SX  # through all ports
    dissipation: ca.SX  # 2 η T

    @property
    def symbols(self) -> dict[str, ca.SX]:
        """All symbols by name: those of the mechanism, drives and loads."""
        forces = ca.vertsplit(ca.vertcat(self.drives, self.loads, self.point_loads))
        return self.mechanism.symbols | {str(symbol): symbol for symbol in forces}

    @property
    def energy(self) -> ca.SX:
        """E = T + V (K eq. 61)."""
        return self.kinetic_energy + self.potential_energy

    def in_motion(self, expression: ca.SX) -> ca.SX:
        """Replace accelerations and operator forces by what the equations give for them."""
        m = self.mechanism
        with_forces = ca.substitute(ca.SX(expression), m.active.force, self.operator_forces)
        return ca.substitute(with_forces, m.free.q_ddot, self.accelerations)

    def in_phase_space(self, expression: ca.SX) -> ca.SX:
        """Replace the rates q̇ by velocities(q, p, s, ṡ), after :meth:`in_motion`."""
        return ca.substitute(self.in_motion(expression), self.mechanism.free.q_dot, self.velocities)

    def evaluate(self, quantity: str, **values: float) -> np.ndarray:
        """Numbers for one quantity at one state.

        :param quantity: one of ``QUANTITIES``.
        :param values: symbols by name: parameters, ``q``, ``q_dot``, ``s``, ``s_dot``, ``s_ddot``, ``q_force``,
            ``q_load``, ``P_x_load``; for ``velocities`` also ``p_q``.  The others take their defaults or 0.
        :returns: array with the shape of the quantity, columns as 1-d.
        :raises ComponentError: for an unknown quantity or symbol.
        """
        name = type(self.mechanism).__name__
        if quantity not in QUANTITIES:
            raise ComponentError(f"{name}: unknown quantity {quantity!r}{suggestion(quantity, QUANTITIES)}")
        symbols = self.symbols
        for symbol in values:
            if symbol not in symbols:
                raise ComponentError(f"{name}: unknown symbol {symbol!r}{suggestion(symbol, symbols)}")
        numbers = dict.fromkeys(symbols, 0.0) | start_values(self.mechanism) | values
        expression = self.in_motion(getattr(self, quantity))
        function = ca.Function("evaluate", list(symbols.values()), [ca.densify(expression)])
        result = np.asarray(function(*(numbers[symbol] for symbol in symbols)))
        return result[:, 0] if result.shape[1] == 1 else result


def derive(component: type[Mechanism]) -> Equations:
    """Derive the equations of motion of a mechanism.

    :param component: a subclass of Mechanism.
    :returns: the equations, symbolically.
    """
    m = component()
    q, q_dot, q_ddot = m.free.q, m.free.q_dot, m.free.q_ddot
    s, s_dot, s_ddot = m.active.s, m.active.s_dot, m.active.s_ddot
    kinetic, potential = ca.SX(m.kinetic_energy()), ca.SX(m.potential_energy())
    L = ca.SX(m.lagrangian())
    eta = ca.SX(m.friction_coefficient())

    # Applied forces: drives and loads on free coordinates, loads at points by virtual work (K eq. 14), friction.
    drives, loads = _column(component.coordinates, "force"), _column(component.coordinates, "load")
    points = {
        f"{point.name}_{axis}": ca.SX(value)
        for point in component.points
        for axis, value in getattr(m, point.name).items()
    }
    position = ca.vertcat(*points.values()) if points else ca.SX(0, 1)
    point_loads = ca.vertcat(*(ca.SX.sym(f"{name}_load") for name in points)) if points else ca.SX(0, 1)
    Q = drives - loads - ca.jacobian(position, q).T @ point_loads - eta * ca.gradient(kinetic, q_dot)
    Q_s = -ca.jacobian(position, s).T @ point_loads - eta * ca.gradient(kinetic, s_dot)

    # Momentum and its inverse: p = A ẋ + b.
    p = ca.gradient(L, q_dot)
    A = mass_matrix(m, L)
    b = ca.substitute(p, q_dot, ca.SX.zeros(q_dot.shape))
    velocities = _solve_symmetric(A, m.free.p - b)

    # Motion: ṗ = ∂L/∂x + Q, and the same in accelerations: A ẍ = ṗ − (d/dt p without its ẍ term).
    p_dot = ca.gradient(L, q) + Q
    p_dot_without_acceleration = ca.substitute(m.dot(p), q_ddot, ca.SX.zeros(q_dot.shape))
    accelerations = _solve_symmetric(A, p_dot - p_dot_without_acceleration)

    # The operator: λ = d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s along the motion.
    momenta_s = ca.gradient(L, s_dot)
    lambda_s = ca.substitute(m.dot(momenta_s) - ca.gradient(L, s) - Q_s, q_ddot, accelerations)
    Theta = ca.jacobian(lambda_s, s_ddot)

    power = ca.dot(lambda_s, s_dot) + ca.dot(drives - loads, q_dot) - ca.dot(point_loads, m.dot(position))
    dissipation = eta * (ca.dot(ca.gradient(kinetic, q_dot), q_dot) + ca.dot(ca.gradient(kinetic, s_dot), s_dot))
    return Equations(
        mechanism=m,
        drives=drives,
        loads=loads,
        point_loads=point_loads,
        points=points,
        lagrangian=L,
        kinetic_energy=kinetic,
        potential_energy=potential,
        mass_matrix=A,
        momenta=p,
        velocities=velocities,
        momentum_rates=p_dot,
        accelerations=accelerations,
        operator_forces=lambda_s,
        effective_mass=Theta,
        power=power,
        dissipation=dissipation,
    )


def mass_matrix(picture: Mechanism, lagrangian: ca.SX) -> ca.SX:
    """A = ∂²L/∂q̇∂q̇, the metric g_ij of M eq. 42; shape (f, f)."""
    return ca.hessian(lagrangian, picture.free.q_dot)[0]


def start_values(picture: Mechanism) -> dict[str, float]:
    """Defaults of parameters, coordinates, rates and inputs; what is not declared starts at 0."""
    values = dict.fromkeys(picture.symbols, 0.0)
    values |= {item.name: item.start for item in (*picture.parameters, *picture.coordinates, *picture.actives)}
    return values | {f"{q.name}_dot": q.start_rate for q in picture.coordinates}


def _column(coordinates: tuple, suffix: str) -> ca.SX:
    return ca.vertcat(*(ca.SX.sym(f"{coordinate.name}_{suffix}") for coordinate in coordinates))


def _solve_symmetric(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """matrix⁻¹ right for a symmetric positive definite matrix: LDLᵀ without pivoting keeps the expressions short."""
    if matrix.shape == (1, 1):
        return right / matrix
    D, LT, order = ca.ldl(ca.densify(matrix), False)
    return ca.ldl_solve(right, D, LT, order)
