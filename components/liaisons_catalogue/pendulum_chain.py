"""The hanging chain: many pendulums, each hung on the one above."""

from collections.abc import Mapping

import casadi as ca

from liaisons.chains import Chain
from liaisons.language import ActiveCoordinate, Ball, Coordinate, Gravity, Joint, Parameter, Rod, Shapes, Size, point


class PendulumChain(Chain):
    """Point masses on massless rods, each hung on the one before; an operator may move the pivot.

    With r_0 the pivot::

        r_j = r_(j-1) + l (sin θ_j, -cos θ_j)
        T = ½ m Σ |r_j'|²,    V = m g Σ z_j
        small angles:  L_N(Ω² l/g) = 0,    x_j ~ L_(N-j)(Ω² l/g)

    L_i are Laguerre polynomials, x_j [m] horizontal displacements in a normal mode; the angles are absolute.  Large
    motions are chaotic, so only the energy shows whether they are right.

    Source: K 2.2 (eq. 12, 19) for any number of links; the small motions are those of D. Bernoulli's hanging chain.
    """

    n = Size(10, "number of links")
    mass = Parameter(1.0, "kg", "mass of each bob", above=0)
    length = Parameter(1.0, "m", "length of each rod", above=0)
    gravity = Gravity()
    theta = Coordinate("rad", "angles of the rods from the downward vertical", start=0.1)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot", symbol="x_p")
    pivot_z = ActiveCoordinate("m", "height of the pivot", symbol="z_p")
    joint = Joint("m", "x", "z")

    @point("m", "the bobs")
    def bob(self) -> dict[str, ca.SX]:
        sine, cosine = ca.sin(self.theta), ca.cos(self.theta)
        return {"x": self.joint["x"] + self.length * sine, "z": self.joint["z"] - self.length * cosine}

    def base(self) -> dict[str, ca.SX]:
        return {"x": self.pivot_x, "z": self.pivot_z}

    def tip(self) -> Mapping[str, ca.SX]:
        return self.bob

    def picture(self) -> Shapes:
        return [Rod(self.joint, self.bob), Ball(self.bob, radius=0.15 * self.length)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bob["z"]

    from liaisons_catalogue.solutions.pendulum_chain import normal_modes, small_angles
