"""The double pendulum: two rods, two point masses."""

import casadi as ca

from liaisons.language import (
    ActiveCoordinate,
    Ball,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    Rod,
    Shapes,
    Trail,
    point,
)


class DoublePendulum(Mechanism):
    """Pendulum hung from the bob of another; an operator may move the upper pivot.

    With r_1 = r_p + l_1 (sin θ_1, -cos θ_1) and r_2 = r_1 + l_2 (sin θ_2, -cos θ_2)::

        T = ½ m_1 |r_1'|² + ½ m_2 |r_2'|²,    V = m_1 g z_1 + m_2 g z_2
        fixed pivot, δ = θ_1 - θ_2:
        (m_1 + m_2) l_1 θ_1'' + m_2 l_2 (θ_2'' cos δ + θ_2'² sin δ) = -(m_1 + m_2) g sin θ_1
                        l_2 θ_2'' + l_1 (θ_1'' cos δ - θ_1'² sin δ) = -g sin θ_2
        small angles:  g/Ω² = ½ (l_1 + l_2 ± √((l_1 - l_2)² + 4 l_1 l_2 m_2/(m_1 + m_2)))

    It consists of two :class:`Pendulum` s, the second with its pivot at the bob of the first; both angles are absolute.
    Large motions are chaotic, so only the energy shows whether they are right.

    Source: the two-pendulum case of K 2.2 (K eq. 12, 19) and of the normal modes of K 5.2.
    """

    mass_1 = Parameter(1.0, "kg", "mass of the upper bob", above=0)
    mass_2 = Parameter(1.0, "kg", "mass of the lower bob", above=0)
    length_1 = Parameter(1.0, "m", "length of the upper rod", above=0)
    length_2 = Parameter(1.0, "m", "length of the lower rod", above=0)
    gravity = Gravity()
    theta_1 = Coordinate("rad", "angle of the upper rod from the downward vertical", start=0.5)
    theta_2 = Coordinate("rad", "angle of the lower rod from the downward vertical", start=0.7)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot", symbol="x_p")
    pivot_z = ActiveCoordinate("m", "height of the pivot", symbol="z_p")

    @point("m", "the upper bob")
    def bob_1(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.theta_1), ca.cos(self.theta_1)
        return {"x": self.pivot_x + self.length_1 * sine, "z": self.pivot_z - self.length_1 * cosine}

    @point("m", "the lower bob")
    def bob_2(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.theta_2), ca.cos(self.theta_2)
        return {"x": self.bob_1["x"] + self.length_2 * sine, "z": self.bob_1["z"] - self.length_2 * cosine}

    def picture(self) -> Shapes:
        pivot = {"x": self.pivot_x, "z": self.pivot_z}
        rods = [Rod(pivot, self.bob_1), Rod(self.bob_1, self.bob_2)]
        return [Trail(self.bob_2), *rods, Ball(self.bob_1), Ball(self.bob_2)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass_1 / 2 * self.speed_squared(self.bob_1) + self.mass_2 / 2 * self.speed_squared(self.bob_2)

    def potential_energy(self) -> ca.SX:
        return self.gravity * (self.mass_1 * self.bob_1["z"] + self.mass_2 * self.bob_2["z"])

    from liaisons_catalogue.solutions.double_pendulum import normal_modes, small_angles
