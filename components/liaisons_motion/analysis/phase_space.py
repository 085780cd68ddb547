"""Hamilton's mechanics: Legendre transform, Poisson brackets, volume of phase space (K 3.2-3.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.algebra import gradient
from liaisons.errors import ComponentError, suggestion
from liaisons.mechanics import Equations
from liaisons_motion.analysis.numeric import final_state, value_at_zero, with_values
from liaisons_motion.analysis.quantity import (
    Formula,
    Quantity,
    Source,
    equations_of,
    generator_matrix,
    orientation_cross_products,
    require_constants_at_rest,
    require_free_coordinates,
    require_no_constraints,
    require_no_contacts,
)


def hamiltonian(source: Source) -> Quantity:
    """Hamiltonian H(q, p) = Σ q̇_k p_k - L with q̇ expressed by p (K eq. 29, L taken once; 80) [J].

    It is T + V if T is quadratic in the free rates.  While the operator moves it is not the energy but generates the
    motion at the prescribed s(t): H̃ - Σ Y^β p_β of M eq. 46 with Y = ṡ.

    :raises ComponentError: for constraints.
    """
    equations = equations_of(source)
    require_no_constraints(equations, "a Hamiltonian")
    q_dot = equations.mechanism.free.q_dot
    H = ca.dot(q_dot, equations.momenta) - equations.lagrangian
    return Quantity(equations, ca.substitute(H, q_dot, equations.velocities))


def hamilton_equations(source: Source) -> Quantity:
    """Hamilton's equations q̇ = ∂H/∂p, ṗ = -∂H/∂q (K eq. 81, 82) without friction, drives and loads; (n + f,).

    An orientation has its quaternion among the q, ∂/∂q by turns about the axes of the inertial frame, and -p × ∂H/∂p
    more in ṗ, as turns do not commute.

    :raises ComponentError: for constraints and contacts; when evaluated, for friction, drives and loads.
    """
    H = hamiltonian(source)
    require_no_contacts(H.equations, "Hamilton's motion")
    require_free_coordinates(H.equations, "Hamilton's motion")
    return Quantity(H.equations, ca.vertcat(*hamiltonian_field(H.equations, H.expression)), conservative=True)


def hamiltonian_field(equations: Equations, h: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Rates q̇ (n,) and ṗ (f,) of the motion that a function h(q, p) generates."""
    p, G = equations.mechanism.free.p, generator_matrix(equations)
    rates = gradient(h, p)
    return G @ rates, -G.T @ gradient(h, equations.mechanism.free.q) - orientation_cross_products(equations, p, rates)


def poisson_bracket(u: Quantity, v: Quantity) -> Quantity:
    """Poisson bracket {u, v} = Σ (∂u/∂p ∂v/∂q - ∂v/∂p ∂u/∂q) (K eq. 87), so that {p, q} = +1.

    This is K's sign, and Landau's; many texts have the opposite one.  For the angular momentum of an orientation
    {H_x, H_y} = -H_z, as for that of a particle.  da/dt = ∂a/∂t + {H, a} (eq. 88) is :meth:`Quantity.time_derivative`.

    :param u: scalars on the phase space of one mechanism, from :func:`observable` or :func:`hamiltonian`.
    :raises ComponentError: for quantities of two mechanisms, or constraints.
    """
    equations = u.equations
    if v.equations is not equations:
        raise ComponentError(
            f"poisson_bracket: quantities of {equations.name} and {v.equations.name} share no phase space; "
            "make both from one class"
        )
    require_no_constraints(equations, "a Poisson bracket")
    q, p, G = equations.mechanism.free.q, equations.mechanism.free.p, generator_matrix(equations)
    first, second = equations.in_phase_space(u.expression), equations.in_phase_space(v.expression)
    (u_p, u_q), (v_p, v_q) = ((gradient(w, p), G.T @ gradient(w, q)) for w in (first, second))
    return Quantity(
        equations, ca.dot(u_p, v_q) - ca.dot(v_p, u_q) - ca.dot(p, orientation_cross_products(equations, u_p, v_p))
    )


def phase_velocity(source: Source) -> Quantity:
    """Phase velocity V(X) of X = (q, p, internal states), with friction, drives and loads (K eq. 95); a column.

    :raises ComponentError: for constraints and contacts.
    """
    equations = equations_of(source)
    require_no_constraints(equations, "phase space")
    require_no_contacts(equations, "a phase velocity")
    require_free_coordinates(equations, "phase space")
    q_dot = equations.mechanism.free.kinematics @ equations.velocities
    column = ca.vertcat(q_dot, equations.momentum_rates, equations.internal_rates)
    return Quantity(equations, equations.in_phase_space(column))


def divergence(source: Source) -> Quantity:
    """Divergence ∇·V = Σ_{k=1}^f (∂q̇_k/∂q_k + ∂ṗ_k/∂p_k) (K eq. 100, 101 corrected) [1/s]: zero without friction.

    The four components of a quaternion count like coordinates: V leaves its norm alone.

    :raises ComponentError: for constraints and contacts.
    """
    V = phase_velocity(source)
    return Quantity(V.equations, ca.trace(ca.jacobian(V.expression, _state_vector(V.equations))))


@dataclass(frozen=True, eq=False)
class Flow:
    """State after a duration, and its derivative by the initial state."""

    state: dict[str, float]  # q, p_q and internal states at the end
    jacobian: NDArray  # J = ∂X(t)/∂X(0) of K eq. 98, (n, n), in the order of ``state``

    @property
    def determinant(self) -> float:
        """det J, the growth of a volume of phase space (K eq. 97, 102): 1 without friction."""
        return float(np.linalg.det(self.jacobian))


def flow(source: Source, duration: float, **values: Any) -> Flow:
    """State after a duration, and its derivative J by the initial state (K 3.4, eq. 94, 98).

    J is integrated with the state, by the variational equations J̇ = (∂V/∂X) J, J(0) = 1.

    :param duration: time [s], > 0.
    :param values: start by ``q``, ``q_dot``, internal states; parameters; active coordinates, each a number or a
        function of time, from CasADi expression to expression, e.g. ``length=lambda t: 1 + 0.1 * ca.sin(t)``.
    :raises ComponentError: for constraints and contacts, an unknown symbol, a duration that is not > 0, or a motion
        that cannot be continued.
    """
    V = phase_velocity(source)
    equations, owner = V.equations, V.equations.name
    require_constants_at_rest(equations, values)
    if not (duration > 0 and np.isfinite(duration)):
        raise ComponentError(f"{owner}: duration = {duration} must be finite and > 0")
    t, X = ca.SX.sym("t"), _state_vector(equations)
    velocity, begin = V.expression, dict(values)
    for name, drive in values.items():
        if callable(drive):
            sigma, sigma_dot = _prescribed_motion(equations, name, drive, t)
            symbols = ca.vertcat(equations.symbols[name], equations.symbols[f"{name}_dot"])
            velocity = ca.substitute(velocity, symbols, ca.vertcat(sigma, sigma_dot))
            begin |= {f"{name}{end}": value_at_zero(e, t) for end, e in (("", sigma), ("_dot", sigma_dot))}
    start, J = Quantity(equations, X).evaluate(**begin), ca.SX.sym("J", X.shape[0], X.shape[0])
    velocity = with_values(equations, velocity, begin, X)
    rate = ca.vertcat(velocity, ca.vec(ca.jacobian(velocity, X) @ J))
    beginning = np.concatenate([start, np.eye(start.size).ravel()])
    state = ca.vertcat(X, ca.vec(J))
    end = final_state(rate, state, beginning, t=t, duration=duration, owner=owner)
    names = map(str, ca.vertsplit(X))
    return Flow(
        dict(zip(names, end[: start.size].tolist(), strict=True)), end[start.size :].reshape(J.shape, order="F")
    )


def _state_vector(equations: Equations) -> ca.SX:
    """State vector X = (q, p, internal states)."""
    m = equations.mechanism
    return ca.vertcat(m.free.q, m.free.p, m.internal)


def _prescribed_motion(equations: Equations, name: str, drive: Formula, t: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Expressions σ(t) of an active coordinate and of its rate."""
    names = [item.name for item in equations.mechanism.actives]
    if name not in names:
        raise ComponentError(
            f"{equations.name}: only an active coordinate can be a function of time, not {name!r}"
            f"{suggestion(name, names)}"
        )
    sigma = ca.SX(drive(t))
    return sigma, ca.jacobian(sigma, t)
