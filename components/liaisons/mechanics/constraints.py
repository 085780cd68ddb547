"""Constraints in accelerations, C ẍ = c: their multipliers, stabilisation and projection.

Passive constraints σ(x) = 0 (K eq. 2), rheonomic ones π(x) = σ(t) (M eq. 20) and non-holonomic constraints ρ(x, ẋ) = 0
(K eq. 110) differ in how often they are differentiated; after that they are rows of one linear system.
"""

from dataclasses import dataclass

import casadi as ca

from liaisons.algebra import at_zero, jacobian, stack
from liaisons.language import Mechanism
from liaisons.mechanics.inertia import NEGLIGIBLE, Inertia

STABILISATION = 10.0
"""Decay rate of residuals [1/s] (Baumgarte), which keeps model exchange on the constraints."""

DOUBTFUL = 30.0
"""Relative residuals up to which a singular value of the constraints may be an error that they make."""

_LARGEST_DOUBT = 1e-3
"""Square of a singular value that is relied on however large residuals are."""

_HELD = 1e-4
"""Slack of a given rate beside that of a constraint: where both cannot hold, the constraint is broken, and refused."""

ROUNDS = 3
"""Newton steps of a projection: from the error of one integration step to rounding."""

KEPT = 1e-9
"""Residual, relative to what coordinates of nominal size make of it, up to which a constraint is kept."""
KEPT_RATE = 1e-7
"""The same for its rate, which momenta give only as exactly as the mass matrix is conditioned."""

ROUNDING = 1e-13
"""Residual, in its own unit, that is rounding where its gradient vanishes."""


@dataclass(frozen=True, eq=False)
class Constraints:
    """All constraints of a mechanism: passive, non-holonomic, rheonomic, in this order."""

    matrix: ca.SX  # C (c, f)
    squares: ca.SX  # of the entries of C nearby, also where C itself vanishes (c, f)
    targets: ca.SX  # c (c,)
    residuals: ca.SX  # violations (c,)
    rate_residuals: ca.SX  # violations of the derivatives; of non-holonomic constraints, the violations (c,)
    holonomic: tuple[int, ...]  # rows, passive or rheonomic
    alpha: float  # a residual r obeys r̈ + 2α ṙ + α² r = 0, of a non-holonomic constraint ṙ + α r = 0 [1/s]

    def gradients_along(self, m: Mechanism) -> ca.SX:
        """Gradients of the holonomic constraints along the adapted active coordinates (a, number of these)."""
        return ca.jacobian(self.residuals[list(self.holonomic), 0], m.active.adapted_columns[0]).T


def differentiated_constraints(m: Mechanism, alpha: float = STABILISATION) -> Constraints:
    """Differentiate the constraints of a mechanism until accelerations appear (K eq. 8, 9; KC2 of the errata).

    :param alpha: a residual r obeys r̈ + 2α ṙ + α² r = 0 instead of r̈ = 0, where it would grow linearly [1/s].
    """
    rows: list[tuple[ca.SX, ca.SX, ca.SX]] = []  # residual, its rate, and what vanishes at the right accelerations

    def append_constraint(phi: ca.SX, sigma: ca.SX, sigma_dot: ca.SX, sigma_ddot: ca.SX) -> None:
        phi_dot = m.dot(phi)
        r, r_dot = phi - sigma, phi_dot - sigma_dot
        rows.append((r, r_dot, m.dot(phi_dot) - sigma_ddot + 2 * alpha * r_dot + alpha**2 * r))

    for item in m.constraints:
        append_constraint(getattr(m, item.name), *(ca.SX(0),) * 3)
    for item in m.non_holonomic:
        rho = getattr(m, item.name)
        rows.append((rho, rho, m.dot(rho) + alpha * rho))
    for item in m.rheonomic_constraints:
        append_constraint(getattr(m, item.name), *(m.symbols[f"{item.name}{end}"] for end in ("", "_dot", "_ddot")))

    residuals, rate_residuals, accelerated = (stack(row[i] for row in rows) for i in range(3))
    first, last = len(m.constraints), len(m.passive_constraints)
    matrix = jacobian(accelerated, m.free.q_ddot)
    return Constraints(
        matrix=matrix,
        squares=_squared_coefficients(m, matrix),
        targets=-at_zero(accelerated, m.free.q_ddot),
        residuals=residuals,
        rate_residuals=rate_residuals,
        holonomic=tuple(i for i in range(len(rows)) if not first <= i < last),
        alpha=alpha,
    )


def _squared_coefficients(m: Mechanism, C: ca.SX) -> ca.SX:
    """Squares of the entries of C, plus those of their changes over the nominal value of each coordinate (c, f)."""
    entries = stack(C[i, j] for i, j in zip(*C.sparsity().get_triplet(), strict=True))
    changes = ca.jacobian(entries, m.free.q) @ ca.diag(m.free.sizes)
    return ca.SX(C.sparsity(), entries**2 + ca.sum2(changes**2))


def residuals_by_rounding(m: Mechanism, constraints: Constraints) -> ca.SX:
    """Residuals in units of what a projection leaves where the constraints can be kept; within 1 they are (c,).

    That is far more than rounding, and far less than what is missing where a prescribed coordinate goes too far.
    """
    C, q_dot = constraints.matrix, m.free.q_dot
    coordinates, rates = (ca.repmat(column.T, C.shape[0], 1) for column in (m.free.rate_sizes, q_dot))
    moved = ca.jacobian(constraints.residuals, m.active.s) * ca.repmat(m.active.s.T, C.shape[0], 1)
    scales = ca.sqrt(ca.sum2((C * coordinates) ** 2) + ca.sum2(moved**2))
    fast = ca.sqrt(ca.sum2((C * coordinates) ** 2) + ca.sum2((C * rates) ** 2))
    allowed = [
        KEPT * scales[i] + ROUNDING if i in constraints.holonomic else KEPT_RATE * fast[i] + ROUNDING
        for i in range(C.shape[0])
    ]
    return ca.SX(constraints.residuals / stack(allowed)) if allowed else ca.SX(0, 1)


def constrained_velocities(
    m: Mechanism, metric: Inertia, loose: ca.SX, constraints: Constraints
) -> tuple[ca.SX, ca.SX]:
    """Velocities ẋ on the holonomic constraints and the correction Cᵀ μ of momenta: A (ẋ - loose) = Cᵀ μ, C ẋ = σ̇.

    Between two projections the stages of a solver leave the constraints.  Where these come close to a singular
    configuration (the rods of a parallelogram in line), the error of the velocities would be divided by the distance to
    it.  The remedy is that of Gear, Gupta and Leimkuhler (J. Comp. Appl. Math. 12, 1985).

    :param loose: A⁻¹ (p - b), which may violate the constraints (f,).
    :returns: ẋ (f,), and the correction Cᵀ μ of the momenta (f,).
    """
    rows, q_dot = list(constraints.holonomic), m.free.q_dot
    if not rows:
        return loose, ca.SX.zeros(loose.shape)
    C, zero = constraints.matrix[rows, :], ca.SX.zeros(loose.shape)
    # A residual decays by this, too.
    off = (
        ca.substitute(constraints.rate_residuals[rows, 0], q_dot, loose)
        + STABILISATION * constraints.residuals[rows, 0]
    )
    correction, mu = metric.solve_constrained(C, zero, -off, constraints.squares[rows, :])
    return loose + correction, C.T @ mu


def multipliers(metric: Inertia, f: ca.SX, constraints: Constraints) -> ca.SX:
    """Multipliers λ with C ẍ = c and A ẍ = f + Cᵀ λ, by d'Alembert (K eq. 7, 9); (c,)."""
    C = constraints.matrix
    if C.shape[0] == 0:
        return ca.SX(0, 1)
    return metric.solve_constrained(C, f, constraints.targets, constraints.squares)[1]


def accelerations_by_gauss(A: ca.SX, f: ca.SX, constraints: Constraints) -> tuple[ca.SX, ca.SX]:
    """Accelerations by Gauss's principle: ½ (ẍ − A⁻¹f)ᵀ A (ẍ − A⁻¹f) is least under C ẍ = c (K 4).

    A second way beside :func:`multipliers`: one linear system for accelerations and multipliers together (K eq.
    112-113, signs corrected), solved by QR, where the other eliminates the accelerations first.

    :returns: accelerations (f,) and the multipliers μ = −λ (c,).
    """
    C = constraints.matrix
    count, free = C.shape
    system = ca.vertcat(ca.horzcat(A, C.T), ca.horzcat(C, ca.SX(count, count)))
    solution = ca.solve(ca.densify(system), ca.vertcat(f, constraints.targets))
    return solution[:free], solution[free:]


def projection(m: Mechanism, metric: Inertia, velocities: ca.SX, constraints: Constraints) -> ca.SX | None:
    """State (x, p) on the constraints and with unit quaternions, projected by Newton's method in the metric A.

    :returns: column of configuration and momenta; None without constraints and orientations.
    """
    if constraints.matrix.shape[0] == 0 and not m.orientations:
        return None
    q, p = m.free.q, m.free.p
    on_constraints = _projected_coordinates(m, metric, constraints)
    momenta, C, zero = p, constraints.matrix, ca.SX.zeros(*p.shape)
    # Holonomic constraints are linear in the rates: one full step is enough.
    rounds = ROUNDS if m.non_holonomic else min(C.shape[0], 1)
    for _ in range(rounds):
        _, push = metric.solve_constrained(
            C, zero, constraints.rate_residuals, constraints.squares, iterated=rounds == 1
        )
        kicked = ca.substitute(p - m.free.frame @ (C.T @ push), m.free.q_dot, velocities)
        momenta = ca.substitute(kicked, ca.vertcat(q, p), ca.vertcat(on_constraints, momenta))
    return ca.vertcat(on_constraints, momenta)


def consistent_momenta(m: Mechanism, metric: Inertia, loose: ca.SX, constraints: Constraints, given: ca.SX) -> ca.SX:
    """Momenta whose rates keep holonomic constraints and differ least from A⁻¹ (p - b), but in no rate that is given.

    :param loose: A⁻¹ (p - b) (f,).
    :param given: 1 for each rate that is, else 0 (f,).
    """
    rows, zero = list(constraints.holonomic), ca.SX.zeros(*m.free.p.shape)
    if not rows:
        return m.free.p
    C, held = ca.vertcat(constraints.matrix[rows, :], ca.diag(given)), ca.diag(_HELD * ca.SX.ones(*given.shape))
    residuals = ca.vertcat(ca.substitute(constraints.rate_residuals[rows, 0], m.free.q_dot, loose), zero)
    _, push = metric.solve_constrained(C, zero, residuals, ca.vertcat(constraints.squares[rows, :], held))
    return m.free.p - m.free.frame @ (C.T @ push)


def _projected_coordinates(m: Mechanism, metric: Inertia, constraints: Constraints) -> ca.SX:
    """Coordinates on the holonomic constraints and with unit quaternions, after Newton's method."""
    q, rows = m.free.q, list(constraints.holonomic)
    moved = _with_normalized_quaternions(m, q)
    if rows:
        C = constraints.matrix[rows, :]
        residuals, squares = constraints.residuals[rows, 0], constraints.squares[rows, :]
        # Off the constraints by a relative δ redundant ones have singular values of order δ, which say nothing.
        if len(rows) > 1:
            off = ca.sumsqr(residuals / ca.sqrt(squares @ m.free.rate_sizes**2))
            squares *= 1 + ca.fmin(DOUBTFUL**2 * off, _LARGEST_DOUBT) / NEGLIGIBLE
        away, _ = metric.solve_constrained(C, ca.SX.zeros(*m.free.p.shape), residuals, squares, iterated=False)
        step = _with_normalized_quaternions(m, q - m.free.kinematics @ away)
        for _ in range(ROUNDS):
            moved = ca.substitute(step, q, moved)
    return moved


def _with_normalized_quaternions(m: Mechanism, q: ca.SX) -> ca.SX:
    """Coordinates with each quaternion divided by its norm."""
    count = len(m.coordinates)
    quaternions = (q[i : i + 4, 0] for i in range(count, q.shape[0], 4))
    return ca.vertcat(q[:count, 0], *(quaternion / ca.norm_2(quaternion) for quaternion in quaternions))
