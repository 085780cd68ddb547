"""The satellite with three reaction wheels."""

import casadi as ca

from liaisons.language import (
    ActiveCoordinate,
    Box,
    Experiment,
    Mechanism,
    Orientation,
    Parameter,
    Rod,
    Shapes,
    assertion,
    circle,
)
from liaisons_catalogue.solutions.satellite import TENSOR

_SIGNS = "minors of different order are compared: only their signs count"


def _least_minor(matrix: ca.SX) -> ca.SX:
    """Smallest leading minor, positive where the symmetric matrix is positive definite (Sylvester)."""
    return ca.fmin(matrix[0, 0], ca.fmin(ca.det(matrix[:2, :2]), ca.det(matrix)))


class Satellite(Mechanism):
    """Rigid body in free fall whose attitude is moved by three wheels, along its axes x, y, z, that an operator turns.

    With the angular velocity ω in the body frame, the attitude R (body to inertial frame) and the wheel angles φ::

        T = ½ ω·Jω + J_w ω·φ' + ½ J_w φ'²
        H = R (J ω + J_w φ') is constant: in the inertial frame, to rounding
        J ω' + J_w φ'' = (J ω + J_w φ') × ω,      λ_k = J_w (φ_k'' + ω_k')               M eq. 27
        from rest, H = 0, one wheel after the other or all in proportion: a turn by -J⁻¹ J_w Δφ, for any φ(t)

    The torques of the motors are λ.  Turns about different axes do not commute, so the satellite may have turned when
    all wheels have returned to their first angles.

    Source: M 8.3, with 8.2.
    """

    J_xx = Parameter(10.0, "kg.m2", "moment of inertia about x, wheels locked", above=0)
    J_yy = Parameter(12.0, "kg.m2", "moment of inertia about y, wheels locked", above=0)
    J_zz = Parameter(8.0, "kg.m2", "moment of inertia about z, wheels locked", above=0)
    J_xy = Parameter(0.0, "kg.m2", "off-diagonal element of the inertia tensor")
    J_xz = Parameter(0.0, "kg.m2", "off-diagonal element of the inertia tensor")
    J_yz = Parameter(0.0, "kg.m2", "off-diagonal element of the inertia tensor")
    J_wheel = Parameter(0.1, "kg.m2", "moment of inertia of each wheel about its axis", above=0, symbol="J_w")
    attitude = Orientation("attitude of the satellite")
    wheel_1 = ActiveCoordinate("rad", "angle of the wheel along x", symbol="φ_1")
    wheel_2 = ActiveCoordinate("rad", "angle of the wheel along y", symbol="φ_2")
    wheel_3 = ActiveCoordinate("rad", "angle of the wheel along z", symbol="φ_3")
    experiment = Experiment(
        stop_time=60.0,
        step_size=0.05,
        reference={"omega_x_0": 0.1, "J_xy": 0.5, "wheel_1_dot": 1.0, "wheel_2_ddot": 0.1, "wheel_3_dot": -2.0},
    )

    @property
    def _inertia(self) -> ca.SX:
        """Inertia tensor J, (3, 3)."""
        return ca.reshape(ca.vertcat(*(self.symbols[name] for name in TENSOR)), 3, 3)

    def picture(self) -> Shapes:
        R, spins = self.attitude.matrix, (self.wheel_1, self.wheel_2, self.wheel_3)

        def position(r: ca.SX) -> dict[str, ca.SX]:
            """Components x, y, z of a vector, by axis."""
            return dict(zip("xyz", ca.vertsplit(r), strict=True))

        panels = [Box(position(side * R[:, 1]), R, (0.5, 1.1, 0.03)) for side in (-1, 1)]
        shapes = [Box({}, R, (0.5, 0.5, 0.5)), *panels]
        for i, spin in enumerate(spins):
            axis, a, b = 0.3 * R[:, i], R[:, (i + 1) % 3], R[:, (i + 2) % 3]
            spoke = 0.4 * (ca.cos(spin) * a + ca.sin(spin) * b)
            shapes += [circle(position(axis), 0.4, (a, b), 24), Rod(position(axis - spoke), position(axis + spoke))]
        return shapes

    def kinetic_energy(self) -> ca.SX:
        omega = self.attitude.rate
        wheels = self.dot(ca.vertcat(self.wheel_1, self.wheel_2, self.wheel_3))
        body = ca.dot(omega, self._inertia @ omega) / 2
        return body + self.J_wheel * (ca.dot(omega, wheels) + ca.sumsqr(wheels) / 2)

    @assertion("J must be positive definite", unchecked=_SIGNS)
    def inertia_is_positive(self) -> ca.SX:
        return _least_minor(self._inertia)

    @assertion("J must be positive definite without the wheels: J - J_wheel", unchecked=_SIGNS)
    def body_is_positive(self) -> ca.SX:
        return _least_minor(self._inertia - self.J_wheel * ca.SX.eye(3))

    @assertion(
        "each principal moment of J must be less than the sum of the other two (triangle inequality)", unchecked=_SIGNS
    )
    def inertia_is_of_masses(self) -> ca.SX:
        return _least_minor(ca.trace(self._inertia) / 2 * ca.SX.eye(3) - self._inertia)

    from liaisons_catalogue.solutions.satellite import exact, slew, slew_torque, steered
