"""Terms of Lagrange's equations: by differentiation of the Lagrangian, or by a method that a package brings."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from liaisons.algebra import at_zero, gradient
from liaisons.language import Mechanism
from liaisons.mechanics.inertia import Inertia, inertia_of
from liaisons.mechanics.legendre import convergence_margins, rates_from_momenta
from liaisons.mechanics.model import Equation


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Momenta and forces of a mechanism with f velocities and a adapted active coordinates, without applied forces Q.

    :param forward: generalised forces Q (f,) and Q_s (a,) → accelerations (f,), and forces λ of the operators (a,).
    """

    momenta: ca.SX  # ∂L/∂ẋ (f,)
    inertia: Inertia  # A
    velocities: ca.SX  # A⁻¹ (p − b), or by Newton's method; they may violate constraints (f,) (M eq. 36)
    convergence: ca.SX  # what must stay > 0 if they are right; (0,) where L is quadratic in ẋ
    lagrangian_gradient: ca.SX  # Kᵀ ∂L/∂x (f,)
    bias: ca.SX  # A ẍ = bias + Q (f,)
    forward: Callable[[ca.SX, ca.SX], tuple[ca.SX, ca.SX]]


def dynamics_of(m: Mechanism, L: ca.SX) -> Dynamics:
    """Terms of the equations of a mechanism with the Lagrangian L."""
    method = method_of(m)
    own = method.dynamics(m) if method else None
    return _by_differentiation(m, L) if own is None else own


@dataclass(frozen=True, slots=True, eq=False)
class Method:
    """How a kind of mechanisms is derived by other means than from its Lagrangian.

    :param dynamics: mechanism → terms of its equations; None: by differentiation.
    :param printed: equations → those for the documentation; None: as of any mechanism.
    """

    dynamics: Callable[[Any], Dynamics | None]
    printed: Callable[[Any], tuple[Equation, ...] | None]


def derive_by(
    kind: type[Mechanism],
    dynamics: Callable[[Any], Dynamics | None],
    printed: Callable[[Any], tuple[Equation, ...] | None],
) -> None:
    """Let the subclasses of a class be derived by other means than from their Lagrangian, see :class:`Method`."""
    _METHOD_OF[kind] = Method(dynamics, printed)


def method_of(m: Mechanism) -> Method | None:
    """Method by which a mechanism is derived; None: its Lagrangian is differentiated."""
    return next((method for kind in type(m).__mro__ if (method := _METHOD_OF.get(kind))), None)


_METHOD_OF: dict[type, Method] = {}


def _by_differentiation(m: Mechanism, L: ca.SX) -> Dynamics:
    q_dot, q_ddot = m.free.q_dot, m.free.q_ddot
    s, s_dot = m.active.adapted_columns
    # Momentum and its inverse.
    p, metric = gradient(L, q_dot), inertia_of(m, L)
    velocities, convergence = _velocities_and_margins(m, L, metric)
    lagrangian_gradient = m.free.kinematics.T @ gradient(L, m.free.q)
    # A ẍ = lagrangian_gradient + Q less the part of d/dt ∂L/∂ẋ without ẍ.
    bias = lagrangian_gradient + _gyroscopic_forces(m, p) - at_zero(m.dot(p), q_ddot)
    p_s = gradient(L, s_dot)
    resting = at_zero(m.dot(p_s), q_ddot)

    def forward(on_free: ca.SX, on_active: ca.SX) -> tuple[ca.SX, ca.SX]:
        accelerations = metric.solve(bias + on_free)
        return accelerations, resting + ca.jtimes(p_s, q_dot, accelerations) - gradient(L, s) - on_active

    return Dynamics(p, metric, velocities, convergence, lagrangian_gradient, bias, forward)


def _velocities_and_margins(m: Mechanism, L: ca.SX, metric: Inertia) -> tuple[ca.SX, ca.SX]:
    """Velocities ẋ of the momenta, p = A ẋ + b where L is quadratic, else by Newton's method with its margins > 0."""
    p, q_dot = m.free.frame.T @ m.free.p, m.free.q_dot
    if not ca.depends_on(metric.matrix, q_dot):
        return metric.solve(p - at_zero(gradient(L, q_dot), q_dot)), ca.SX(0, 1)
    return rates_from_momenta(L, q_dot, p), convergence_margins(L, q_dot, p, m.free.rate_sizes)


def _gyroscopic_forces(m: Mechanism, p: ca.SX) -> ca.SX:
    """Gyroscopic terms ∂L/∂ω × ω of orientations, 0 for coordinates: momenta ∂L/∂ω are in the body frame (f,)."""
    count = len(m.coordinates)
    rates = (getattr(m, orientation.name).rate for orientation in m.orientations)
    turning = [ca.cross(p[count + 3 * i : count + 3 * i + 3], rate) for i, rate in enumerate(rates)]
    return ca.vertcat(ca.SX.zeros(count, 1), *turning)
