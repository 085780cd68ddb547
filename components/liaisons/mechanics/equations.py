"""The derivation: from one Lagrangian to the equations of motion.

K = Kneller, M = Marle.  Free coordinates x (here ``q``), active coordinates s = σ(t), adapted (M 3.5) or prescribed
by a rheonomic constraint π(x) = σ(t) (M eq. 20).  State (x, p):

======================  ============================================================  ==================
p = ∂L/∂ẋ               = A(x, s) ẋ + b(x, s, σ̇), unless L is not quadratic           K eq. 78, M eq. 10
ẋ = A⁻¹ (p − b)         Legendre transform, inverted in the free rates only           M eq. 36
ṗ = ∂L/∂x + Q           only σ and σ̇ enter: p is continuous when σ̇ jumps             M eq. 26, 36
λ = d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s   force of the operator; needs σ̈                         M eq. 27
P = Σ λ σ̇               its power                                                     M eq. 28
Θ = ∂λ/∂σ̈               effective mass at the active port                             M eq. 50
Q = −∂D/∂q̇              friction, on free and active coordinates alike: D = η T + D′   K eq. 64, 66
C ẍ = c                 constraints in accelerations: C = ∂σ/∂x, ∂π/∂x or ∂ρ/∂ẋ       K eq. 9, 111, M eq. 22
Z = Cᵀ λ                their forces; λ from C A⁻¹ Cᵀ λ = c − C A⁻¹ (forces)          K eq. 7, 9
dE/dt = Σ λ σ̇ + drives and loads − Σ q̇ ∂D/∂q̇ − Σ σ̇ ∂D/∂σ̇                             K eq. 67, M eq. 28
======================  ============================================================  ==================

An orientation has the angular velocity ω in the body frame for ẋ, and its momentum H = R ∂L/∂ω in the inertial frame:
Ḣ is the torque, zero unless L depends on the orientation, so that H is conserved to rounding.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from liaisons.algebra import jacobian
from liaisons.errors import ComponentError, suggestion
from liaisons.language import Mechanism
from liaisons.mechanics.applied_forces import AppliedForces, applied_forces
from liaisons.mechanics.constraints import (
    STABILISATION,
    Constraints,
    consistent_momenta,
    constrained_velocities,
    differentiated_constraints,
    multipliers,
    projection,
    residuals_by_rounding,
)
from liaisons.mechanics.dynamics import Dynamics, dynamics_of
from liaisons.mechanics.friction import Dissipation

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
    """Equations of motion of a mechanism: f velocities, a active coordinates, c constraints; all CasADi SX.

    ``momenta`` and everything that contains rates is written in (q, q̇, s, ṡ); :meth:`in_phase_space` puts the
    state (q, p) in the place of the rates.
    """

    mechanism: Mechanism  # the symbols
    lagrangian: ca.SX
    kinetic_energy: ca.SX
    potential_energy: ca.SX
    applied: AppliedForces
    dynamics: Dynamics
    constraints: Constraints  # C ẍ = c
    velocities: ca.SX  # ẋ as function of (x, p, s, σ̇) (f,)
    constraint_stabilization: ca.SX  # added to ṗ, so that momenta across the constraints decay (f,)
    constraint_forces: ca.SX  # λ of all constraints (c,)
    accelerations: ca.SX  # ẍ (f,)
    operator_forces: ca.SX  # λ of the operators (a,)

    @property
    def name(self) -> str:
        """Name of the component, for messages."""
        return type(self.mechanism).__name__

    @property
    def symbols(self) -> dict[str, ca.SX]:
        """Symbols of the mechanism, drives and loads, by name."""
        forces = ca.vertsplit(self.applied.outer)
        return self.mechanism.symbols | {str(symbol): symbol for symbol in forces}

    @property
    def mass_matrix(self) -> ca.SX:
        """Mass matrix A (f, f)."""
        return self.dynamics.inertia.matrix

    @property
    def momenta(self) -> ca.SX:
        """Momenta p = ∂L/∂ẋ (f,) (K eq. 78, M eq. 10)."""
        return self.dynamics.momenta

    @cached_property
    def forces(self) -> ca.SX:
        """Forces f with A ẍ = f + Cᵀ λ (f,)."""
        return self.dynamics.bias + self.applied.on_free

    @cached_property
    def momentum_rates(self) -> ca.SX:
        """Rates of the momenta ṗ = ∂L/∂x + Q + Cᵀ λ (f,) (M eq. 26, 36)."""
        force = self.dynamics.lagrangian_gradient + self.applied.on_free
        return self.mechanism.free.frame @ (force + self.constraints.matrix.T @ self.constraint_forces)

    @cached_property
    def applied_forces(self) -> ca.SX:
        """Q, then Q_s on adapted coordinates, with forces of constraints whose λ are symbols."""
        m, C = self.mechanism, self.constraints
        lambdas = ca.vertcat(m.multipliers, m.active.force[m.active.adapted :, 0])
        across = C.gradients_along(m) @ lambdas[list(C.holonomic), 0]
        return ca.vertcat(self.applied.on_free + C.matrix.T @ lambdas, self.applied.on_active + across)

    @property
    def multipliers(self) -> ca.SX:
        """Multipliers λ of the passive and non-holonomic constraints."""
        return self.constraint_forces[: len(self.mechanism.passive_constraints), 0]

    @cached_property
    def effective_mass(self) -> ca.SX:
        """Effective mass Θ = ∂λ/∂σ̈ at the active ports (a, a) (M eq. 50)."""
        return jacobian(self.operator_forces, self.mechanism.active.s_ddot)

    @cached_property
    def power(self) -> ca.SX:
        """Power through all ports: Σ λ σ̇ of the operators (M eq. 28), drives and loads."""
        return self.applied.power(self.operator_forces)

    @cached_property
    def dissipation(self) -> ca.SX:
        """Power that friction and non-holonomic constraints take; the latter are neither drive nor load."""
        m, C = self.mechanism, self.constraints.matrix
        rows = list(range(len(m.constraints), len(m.passive_constraints)))
        return self.applied.dissipation - ca.dot(self.constraint_forces[rows, 0], C[rows, :] @ m.free.q_dot)

    @cached_property
    def independence(self) -> ca.SX:
        """Independence of each constraint from the others; near 0 they lose rank (c,)."""
        C = self.constraints
        return self.dynamics.inertia.independence(C.matrix, C.squares) if C.matrix.shape[0] else ca.SX(0, 1)

    @cached_property
    def residuals_by_rounding(self) -> ca.SX:
        """Residuals of the constraints, within 1 where they are kept (c,)."""
        return residuals_by_rounding(self.mechanism, self.constraints)

    @cached_property
    def projection(self) -> ca.SX | None:
        """State (x, p) projected onto constraints and unit quaternions; None where there are none."""
        return projection(self.mechanism, self.dynamics.inertia, self.dynamics.velocities, self.constraints)

    @cached_property
    def given_rates(self) -> ca.SX:
        """Symbols: 1 for each rate that is given at the start, else 0 (f,)."""
        return ca.SX.sym("given", self.mechanism.free.q_dot.shape[0])

    @cached_property
    def start_momenta(self) -> ca.SX:
        """Momenta ∂L/∂ẋ at rates on the constraints, of which some are given (f,)."""
        m, loose = self.mechanism, self.dynamics.velocities
        return consistent_momenta(m, self.dynamics.inertia, loose, self.constraints, self.given_rates)

    @property
    def internal_rates(self) -> ca.SX:
        """Rates of the internal states."""
        return self.mechanism.internal_rate_column()

    @property
    def state_rates(self) -> ca.SX:
        """Rates d/dt (q, p) for a solver, q with quaternions of orientations, p with stabilisation of constraints."""
        free = self.mechanism.free
        return ca.vertcat(free.kinematics @ free.q_dot, self.momentum_rates + self.constraint_stabilization)

    @cached_property
    def model_rates(self) -> ca.SX:
        """Rates of all states of the model: (q, p), internal states, work, dissipated energy."""
        return ca.vertcat(self.state_rates, self.internal_rates, self.power, self.dissipation)

    @property
    def energy(self) -> ca.SX:
        """Energy E = T + V (K eq. 31)."""
        return self.kinetic_energy + self.potential_energy

    def in_motion(self, expression: ca.SX) -> ca.SX:
        """Expression with the solutions for accelerations, operator forces and multipliers in place of symbols."""
        m = self.mechanism
        forces = ca.vertcat(m.active.force, m.multipliers)
        with_forces = ca.substitute(ca.SX(expression), forces, ca.vertcat(self.operator_forces, self.multipliers))
        return ca.substitute(with_forces, m.free.q_ddot, self.accelerations)

    def in_phase_space(self, expression: ca.SX) -> ca.SX:
        """Expression :meth:`in_motion` as a function of the state: with velocities(q, p, s, ṡ) in place of q̇."""
        return ca.substitute(self.in_motion(expression), self.mechanism.free.q_dot, self.velocities)

    def evaluate(self, quantity: str, **values: float) -> np.ndarray:
        """Value of a quantity at a state.

        :param quantity: one of ``QUANTITIES``.
        :param values: symbols by name: parameters, ``q``, ``q_dot``, ``s``, ``s_dot``, ``s_ddot``, ``q_force``,
            ``q_load``, ``P_x_load``; for ``velocities`` also ``p_q``.  The others take their defaults or 0.
        :returns: array with the shape of the quantity, columns as 1-d.
        :raises ComponentError: for an unknown quantity or symbol.
        """
        if quantity not in QUANTITIES:
            raise ComponentError(f"{self.name}: unknown quantity {quantity!r}{suggestion(quantity, QUANTITIES)}")
        numbers = self.numbers(values)
        expression = self.in_motion(getattr(self, quantity))
        function = ca.Function("evaluate", [ca.vertcat(*self.symbols.values())], [ca.densify(expression)])
        result = np.asarray(function([*numbers.values()]))
        return result[:, 0] if result.shape[1] == 1 else result

    def numbers(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Number for each symbol by name: from ``values``, else its start value or 0.

        :raises ComponentError: for an unknown symbol.
        """
        symbols = self.symbols
        for symbol in values:
            if symbol not in symbols:
                raise ComponentError(f"{self.name}: unknown symbol {symbol!r}{suggestion(symbol, symbols)}")
        return dict.fromkeys(symbols, 0.0) | self.mechanism.start_values() | dict(values)


def derive(component: type[Mechanism]) -> Equations:
    """Equations of motion of a mechanism, derived from its Lagrangian.

    :param component: a subclass of Mechanism.
    """
    m = component()
    # Common subexpressions first, so that derivatives cost as much as the energies.
    kinetic, potential, L = ca.cse([ca.SX(e) for e in (m.kinetic_energy(), m.potential_energy(), m.lagrangian())])
    friction = Dissipation(ca.SX(m.friction_coefficient()), kinetic, ca.cse(ca.SX(m.dissipation_function())))
    applied, dynamics, constraints = applied_forces(m, friction), dynamics_of(m, L), differentiated_constraints(m)
    velocities, mu = constrained_velocities(m, dynamics.inertia, dynamics.velocities, constraints)
    lambdas = multipliers(dynamics.inertia, dynamics.bias + applied.on_free, constraints)
    accelerations, operator_forces = _accelerations_and_operator_forces(m, applied, dynamics, constraints, lambdas)
    return Equations(
        mechanism=m,
        lagrangian=L,
        kinetic_energy=kinetic,
        potential_energy=potential,
        applied=applied,
        dynamics=dynamics,
        constraints=constraints,
        velocities=velocities,
        constraint_stabilization=m.free.frame @ (2 * STABILISATION * mu),
        constraint_forces=lambdas,
        accelerations=accelerations,
        operator_forces=operator_forces,
    )


def _accelerations_and_operator_forces(
    m: Mechanism, applied: AppliedForces, dynamics: Dynamics, constraints: Constraints, lambdas: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Accelerations ẍ (f,), and forces of the operators (a,): λ = d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s (M eq. 27).

    The operator of a rheonomic constraint exerts its multiplier.

    :param lambdas: multipliers of all constraints (c,).
    """
    on_active = applied.on_active + constraints.gradients_along(m) @ lambdas[list(constraints.holonomic), 0]
    accelerations, forces = dynamics.forward(applied.on_free + constraints.matrix.T @ lambdas, on_active)
    # Dense: no force where nothing is moved.
    return accelerations, ca.densify(ca.vertcat(forces, lambdas[len(m.passive_constraints) :, 0]))
