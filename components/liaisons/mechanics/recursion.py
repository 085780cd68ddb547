"""Equations of motion of a linkage by recursion over its frames, at a cost that is linear in their number.

Spatial vectors are those of Featherstone (Rigid Body Dynamics Algorithms, 2008): motions (ω, v) and forces (n, f) about
the origin of a frame, with its axes.  X takes motions from the parent's frame, Xᵀ forces back; S are the axes of the
frame's coordinates, I its spatial inertia, w the acceleration of gravity in its axes.

=============  =============================================================================================
velocities     v = X v_parent + S q̇
momenta        h = I v + Σ_children Xᵀ h;  p = Sᵀ h
∂L/∂q          (X v_parent × S)ᵀ h + Sᵀ W,  W = I w + Σ_children Xᵀ W
q̇ of p, σ̇      inwards A = I, b = 0, and of each child, with U = A S, D = Sᵀ U, u = p − Sᵀ b:  A − U D⁻¹ Uᵀ and
               b + U D⁻¹ u; if it is prescribed A and b + U σ̇;  outwards q̇ = D⁻¹ (u − Uᵀ X v_parent)
q̈, λ           the same with forces, bias v ×* I v and turning X v_parent × S q̇: articulated bodies
mass matrix    composite rigid bodies
=============  =============================================================================================

The recursion of q̇ is Hamilton's form of the method of articulated bodies.
"""

from collections.abc import Callable

import casadi as ca

from liaisons.expressions.algebra import solve_symmetric
from liaisons.language.joints import Frame, skew
from liaisons.language.linkage import Linkage


class Recursion:
    """Terms of Lagrange's equations of a linkage, by recursion.

    :param share: letter, number of a frame and a spatial vector of it → what stands for the vector in all that follows.
    """

    def __init__(self, m: Linkage, share: Callable[[str, int, ca.SX], ca.SX] = lambda *vectors: vectors[-1]) -> None:
        self.m, self.frames, self._share = m, m.frames, share
        self.inertias = [m.spatial_inertia(frame.body) for frame in m.frames]
        self.carried = [ca.SX(6, 1)] * len(m.frames)  # X v_parent
        self.velocities = [ca.SX(6, 1)] * len(m.frames)
        for i, frame in enumerate(m.frames):
            self.carried[i] = _moved(frame, _of_parent(self.velocities, frame))
            self.velocities[i] = share("v", i, self.carried[i] + self._along(i, m.free.q_dot, m.active.s_dot))
        self.momenta = [inertia @ v for inertia, v in zip(self.inertias, self.velocities, strict=True)]
        self._inwards("h", self.momenta)

    @property
    def generalised_momenta(self) -> ca.SX:
        """p of the free velocities (f,)."""
        return self._along_axes(self.momenta)

    @property
    def pull(self) -> ca.SX:
        """Kᵀ ∂L/∂q without springs (f,)."""
        falling, weights = [], []
        for i, (frame, inertia) in enumerate(zip(self.frames, self.inertias, strict=True)):
            above = self.m.gravity_vector() if frame.parent < 0 else falling[frame.parent][3:]
            falling.append(self._share("w", i, ca.vertcat(ca.SX(3, 1), frame.rotation.T @ above)))
            weights.append(inertia @ falling[i])
        self._inwards("W", weights)
        carried = map(_crossed, self.carried, self.momenta)
        return self._along_axes([weight - h for weight, h in zip(weights, carried, strict=True)])

    def rates(self, p: ca.SX) -> ca.SX:
        """q̇ of the momenta Fᵀ p (f,)."""
        zero = [ca.SX(6, 1)] * len(self.frames)
        return self._articulated(p, self.m.active.s_dot, zero, zero, ca.SX(6, 1))[0]

    def accelerations(self, on_free: ca.SX) -> tuple[ca.SX, ca.SX]:
        """q̈ (f,) under generalised forces, and the forces λ of the operators (a,), by articulated bodies."""
        resting = [_crossed(v, inertia @ v) for v, inertia in zip(self.velocities, self.inertias, strict=True)]
        return self._articulated(on_free, self.m.active.s_ddot, resting, self._turning, self._upwards)

    def _articulated(
        self, load: ca.SX, prescribed: ca.SX, biases: list[ca.SX], turning: list[ca.SX], base: ca.SX
    ) -> tuple[ca.SX, ca.SX]:
        """Solve Sᵀ h = load for the rates: h = I a + bias with the children's, a = X a_parent + turning + S rate.

        :param prescribed: rates of the active coordinates; ``base`` is a of the ground.
        :returns: rates of the free coordinates (f,), and Sᵀ h of the active ones (a,).
        """
        articulated, biases = list(self.inertias), list(biases)
        solved: list[tuple[ca.SX, ca.SX]] = [(ca.SX(6, 0), ca.SX(0, 1))] * len(self.frames)
        for i, frame in reversed([*enumerate(self.frames)]):
            A, b, S = articulated[i], biases[i], frame.axes
            if frame.prescribed:
                b += A @ (turning[i] + S @ prescribed[frame.rows, 0])
            else:
                U = A @ S
                both = solve_symmetric(S.T @ U, ca.horzcat(U.T, load[frame.rows, 0] - S.T @ b))
                solved[i] = both[:, :6], both[:, 6]
                A = _symmetric(A - U @ both[:, :6])
                b += A @ turning[i] + U @ both[:, 6]
            if frame.parent >= 0:
                articulated[frame.parent] += _shifted(frame, A)
                biases[frame.parent] += _returned(frame, b)
        motions, results = [], []
        for i, frame in enumerate(self.frames):
            carried = _moved(frame, base if frame.parent < 0 else motions[frame.parent]) + turning[i]
            slope, constant = solved[i]
            rate = prescribed[frame.rows, 0] if frame.prescribed else constant - slope @ carried
            motions.append(carried + frame.axes @ rate)
            needed = articulated[i] @ motions[i] + biases[i]
            results.append(frame.axes.T @ needed if frame.prescribed else rate)
        return self._collected(results)

    @property
    def _upwards(self) -> ca.SX:
        """Acceleration of the ground that has the effect of gravity (6, 1)."""
        return ca.vertcat(ca.SX(3, 1), -self.m.gravity_vector())

    @property
    def _turning(self) -> list[ca.SX]:
        """Accelerations of the frames at q̈ = 0 beyond those of their parents (6, 1)."""
        rates = self.m.free.q_dot, self.m.active.s_dot
        return [_commuted(v, self._along(i, *rates)) for i, v in enumerate(self.carried)]

    @property
    def resistance(self) -> ca.SX:
        """Generalised forces on the free coordinates that their inertia and weight would have at q̈ = 0 (f,)."""
        free, motions, forces = ca.SX(self.m.free.q_dot.shape[0], 1), [], []
        for i, (frame, turning) in enumerate(zip(self.frames, self._turning, strict=True)):
            before = self._upwards if frame.parent < 0 else motions[frame.parent]
            motions.append(_moved(frame, before) + turning + self._along(i, free, self.m.active.s_ddot))
            v, inertia = self.velocities[i], self.inertias[i]
            forces.append(inertia @ motions[i] + _crossed(v, inertia @ v))
        self._inwards("f", forces)
        return self._along_axes(forces)

    @property
    def mass_matrix(self) -> ca.SX:
        """A of the free velocities (f, f), by composite rigid bodies."""
        composite, count = list(self.inertias), self.m.free.q_dot.shape[0]
        A, forces = ca.SX(count, count), [ca.SX(6, count) for _ in self.frames]  # at unit accelerations, one a column
        for i, frame in reversed([*enumerate(self.frames)]):
            if not frame.prescribed:
                forces[i][:, frame.rows] = composite[i] @ frame.axes
                A[frame.rows, :] = frame.axes.T @ forces[i]
                A[:, frame.rows] = A[frame.rows, :].T
            if frame.parent >= 0:
                composite[frame.parent] += _shifted(frame, composite[i])
                forces[frame.parent] += _returned(frame, forces[i])
        return ca.sparsify(A)

    def _along(self, i: int, free: ca.SX, active: ca.SX) -> ca.SX:
        frame = self.frames[i]
        return frame.axes @ (active if frame.prescribed else free)[frame.rows, 0]

    def _along_axes(self, forces: list[ca.SX]) -> ca.SX:
        """Sᵀ times the force of each frame, of the free velocities (f,)."""
        return self._collected([frame.axes.T @ f for frame, f in zip(self.frames, forces, strict=True)])[0]

    def _inwards(self, letter: str, forces: list[ca.SX]) -> None:
        """Add to the force of each frame those of the frames that it carries."""
        for i, frame in reversed([*enumerate(self.frames)]):
            forces[i] = self._share(letter, i, forces[i])
            if frame.parent >= 0:
                forces[frame.parent] += _returned(frame, forces[i])

    def _collected(self, parts: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
        """Columns of the free and of the active velocities, from those of the frames."""
        free, active = ca.SX(self.m.free.q_dot.shape[0], 1), ca.SX(self.m.active.s.shape[0], 1)
        for frame, part in zip(self.frames, parts, strict=True):
            (active if frame.prescribed else free)[frame.rows, 0] = part
        return free, active


def _of_parent(motions: list[ca.SX], frame: Frame) -> ca.SX:
    return ca.SX(6, 1) if frame.parent < 0 else motions[frame.parent]


def _moved(frame: Frame, motion: ca.SX) -> ca.SX:
    """X times a motion of the parent's frame."""
    spin, velocity = motion[:3], motion[3:]
    return ca.vertcat(frame.rotation.T @ spin, frame.rotation.T @ (velocity + skew(spin) @ frame.position))


def _returned(frame: Frame, force: ca.SX) -> ca.SX:
    """Xᵀ times a force of the frame; or several, in columns."""
    linear = frame.rotation @ force[3:, :]
    return ca.vertcat(frame.rotation @ force[:3, :] + skew(frame.position) @ linear, linear)


def _shifted(frame: Frame, inertia: ca.SX) -> ca.SX:
    """Xᵀ inertia X (6, 6)."""
    R, r = frame.rotation, skew(frame.position)
    angular, coupling, linear = (R @ block @ R.T for block in (inertia[:3, :3], inertia[:3, 3:], inertia[3:, 3:]))
    linear = _symmetric(linear)
    moved = coupling + r @ linear
    return ca.blockcat(_symmetric(angular - coupling @ r + r @ moved.T), moved, moved.T, linear)


def _symmetric(matrix: ca.SX) -> ca.SX:
    """The matrix from its upper triangle."""
    return ca.triu2symm(ca.triu(matrix))


def _crossed(v: ca.SX, h: ca.SX) -> ca.SX:
    """v ×* h: rate of a force that is constant in a frame that moves with v."""
    spin = skew(v[:3])
    return ca.vertcat(spin @ h[:3] + skew(v[3:]) @ h[3:], spin @ h[3:])


def _commuted(v: ca.SX, motion: ca.SX) -> ca.SX:
    """v × motion: rate of a motion that is constant in a frame that moves with v."""
    spin = skew(v[:3])
    return ca.vertcat(spin @ motion[:3], spin @ motion[3:] + skew(v[3:]) @ motion[:3])
