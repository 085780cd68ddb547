"""The mass matrix A = ∂²L/∂q̇∂q̇ of a mechanism, and A⁻¹ at a cost that follows its structure.

A tree of links has a dense A, whose factorization costs f³.  But the points that carry its masses depend each on few
coordinates and on the point before.  With their rates ẇ as unknowns beside q̇, A q̇ = r becomes a sparse system,

    H (q̇, ẇ) + Gᵀ π = (r, 0),    G (q̇, ẇ) = F_q q̇ + F_w ẇ - ẇ = 0,    H = ∂²L/∂(q̇, ẇ)²

whose elimination from the leaves inward is the articulated-body method (Featherstone 2008, ch. 7).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca

from liaisons.algebra import Factors, hessian, stack
from liaisons.language import Mechanism

MANY = 8
"""Number of degrees of freedom from which a sparse system is tried."""


_System = tuple[ca.SX, dict[int, set[int]]]
"""Symmetric matrix, and for some unknowns those to be eliminated before them."""

NEGLIGIBLE = 1e-10
"""Relative square of a constraint's gradient below which the constraint is redundant."""


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass matrix of a mechanism, (f, f), and the linear system by which it is solved."""

    matrix: ca.SX
    system: ca.SX  # A itself, or an equivalent sparse system; (f + more, f + more)
    after: Mapping[int, set[int]] | None = None  # see _elimination_order; None: dense

    def solve(self, right: ca.SX) -> ca.SX:
        """Solution A⁻¹ right, for a column or a matrix of f rows."""
        if self.system.shape == (1, 1):
            return right / self.system
        return self._factored_system.solve(self._padded_with_zeros(right))[: self.matrix.shape[0], :]

    def solve_constrained(
        self, C: ca.SX, f: ca.SX, c: ca.SX, squares: ca.SX, *, iterated: bool = True
    ) -> tuple[ca.SX, ca.SX]:
        """Solution x, λ of A x = f + Cᵀ λ and C x = c (K eq. 7, 9); C is (c, f) of any rank.

        Where C loses rank, C A⁻¹ Cᵀ is singular: (C A⁻¹ Cᵀ + S) λ = c - C A⁻¹ f is solved in its place, S diagonal and
        small, and once more for what S λ was wrong by (Tikhonov's regularisation, iterated).  Of what a constraint
        demands 1 - (S/(σ² + S))² is met, σ being a singular value of C A⁻½: all of it, but for σ² near S where nothing
        could be relied on.  Redundant constraints share their force.

        :param squares: of the entries that C has somewhere near, (c, f); they say what is small.
        :param iterated: false where the result is a step of an iteration anyway.
        """
        slack = self._slack(squares)
        if self.after is None:
            towards = self.solve(C.T)
            weights, _ = self._constrained_factors(C, slack)
            multipliers = weights.solve(c - C @ self.solve(f))
            if iterated:
                multipliers += weights.solve(slack * multipliers)
            return self.solve(f) + towards @ multipliers, multipliers
        free, size = C.shape[1], self.system.shape[0]
        factors, _ = self._constrained_factors(C, slack)
        solution = factors.solve(ca.vertcat(self._padded_with_zeros(f), c))
        if iterated:
            solution += factors.solve(ca.vertcat(ca.SX(size, 1), -slack * solution[size:]))
        return solution[:free], -solution[size:]

    def independence(self, C: ca.SX, squares: ca.SX) -> ca.SX:
        """Square of what of each constraint's gradient does not depend on others, relative to its usual one (c,)."""
        slack = self._slack(squares)
        factors, pivots = self._constrained_factors(C, slack)
        return NEGLIGIBLE * ca.fabs(factors.D[pivots]) / slack

    def _slack(self, squares: ca.SX) -> ca.SX:
        return NEGLIGIBLE * squares @ (1 / ca.diag(self.matrix))

    def _constrained_factors(self, C: ca.SX, slack: ca.SX) -> tuple[Factors, list[int]]:
        """Factors of C A⁻¹ Cᵀ + S, or of the sparse system with C; the pivot of each constraint in D."""
        count, free, size = C.shape[0], C.shape[1], self.system.shape[0]
        if self.after is None:
            return Factors.of(C @ self.solve(C.T) + ca.diag(slack)), list(range(count))
        wide = ca.horzcat(C, ca.SX(count, size - free))
        system = ca.vertcat(ca.horzcat(self.system, wide.T), ca.horzcat(wide, -ca.diag(slack)))
        # The pivot of a multiplier comes from the coordinates that its constraint holds.
        held = {size + j: {i for i in range(free) if C.sparsity().has_nz(j, i)} for j in range(count)}
        order, _ = _elimination_order(system.sparsity(), {**self.after, **held})
        return Factors.of(system, order), [order.index(size + j) for j in range(count)]

    @cached_property
    def _factored_system(self) -> Factors:
        """Factors of the system, in the cheapest order of pivots."""
        order = None if self.after is None else _elimination_order(self.system.sparsity(), self.after)[0]
        return Factors.of(self.system, order)

    def _padded_with_zeros(self, right: ca.SX) -> ca.SX:
        """Right sides of A with zeros for the further unknowns of the system."""
        return ca.vertcat(right, ca.SX(self.system.shape[0] - right.shape[0], right.shape[1]))


def inertia_of(m: Mechanism, lagrangian: ca.SX) -> Inertia:
    """Mass matrix A = ∂²L/∂q̇∂q̇ (the metric g_ij of M eq. 42), with the cheapest system to solve by it."""
    A = hessian(lagrangian, m.free.q_dot)
    if A.shape[0] < MANY or ca.depends_on(A, m.free.q_dot):
        return Inertia(A, A)
    systems: list[_System] = [(A, {}), *_lifted_systems(m)]
    # Products of the elimination, and a few for each entry.
    return Inertia(A, *min(systems, key=lambda x: _elimination_order(x[0].sparsity(), x[1])[1] + 4 * x[0].nnz()))


def _lifted_systems(m: Mechanism) -> Iterator[_System]:
    """Yield the system in (q̇, ẇ, π) if some points have masses of their own."""
    names = [point.name for point in m.points]
    while names:  # without those that carry no mass
        twin = m.with_symbolic_points(names)
        x_dot = ca.vertcat(m.free.q_dot, twin.placeholders.w_dot)
        H = hessian(ca.SX(twin.lagrangian()), x_dot)
        f, w = m.free.q_dot.shape[0], twin.placeholders.w_dot.shape[0]
        heavy = [f + i for i in range(w) if H.sparsity().has_nz(f + i, f + i)]
        if len(heavy) == w:
            yield _bordered_system(m, twin, H)
            return
        massive = {str(twin.placeholders.w_dot[i - f]) for i in heavy}
        names = [name for name in names if all(f"{name}_{axis}_dot" in massive for axis in getattr(m, name))]


def _bordered_system(m: Mechanism, twin: Mechanism, H: ca.SX) -> _System:
    """System of the Hessian H in (q̇, ẇ), bordered by G, whose rows tie ẇ to q̇."""
    f, w = m.free.q_dot.shape[0], twin.placeholders.w_dot.shape[0]
    places = stack(value for name in twin.placeholders.names for value in getattr(type(m), name).method(twin).values())
    slope = ca.horzcat(ca.jacobian(places, m.free.q) @ m.free.kinematics, ca.jacobian(places, twin.placeholders.w))
    G = slope - ca.horzcat(ca.SX(w, f), ca.SX.eye(w))
    system = ca.vertcat(ca.horzcat(H, G.T), ca.horzcat(G, ca.SX(w, w)))

    # Pivots: ẇ has its own mass; π has that of its ẇ once this is eliminated; q̇ gets that of all its points.
    after = {f + w + i: {f + i} for i in range(w)}
    for i in range(f):
        if not H.sparsity().has_nz(i, i):
            after[i] = {f + w + row for row in range(w) if G.sparsity().has_nz(row, i)}
    # In terms of q alone, as everything else is.
    values = stack(value for name in twin.placeholders.names for value in getattr(m, name).values())
    return ca.substitute(system, twin.placeholders.w, values), after


def _elimination_order(pattern: ca.Sparsity, after: Mapping[int, set[int]]) -> tuple[list[int], int]:
    """Order of elimination by minimum degree, which has little fill-in, and its cost.

    :param pattern: of a symmetric matrix.
    :param after: for each unknown, those to be eliminated before it, so that its pivot does not vanish.
    :returns: unknowns in this order, and the number of products that it takes.
    """
    neighbours = [set(pattern.row()[start:end]) - {i} for i, (start, end) in enumerate(pairwise(pattern.colind()))]
    left, order, work = set(range(len(neighbours))), [], 0
    waits = [0] * len(neighbours)  # for so many pivots, one after the other
    while left:
        ready = (i for i in left if not after.get(i, set()) & left)
        chosen = min(ready, key=lambda i: (len(neighbours[i]), waits[i], i))
        for i in neighbours[chosen]:
            neighbours[i] |= neighbours[chosen]
            neighbours[i] -= {i, chosen}
            waits[i] = max(waits[i], waits[chosen] + 1)
        left.remove(chosen)
        order.append(chosen)
        work += len(neighbours[chosen]) ** 2
    return order, work
