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
from typing import Any

import casadi as ca
import numpy as np

from liaisons.algebra import gradient, jacobian, stack
from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError, suggestion
from liaisons.language import Mechanism
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
from liaisons.mechanics.dynamics import dynamics_of
from liaisons.mechanics.friction import Dissipation
from liaisons.mechanics.inertia import Inertia

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
    drives: ca.SX  # generalised forces q_force on the coordinates
    loads: ca.SX  # q_load
    point_loads: ca.SX  # (number of point components,) P_x_load
    points: dict[str, ca.SX]  # "bob_x" -> expression
    lagrangian: ca.SX
    kinetic_energy: ca.SX
    potential_energy: ca.SX
    inertia: Inertia  # A, and how it is inverted
    momenta: ca.SX  # ∂L/∂ẋ (f,)
    velocities: ca.SX  # ẋ as function of (x, p, s, σ̇) (f,)
    unconstrained_velocities: ca.SX  # A⁻¹ (p − b), which may violate constraints (f,)
    momentum_rates: ca.SX  # ṗ (f,)
    constraint_stabilization: ca.SX  # added to ṗ, so that momenta across the constraints decay (f,)
    accelerations: ca.SX  # ẍ (f,)
    operator_forces: ca.SX  # λ (a,)
    effective_mass: ca.SX  # Θ (a, a)
    forces: ca.SX  # f: A ẍ = f + Cᵀ λ (f,)
    applied_forces: ca.SX  # Q, then Q_s on adapted coordinates, with forces of constraints whose λ are symbols
    constraints: Constraints  # C ẍ = c
    independence: ca.SX  # of each constraint from the others; near 0 they lose rank (c,)
    multipliers: ca.SX  # λ of the passive and non-holonomic constraints
    power: ca.SX  # through all ports
    friction: Dissipation
    dissipation: ca.SX  # power lost by friction and non-holonomic constraints
    internal_rates: ca.SX
    residuals_by_rounding: ca.SX  # within 1 where the constraints are kept (c,)
    projection: ca.SX | None  # of (x, p) onto constraints and unit quaternions
    start_momenta: ca.SX  # ∂L/∂ẋ at rates on the constraints, of which some are given
    given_rates: ca.SX  # symbols: 1 for those, else 0 (f,)
    convergence: ca.SX  # must stay > 0 if velocities belong to momenta (f,); (0,) where L is quadratic in ẋ

    @property
    def name(self) -> str:
        """Name of the component, for messages."""
        return type(self.mechanism).__name__

    @property
    def symbols(self) -> dict[str, ca.SX]:
        """Symbols of the mechanism, drives and loads, by name."""
        forces = ca.vertsplit(ca.vertcat(self.drives, self.loads, self.point_loads))
        return self.mechanism.symbols | {str(symbol): symbol for symbol in forces}

    @property
    def mass_matrix(self) -> ca.SX:
        """Mass matrix A (f, f)."""
        return self.inertia.matrix

    @property
    def state_rates(self) -> ca.SX:
        """Rates d/dt (q, p) for a solver, q with quaternions of orientations, p with stabilisation of constraints."""
        free = self.mechanism.free
        return ca.vertcat(free.kinematics @ free.q_dot, self.momentum_rates + self.constraint_stabilization)

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
    q, q_dot, K = m.free.q, m.free.q_dot, m.free.kinematics
    adapted = m.active.adapted
    s, s_dot = m.active.s[:adapted, 0], m.active.s_dot[:adapted, 0]
    # Common subexpressions first, so that derivatives cost as much as the energies.
    kinetic, potential, L = ca.cse([ca.SX(e) for e in (m.kinetic_energy(), m.potential_energy(), m.lagrangian())])
    rubbing = Dissipation(ca.SX(m.friction_coefficient()), kinetic, ca.cse(ca.SX(m.dissipation_function())))

    # Applied forces: drives and loads on free coordinates, loads at points by virtual work (K eq. 14), friction.
    drives, loads = (stack(ca.SX.sym(suffixed_name(q.name, end)) for q in m.coordinates) for end in ("_force", "_load"))
    points = m.point_components()
    position = ca.cse(stack(points.values()))
    point_loads = stack(ca.SX.sym(f"{name}_load") for name in points)
    applied = ca.vertcat(drives - loads, ca.SX.zeros(q_dot.shape[0] - drives.shape[0], 1))
    # Forces of contacts act along the gradients of their rates, on free and active coordinates.
    rates = m.contact_rates()
    slips = rates[len(m.unilaterals) :, 0]
    lifting = ca.dot(position, point_loads)  # its gradient at given loads is their virtual work
    Q = applied - K.T @ gradient(lifting, q) - rubbing.forces_against(q_dot)
    Q_s = -gradient(lifting, s) - rubbing.forces_against(s_dot)
    if rates.shape[0]:
        Q += jacobian(rates, q_dot).T @ m.contact_forces
        Q_s += jacobian(rates, s_dot).T @ m.contact_forces

    dynamics = dynamics_of(m, L)
    metric, loose = dynamics.inertia, dynamics.velocities
    force, f = dynamics.lagrangian_gradient + Q, dynamics.bias + Q  # the latter: A ẍ = f
    constraints = differentiated_constraints(m)
    C = constraints.matrix
    velocities, mu = constrained_velocities(m, metric, loose, constraints)
    lambdas = multipliers(metric, f, constraints)
    given = ca.SX.sym("given", q_dot.shape[0])
    p_dot = m.free.frame @ (force + C.T @ lambdas)

    # The operator: λ = d/dt ∂L/∂σ̇ − ∂L/∂s − Q_s along the motion; of a rheonomic constraint, its multiplier.
    passive = len(m.passive_constraints)
    rigid = list(constraints.holonomic)
    across = ca.jacobian(constraints.residuals[rigid, 0], s).T
    constrained = Q_s + across @ lambdas[rigid, 0]
    symbols = ca.vertcat(m.multipliers, m.active.force[adapted:, 0])
    applied_forces = ca.vertcat(Q + C.T @ symbols, Q_s + across @ symbols[rigid, 0])
    accelerations, lambda_s = dynamics.forward(Q + C.T @ lambdas, constrained)
    operator_forces = ca.densify(ca.vertcat(lambda_s, lambdas[passive:, 0]))  # no force where nothing is moved
    Theta = jacobian(operator_forces, m.active.s_ddot)

    # Power of non-holonomic constraints, which is neither drive nor load but leaves the energy.
    inner = list(range(len(m.constraints), passive))
    constraint_power = ca.dot(lambdas[inner, 0], C[inner, :] @ q_dot)
    power = (
        ca.dot(operator_forces, m.active.s_dot)
        + ca.dot(drives - loads, q_dot[: drives.shape[0], 0])
        - ca.dot(point_loads, m.dot(position))
    )
    dissipation = rubbing.power(ca.vertcat(q_dot, s_dot))
    if slips.shape[0]:
        dissipation -= ca.dot(m.contact_forces[len(m.unilaterals) :, 0], slips)
    return Equations(
        mechanism=m,
        drives=drives,
        loads=loads,
        point_loads=point_loads,
        points=points,
        lagrangian=L,
        kinetic_energy=kinetic,
        potential_energy=potential,
        inertia=metric,
        momenta=dynamics.momenta,
        velocities=velocities,
        unconstrained_velocities=loose,
        momentum_rates=p_dot,
        constraint_stabilization=m.free.frame @ (2 * STABILISATION * mu),
        accelerations=accelerations,
        operator_forces=operator_forces,
        effective_mass=Theta,
        forces=f,
        applied_forces=applied_forces,
        constraints=constraints,
        independence=metric.independence(C, constraints.squares) if C.shape[0] else ca.SX(0, 1),
        multipliers=lambdas[:passive, 0],
        power=power,
        friction=rubbing,
        dissipation=dissipation - constraint_power,
        internal_rates=m.internal_rate_column(),
        residuals_by_rounding=residuals_by_rounding(m, constraints),
        projection=projection(m, metric, loose, constraints),
        start_momenta=consistent_momenta(m, metric, loose, constraints, given),
        given_rates=given,
        convergence=dynamics.convergence,
    )
