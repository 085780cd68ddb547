"""Equations of motion of a linkage by recursion over its frames, at a cost that is linear in their number.

Spatial vectors are those of Featherstone (Rigid Body Dynamics Algorithms, 2008): motions (ω, v) and forces (n, f) about
the origin of a frame, with its axes.  X takes motions from the parent's frame, Xᵀ forces back; S are the axes of the
frame's coordinates, a their armature, I its spatial inertia, w the acceleration of gravity in its axes.  Lists have the
ground behind the last frame, at -1, the number of the parent that it is.

=============  =============================================================================================
velocities     v = X v_parent + S q̇
momenta        h = I v + Σ_children Xᵀ h;  p = Sᵀ h + a q̇
∂L/∂q          (X v_parent × S)ᵀ h + Sᵀ W,  W = I w + Σ_children Xᵀ W
q̇ of p, σ̇      inwards A = I, b = 0, and of each child, with U = A S, D = Sᵀ U + a, u = p − Sᵀ b:  A − U D⁻¹ Uᵀ and
               b + U D⁻¹ u; if it is prescribed A and b + U σ̇;  outwards q̇ = D⁻¹ (u − Uᵀ X v_parent)
q̈, λ           the same with forces, bias v ×* I v and turning X v_parent × S q̇: articulated bodies
mass matrix    composite rigid bodies
=============  =============================================================================================

The recursion of q̇ is Hamilton's form of the method of articulated bodies.
"""

import operator
from collections.abc import Callable, Iterable

import casadi as ca

from liaisons.algebra import solve_symmetric
from liaisons.linkages.joints import Frame, skew
from liaisons.linkages.linkage import Linkage


class Recursion:
    """Terms of Lagrange's equations of a linkage, by recursion.

    :param share: letter, number of a frame and a spatial vector of it → what stands for the vector in all that follows.
    """

    def __init__(self, m: Linkage, share: Callable[[str, int, ca.SX], ca.SX] = lambda *vectors: vectors[-1]) -> None:
        self.m, self.frames, self._share = m, m.frames, share
        self.inertias = [m.spatial_inertia(frame.body) for frame in m.frames]
        self.carried = [ca.SX(6, 1)] * len(m.frames)  # X v_parent
        self.velocities = [ca.SX(6, 1)] * (len(m.frames) + 1)
        for i, frame in enumerate(m.frames):
            self.carried[i] = _motion_in_frame(frame, self.velocities[frame.parent])
            self.velocities[i] = share("v", i, self.carried[i] + self._joint_motion(i, m.free.q_dot, m.active.s_dot))
        self.momenta = self._summed_inwards("h", map(ca.mtimes, self.inertias, self.velocities))

    @property
    def generalised_momenta(self) -> ca.SX:
        """Momenta p = ∂L/∂ẋ of the free velocities (f,)."""
        rates = self.m.free.q_dot, self.m.active.s_dot
        own = [frame.armature @ rates[frame.prescribed][frame.rows, 0] for frame in self.frames]
        return self._axis_forces(self.momenta) + self._free_and_active_columns(own)[0]

    @property
    def lagrangian_gradient(self) -> ca.SX:
        """Gradient Kᵀ ∂L/∂q without springs (f,)."""
        gravity = [ca.vertcat(ca.SX(3, 1), self.m.gravity_vector())] * (len(self.frames) + 1)
        for i, frame in enumerate(self.frames):
            gravity[i] = self._share("w", i, ca.vertcat(ca.SX(3, 1), frame.rotation.T @ gravity[frame.parent][3:]))
        weights = self._summed_inwards("W", map(ca.mtimes, self.inertias, gravity))
        carried = map(_force_cross, self.carried, self.momenta)
        return self._axis_forces([weight - h for weight, h in zip(weights, carried, strict=True)])

    def rates(self, p: ca.SX) -> ca.SX:
        """Rates q̇ of the momenta Fᵀ p (f,)."""
        zero = [ca.SX(6, 1)] * len(self.frames)
        return self._solve_articulated(p, self.m.active.s_dot, zero, zero, ca.SX(6, 1))[0]

    def accelerations(self, on_free: ca.SX) -> tuple[ca.SX, ca.SX]:
        """q̈ (f,) under generalised forces, and the forces λ of the operators (a,), by articulated bodies."""
        accelerations = self._velocity_product_accelerations
        base = self._ground_acceleration
        return self._solve_articulated(
            on_free, self.m.active.s_ddot, self._velocity_product_forces, accelerations, base
        )

    def _solve_articulated(
        self, load: ca.SX, prescribed: ca.SX, biases: list[ca.SX], turning: list[ca.SX], base: ca.SX
    ) -> tuple[ca.SX, ca.SX]:
        """Solve Sᵀ h = load for the rates: h = I a + bias + Σ_children Xᵀ h, a = X a_parent + turning + S rate.

        :param prescribed: rates of the active coordinates.
        :param base: a of the ground.
        :returns: rates of the free coordinates (f,), and Sᵀ h of the active ones (a,).
        """
        articulated, biases = [*self.inertias, ca.SX(6, 6)], [*biases, ca.SX(6, 1)]
        solved: list[tuple[ca.SX, ca.SX]] = [(ca.SX(6, 0), ca.SX(0, 1))] * len(self.frames)
        for i, frame in reversed([*enumerate(self.frames)]):
            A, b, S = articulated[i], biases[i], frame.axes
            if frame.prescribed:
                b += A @ (turning[i] + S @ prescribed[frame.rows, 0])
            else:
                U = A @ S
                both = solve_symmetric(S.T @ U + frame.armature, ca.horzcat(U.T, load[frame.rows, 0] - S.T @ b))
                solved[i] = both[:, :6], both[:, 6]
                A = _from_upper_triangle(A - U @ both[:, :6])
                b += A @ turning[i] + U @ both[:, 6]
            articulated[frame.parent] += _inertia_in_parent(frame, A)
            biases[frame.parent] += _force_in_parent(frame, b)
        motions, results = [base] * (len(self.frames) + 1), []
        for i, frame in enumerate(self.frames):
            carried = _motion_in_frame(frame, motions[frame.parent]) + turning[i]
            slope, constant = solved[i]
            rate = prescribed[frame.rows, 0] if frame.prescribed else constant - slope @ carried
            motions[i] = carried + frame.axes @ rate
            needed = articulated[i] @ motions[i] + biases[i]
            results.append(frame.axes.T @ needed + frame.armature @ rate if frame.prescribed else rate)
        return self._free_and_active_columns(results)

    @property
    def _ground_acceleration(self) -> ca.SX:
        """Acceleration of the ground that has the effect of gravity (6, 1)."""
        return ca.vertcat(ca.SX(3, 1), -self.m.gravity_vector())

    @property
    def _velocity_product_accelerations(self) -> list[ca.SX]:
        """Accelerations X v_parent × S q̇ that a frame at q̈ = 0 has beyond its parent's, (6, 1) each."""
        rates = self.m.free.q_dot, self.m.active.s_dot
        return [_motion_cross(v, self._joint_motion(i, *rates)) for i, v in enumerate(self.carried)]

    @property
    def _velocity_product_forces(self) -> list[ca.SX]:
        """Forces v ×* I v that keep each body moving at zero acceleration, (6, 1) each."""
        return [_force_cross(v, inertia @ v) for v, inertia in zip(self.velocities, self.inertias, strict=False)]

    @property
    def bias_forces(self) -> ca.SX:
        """Generalised forces that inertia and weight demand of the free coordinates at q̈ = 0 (f,)."""
        free, motions = ca.SX(self.m.free.q_dot.shape[0], 1), [self._ground_acceleration] * (len(self.frames) + 1)
        for i, (frame, turning) in enumerate(zip(self.frames, self._velocity_product_accelerations, strict=True)):
            before = _motion_in_frame(frame, motions[frame.parent])
            motions[i] = before + turning + self._joint_motion(i, free, self.m.active.s_ddot)
        inertial = map(ca.mtimes, self.inertias, motions)
        return self._axis_forces(self._summed_inwards("f", map(operator.add, inertial, self._velocity_product_forces)))

    @property
    def mass_matrix(self) -> ca.SX:
        """A of the free velocities (f, f), by composite rigid bodies."""
        composite, count = [*self.inertias, ca.SX(6, 6)], self.m.free.q_dot.shape[0]
        A, forces = ca.SX(count, count), [ca.SX(6, count) for _ in composite]  # at unit accelerations, one a column
        for i, frame in reversed([*enumerate(self.frames)]):
            if not frame.prescribed:
                forces[i][:, frame.rows] = composite[i] @ frame.axes
                A[frame.rows, :] = frame.axes.T @ forces[i]
                A[frame.rows, frame.rows] += frame.armature
                A[:, frame.rows] = A[frame.rows, :].T
            composite[frame.parent] += _inertia_in_parent(frame, composite[i])
            forces[frame.parent] += _force_in_parent(frame, forces[i])
        return ca.sparsify(A)

    def _joint_motion(self, i: int, free: ca.SX, active: ca.SX) -> ca.SX:
        """Motion S rate of a frame against its parent, from the rates of all coordinates (6, 1)."""
        frame = self.frames[i]
        return frame.axes @ (active if frame.prescribed else free)[frame.rows, 0]

    def _axis_forces(self, forces: list[ca.SX]) -> ca.SX:
        """Generalised forces Sᵀ f on the free velocities, from the force on each frame (f,)."""
        return self._free_and_active_columns([frame.axes.T @ f for frame, f in zip(self.frames, forces, strict=True)])[
            0
        ]

    def _summed_inwards(self, letter: str, forces: Iterable[ca.SX]) -> list[ca.SX]:
        """Forces on each frame, with those on the frames that it carries."""
        sums = [*forces, ca.SX(6, 1)]
        for i, frame in reversed([*enumerate(self.frames)]):
            sums[i] = self._share(letter, i, sums[i])
            sums[frame.parent] += _force_in_parent(frame, sums[i])
        return sums[:-1]

    def _free_and_active_columns(self, parts: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
        """Column of the rows of the free velocities, and that of the active ones, from the rows of each frame."""
        free, active = ca.SX(self.m.free.q_dot.shape[0], 1), ca.SX(self.m.active.s.shape[0], 1)
        for frame, part in zip(self.frames, parts, strict=True):
            (active if frame.prescribed else free)[frame.rows, 0] = part
        return free, active


def _motion_in_frame(frame: Frame, motion: ca.SX) -> ca.SX:
    """Motion X v of the parent, in the frame (6, 1)."""
    spin, velocity = motion[:3], motion[3:]
    return ca.vertcat(frame.rotation.T @ spin, frame.rotation.T @ (velocity + skew(spin) @ frame.position))


def _force_in_parent(frame: Frame, force: ca.SX) -> ca.SX:
    """Force Xᵀ f on the frame, in its parent; of several forces one a column (6, n)."""
    linear = frame.rotation @ force[3:, :]
    return ca.vertcat(frame.rotation @ force[:3, :] + skew(frame.position) @ linear, linear)


def _inertia_in_parent(frame: Frame, inertia: ca.SX) -> ca.SX:
    """Inertia Xᵀ I X of the frame, in its parent (6, 6)."""
    R, r = frame.rotation, skew(frame.position)
    angular, coupling, linear = (R @ block @ R.T for block in (inertia[:3, :3], inertia[:3, 3:], inertia[3:, 3:]))
    linear = _from_upper_triangle(linear)
    moved = coupling + r @ linear
    return ca.blockcat(_from_upper_triangle(angular - coupling @ r + r @ moved.T), moved, moved.T, linear)


def _from_upper_triangle(matrix: ca.SX) -> ca.SX:
    """Symmetric matrix with this upper triangle."""
    return ca.triu2symm(ca.triu(matrix))


def _force_cross(v: ca.SX, h: ca.SX) -> ca.SX:
    """Cross product v ×* h: rate of a force h that is fixed in a frame moving with v."""
    spin = skew(v[:3])
    return ca.vertcat(spin @ h[:3] + skew(v[3:]) @ h[3:], spin @ h[3:])


def _motion_cross(v: ca.SX, motion: ca.SX) -> ca.SX:
    """Cross product v × m: rate of a motion m that is fixed in a frame moving with v."""
    spin = skew(v[:3])
    return ca.vertcat(spin @ motion[:3], spin @ motion[3:] + skew(v[3:]) @ motion[:3])
