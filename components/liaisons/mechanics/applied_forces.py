"""Forces that act on a mechanism beside those of its Lagrangian: drives, loads, friction, contacts; and their power."""

from dataclasses import dataclass

import casadi as ca

from liaisons.algebra import gradient, jacobian, stack
from liaisons.base.array_names import suffixed_name
from liaisons.language import Mechanism
from liaisons.mechanics.friction import Dissipation


@dataclass(frozen=True, eq=False)
class AppliedForces:
    """Generalised forces of drives, loads, friction and contacts: f velocities, a adapted active coordinates."""

    mechanism: Mechanism
    drives: ca.SX  # generalised forces q_force on the coordinates
    loads: ca.SX  # q_load
    points: dict[str, ca.SX]  # "bob_x" -> expression
    position: ca.SX  # of all points, with common subexpressions shared (number of point components,)
    point_loads: ca.SX  # (number of point components,) P_x_load
    friction: Dissipation
    on_free: ca.SX  # Q (f,)
    on_active: ca.SX  # Q_s (a,)

    @property
    def outer(self) -> ca.SX:
        """Symbols of drives, loads, and loads at points, a column."""
        return ca.vertcat(self.drives, self.loads, self.point_loads)

    def power(self, operator_forces: ca.SX) -> ca.SX:
        """Power through all ports: Σ λ σ̇ of the operators (M eq. 28), drives and loads.

        :param operator_forces: λ, also of rheonomic constraints, in the order of the active coordinates.
        """
        m, count = self.mechanism, self.drives.shape[0]
        return (
            ca.dot(operator_forces, m.active.s_dot)
            + ca.dot(self.drives - self.loads, m.free.q_dot[:count, 0])
            - ca.dot(self.point_loads, m.dot(self.position))
        )

    @property
    def dissipation(self) -> ca.SX:
        """Power lost to friction, Σ q̇ ∂D/∂q̇ + Σ σ̇ ∂D/∂σ̇ (K eq. 67), and to dry friction."""
        m, (_, s_dot) = self.mechanism, self.mechanism.active.adapted_columns
        lost = self.friction.power(ca.vertcat(m.free.q_dot, s_dot))
        first = len(m.unilaterals)
        slips = m.contact_rates()[first:, 0]
        return lost - ca.dot(m.contact_forces[first:, 0], slips) if slips.shape[0] else lost


def applied_forces(m: Mechanism, friction: Dissipation) -> AppliedForces:
    """Applied forces Q and Q_s: drives and loads, loads at points by virtual work (K eq. 14), friction, contacts."""
    q, q_dot, K = m.free.q, m.free.q_dot, m.free.kinematics
    s, s_dot = m.active.adapted_columns
    drives, loads = (stack(ca.SX.sym(suffixed_name(q.name, end)) for q in m.coordinates) for end in ("_force", "_load"))
    points = m.point_components()
    position = ca.cse(stack(points.values()))
    point_loads = stack(ca.SX.sym(f"{name}_load") for name in points)
    lifting = ca.dot(position, point_loads)  # its gradient at given loads is their virtual work
    driven = ca.vertcat(drives - loads, ca.SX.zeros(q_dot.shape[0] - drives.shape[0], 1))
    Q = driven - K.T @ gradient(lifting, q) - friction.forces_against(q_dot)
    Q_s = -gradient(lifting, s) - friction.forces_against(s_dot)
    # Forces of contacts act along the gradients of their rates, on free and active coordinates.
    rates = m.contact_rates()
    if rates.shape[0]:
        Q += jacobian(rates, q_dot).T @ m.contact_forces
        Q_s += jacobian(rates, s_dot).T @ m.contact_forces
    return AppliedForces(m, drives, loads, points, position, point_loads, friction, Q, Q_s)
