"""The falling cat in space: two equal halves that bend and twist against each other."""

import casadi as ca

from liaisons.language import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Orientation, Parameter

_A = ca.SX([0, 0, 1])  # axis of half A in its own frame


class SpatialCat(Mechanism):
    """Falling cat of two equal bodies of revolution; an operator prescribes the three angles of the joint between them.

    Half A has its axis a along its own z; half B relative to it is turned by Rz(χ) Rx(κ) Rz(-χ + τ), which gives its
    axis b: bent by κ about a direction at the azimuth χ.  In the frame of A, with ω_B = ω + χ' a + κ' n + (τ' - χ') b,
    n = (cos χ, sin χ, 0), I and J the moments of inertia of each half across and about its axis, and d (a + b) the
    vector from one centre of mass to the other::

        T = m |v_G|² + ¼ m |d b' + ω × d (a + b)|²
            + ½ I (|ω|² + |ω_B|²) + ½ (J - I) ((ω·a)² + (ω_B·b)²),    V = 2 m g z_G       M eq. 58
        H, the angular momentum about the centre of mass, is constant in the inertial frame

    At H = 0 and without twist (τ constant) the bisector e ~ a + b keeps its direction, so that the position of the
    joint does not matter, and the plane of the bend turns about it::

        ψ' = J c χ' / (I s² + J c²),    c = cos κ/2,  s = sin κ/2

    When the bend has gone round at constant κ (χ by 2π), the cat has its shape again and has turned by Φ = 2π J c/(I s²
    + J c²).

    Source: M 8.2, eq. 57-60; the twist-free motion after Rademaker and ter Braak, Kane and Scher.
    """

    mass = Parameter(2.0, "kg", "mass of each half", above=0)
    inertia_transverse = Parameter(
        0.10, "kg.m2", "of each half, about a transverse axis through its centre", above=0, symbol="I"
    )
    inertia_axial = Parameter(0.02, "kg.m2", "moment of inertia of each half about its own axis", above=0, symbol="J")
    joint_distance = Parameter(
        0.2, "m", "distance from the centre of each half to the joint, along its axis", minimum=0, symbol="d"
    )
    gravity = Gravity()
    com_x = Coordinate("m", "position of the centre of mass", symbol="x_G")
    com_y = Coordinate("m", "position of the centre of mass", symbol="y_G")
    com_z = Coordinate("m", "height of the centre of mass", start_rate=9.81, symbol="z_G")
    attitude = Orientation("attitude of half A", start="momentum")
    bend = ActiveCoordinate("rad", "angle between the axes of the two halves", symbol="κ")
    azimuth = ActiveCoordinate("rad", "direction about which half B is bent, from the x axis of half A", symbol="χ")
    twist = ActiveCoordinate("rad", "turn of half B about its own axis", symbol="τ")
    experiment = Experiment(
        stop_time=2.0, reference={"bend": 0.5, "bend_dot": 0.3, "azimuth_dot": 2.0, "twist_ddot": 1.0}
    )

    def _half_B(self) -> tuple[ca.SX, ca.SX]:  # noqa: N802
        """Axis b of half B, and angular velocity of half B relative to half A, both in the frame of A."""
        sine, cosine = ca.sin(self.azimuth), ca.cos(self.azimuth)
        hinge = ca.vertcat(cosine, sine, 0)
        axis = ca.vertcat(sine * ca.sin(self.bend), -cosine * ca.sin(self.bend), ca.cos(self.bend))
        azimuth_rate = self.dot(self.azimuth)
        spin = azimuth_rate * _A + self.dot(self.bend) * hinge + (self.dot(self.twist) - azimuth_rate) * axis
        return axis, spin

    def kinetic_energy(self) -> ca.SX:
        omega, (axis, spin) = self.attitude.rate, self._half_B()
        fall = self.mass * self.speed_squared({"x": self.com_x, "y": self.com_y, "z": self.com_z})
        apart = self.joint_distance * (_A + axis)
        orbit = self.mass / 4 * ca.sumsqr(self.dot(apart) + ca.cross(omega, apart))
        return fall + orbit + self._rotational_energy(omega, _A) + self._rotational_energy(omega + spin, axis)

    def _rotational_energy(self, omega: ca.SX, axis: ca.SX) -> ca.SX:
        """Kinetic energy of rotation of a half about its centre of mass."""
        along = ca.dot(omega, axis) ** 2
        return (self.inertia_transverse * (ca.sumsqr(omega) - along) + self.inertia_axial * along) / 2

    def potential_energy(self) -> ca.SX:
        return 2 * self.mass * self.gravity * self.com_z

    from liaisons_catalogue.pictures.spatial_cat import picture
    from liaisons_catalogue.solutions.spatial_cat import bend_for, bisector, cone_turn, exact, turn
