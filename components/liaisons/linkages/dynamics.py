"""Terms of Lagrange's equations of a linkage, by recursion over its bodies."""

import casadi as ca

from liaisons.algebra import gradient
from liaisons.linkages.linkage import Linkage
from liaisons.linkages.recursion import Recursion
from liaisons.mechanics import Dynamics, Inertia


def by_recursion(m: Linkage) -> Dynamics | None:
    """Terms of the equations of a linkage; None if its class has energies of its own."""
    if not m.has_derived_energies:
        return None
    recursion = Recursion(m)
    spring, on_operators = elastic_forces(m)
    A = recursion.mass_matrix

    def forward(on_free: ca.SX, on_active: ca.SX) -> tuple[ca.SX, ca.SX]:
        adapted = on_active.shape[0]
        accelerations, forces = recursion.accelerations(on_free + spring)
        return accelerations, forces[:adapted, 0] - on_operators[:adapted, 0] - on_active

    return Dynamics(
        momenta=recursion.generalised_momenta,
        inertia=Inertia(A, A),
        velocities=recursion.rates(m.free.frame.T @ m.free.p),
        convergence=ca.SX(0, 1),
        lagrangian_gradient=recursion.lagrangian_gradient + spring,
        bias=spring - recursion.bias_forces,
        forward=forward,
    )


def elastic_forces(m: Linkage) -> tuple[ca.SX, ca.SX]:
    """Generalised forces of the springs on the free velocities (f,) and the active coordinates (a,)."""
    elastic = ca.cse(ca.SX(m.elastic_energy()))
    return -m.free.kinematics.T @ gradient(elastic, m.free.q), -gradient(elastic, m.active.s)
